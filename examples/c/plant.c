/* A mass on a spring with a damper, pushed by a force. */
#include "messages.h"

typedef struct { Motion motion; double mass, stiffness, damping; } Plant; /* the state, then the parameters */

static escapement_status describe(const escapement_host *host, void **own) {
    Plant *plant = *own;
    host->kind(host, ESCAPEMENT_CONTINUOUS);
    ESCAPEMENT_INPUT(host, "push", Push);
    ESCAPEMENT_OUTPUT(host, "motion", Motion);
    escapement_number(host, "mass", "kg", &plant->mass);
    escapement_number(host, "stiffness", "N/m", &plant->stiffness);
    return escapement_number(host, "damping", "N s/m", &plant->damping);
}

static escapement_status step(const escapement_host *host, void *own, const escapement_step *step, const void *const *inputs,
                              void *const *outputs) {
    const Push *push = inputs[0];
    Plant *plant = own;
    Motion *motion = &plant->motion;
    double force = push->force - plant->stiffness * motion->position - plant->damping * motion->velocity;
    (void)host;
    motion->velocity += step->period * (force / plant->mass);
    motion->position += step->period * motion->velocity;
    *(Motion *)outputs[0] = *motion;
    return ESCAPEMENT_OK;
}

static const escapement_participant plant = {
    ESCAPEMENT_TABLE, .name = "plant", .version = "1.0", .own_size = sizeof(Plant), .state_size = sizeof(Motion),
    .describe = describe, .step = step,
};
ESCAPEMENT_PLUGIN(&plant);
ESCAPEMENT_MAIN(&plant);
