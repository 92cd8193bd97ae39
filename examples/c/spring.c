/* A mass on a spring that its neighbour pulls along: examples/spring in C. One source, a program and a plug-in. */
#include <escapement.h>

typedef struct { double position, velocity; } Motion;
ESCAPEMENT_MESSAGE(Motion, ESCAPEMENT_FIELD(Motion, position, "m", "N"), ESCAPEMENT_FIELD(Motion, velocity, "m/s", "N"));

static escapement_status describe(const escapement_host *host, void **own) {
    Motion *mass = *own;
    host->kind(host, ESCAPEMENT_CONTINUOUS);
    ESCAPEMENT_INPUT(host, "neighbour", Motion);
    ESCAPEMENT_OUTPUT(host, "motion", Motion);
    return escapement_number(host, "position", NULL, &mass->position); /* m */
}

static escapement_status initialise(const escapement_host *host, void *own, double t, void *const *outputs) {
    (void)host, (void)t;
    *(Motion *)outputs[0] = *(Motion *)own;
    return ESCAPEMENT_OK;
}

static escapement_status step(const escapement_host *host, void *own, const escapement_step *step, const void *const *inputs,
                              void *const *outputs) {
    const Motion *neighbour = inputs[0];
    Motion *mass = own;
    double acceleration = 5.0 * (neighbour->position - mass->position) - 40.0 * mass->position; /* stiffness over mass, 1/s^2 */
    (void)host;
    mass->velocity += step->period * acceleration;
    mass->position += step->period * mass->velocity;
    *(Motion *)outputs[0] = *mass;
    return ESCAPEMENT_OK;
}

static const escapement_participant spring = {
    ESCAPEMENT_TABLE, .name = "spring", .version = "1.0", .own_size = sizeof(Motion), .state_size = sizeof(Motion),
    .describe = describe, .initialise = initialise, .step = step,
};
ESCAPEMENT_PLUGIN(&spring);
ESCAPEMENT_MAIN(&spring);
