// A participant whose optional member MEMBER has the right signature, or a wrong one that the compiler must not accept.
#include <escapement.hpp>

struct Motion { double position, velocity; };
ESCAPEMENT_MESSAGE(Motion, ESCAPEMENT_FIELD(Motion, position, "m", "N"), ESCAPEMENT_FIELD(Motion, velocity, "m/s", "N"));

struct Optional {
    escapement::Output<Motion> motion;
    Motion mass{};

    explicit Optional(escapement::Setup &setup) : motion(setup, "motion") { setup.kind(escapement::sampled); }
    void step(const escapement::Step &) { *motion = mass; }
    MEMBER
};

ESCAPEMENT_PARTICIPANT(optional, Optional, "1.0");
ESCAPEMENT_PLUGIN(&optional);
