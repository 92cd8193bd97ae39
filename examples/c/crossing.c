/* A traffic light at a crossing, and pedestrians: enumerations, booleans and small integers as signals.
 *
 * One plug-in, two participants: run = { library = "libcrossing.so", participant = "light" } */
#include <stdbool.h>
#include <string.h>

#include "escapement.h"

enum { GREEN, AMBER, RED, RED_AMBER = 7 };

typedef struct {
    uint8_t phase;
    bool walk;
    int16_t left; /* of the phase, s */
} Signal;
ESCAPEMENT_MESSAGE(Signal, ESCAPEMENT_ENUM_FIELD(Signal, phase, "green = 0, amber = 1, red = 2, red and amber = 7"),
                   ESCAPEMENT_FIELD(Signal, walk, "1", ""), ESCAPEMENT_FIELD(Signal, left, "s", ""));

typedef struct {
    bool pressed[2]; /* on either side */
    int8_t balance;  /* pedestrians who have crossed to the right, minus those to the left */
    uint8_t waiting;
} Walkers;
ESCAPEMENT_MESSAGE(Walkers, ESCAPEMENT_FIELD(Walkers, pressed, "1", ""), ESCAPEMENT_FIELD(Walkers, balance, "1", ""),
                   ESCAPEMENT_FIELD(Walkers, waiting, "1", ""));

/* The light: green until a pedestrian presses, then amber, red while pedestrians cross, red and amber, green. */
typedef struct {
    Signal signal;
} Light;

static escapement_status describe_light(const escapement_host *host, void **own) {
    (void)own;
    host->kind(host, ESCAPEMENT_SAMPLED);
    ESCAPEMENT_INPUT(host, "walkers", Walkers);
    ESCAPEMENT_OUTPUT(host, "signal", Signal);
    return ESCAPEMENT_OK;
}

static escapement_status step_light(const escapement_host *host, void *own, const escapement_step *step, const void *const *inputs,
                                    void *const *outputs) {
    Signal *signal = &((Light *)own)->signal;
    const Walkers *walkers = inputs[0];
    (void)host;
    (void)step;
    if (signal->left > 0) {
        signal->left--;
    } else if (signal->phase == GREEN && (walkers->pressed[0] || walkers->pressed[1])) {
        *signal = (Signal){.phase = AMBER, .left = 2};
    } else if (signal->phase == AMBER) {
        *signal = (Signal){.phase = RED, .walk = true, .left = 8};
    } else if (signal->phase == RED) {
        *signal = (Signal){.phase = RED_AMBER, .left = 1};
    } else if (signal->phase == RED_AMBER) {
        *signal = (Signal){.phase = GREEN, .left = 15};
    }
    *(Signal *)outputs[0] = *signal;
    return ESCAPEMENT_OK;
}

/* The pedestrians: they arrive at random, press, and cross one after the other. */
typedef struct {
    Walkers walkers;
} Crowd;

static escapement_status describe_crowd(const escapement_host *host, void **own) {
    (void)own;
    host->kind(host, ESCAPEMENT_SAMPLED);
    ESCAPEMENT_INPUT(host, "signal", Signal);
    ESCAPEMENT_OUTPUT(host, "walkers", Walkers);
    return ESCAPEMENT_OK;
}

static escapement_status step_crowd(const escapement_host *host, void *own, const escapement_step *step, const void *const *inputs,
                                    void *const *outputs) {
    Walkers *walkers = &((Crowd *)own)->walkers;
    const Signal *signal = inputs[0];
    if (host->uniform(host, "arrivals", step->index) < 0.2 && walkers->waiting < 255) {
        walkers->waiting++;
        walkers->pressed[host->uniform(host, "sides", step->index) < 0.5] = true;
    }
    if (signal->walk && walkers->waiting > 0) {
        walkers->waiting--;
        if (walkers->pressed[0] && walkers->balance < 127) {
            walkers->balance++;
        } else if (walkers->balance > -128) {
            walkers->balance--;
        }
    }
    if (walkers->waiting == 0) {
        memset(walkers->pressed, 0, sizeof walkers->pressed);
    }
    *(Walkers *)outputs[0] = *walkers;
    return ESCAPEMENT_OK;
}

static const escapement_participant light = {
    ESCAPEMENT_TABLE,
    .name = "light",
    .version = "1.0",
    .own_size = sizeof(Light),
    .state_size = sizeof(Light),
    .describe = describe_light,
    .step = step_light,
};
static const escapement_participant crowd = {
    ESCAPEMENT_TABLE,
    .name = "crowd",
    .version = "1.0",
    .own_size = sizeof(Crowd),
    .state_size = sizeof(Crowd),
    .describe = describe_crowd,
    .step = step_crowd,
};
ESCAPEMENT_PLUGIN(&light, &crowd);
