/* The messages of the participants of the position loop. */
#include <escapement.h>

typedef struct { double position, velocity; } Motion;
typedef struct { double force; } Push;
typedef struct { double position; } Target;
ESCAPEMENT_MESSAGE(Motion, ESCAPEMENT_FIELD(Motion, position, "m", "N"), ESCAPEMENT_FIELD(Motion, velocity, "m/s", "N"));
ESCAPEMENT_MESSAGE(Push, ESCAPEMENT_FIELD(Push, force, "N", "N"));
ESCAPEMENT_MESSAGE(Target, ESCAPEMENT_FIELD(Target, position, "m", "N"));
