/* The mass of examples/c/spring.c, which is killed once: at activation 2000, unless the file of its parameter `mark` is there. */
#include <signal.h>
#include <stdio.h>
#include <unistd.h>

#include <escapement.h>

typedef struct { double position, velocity; } Motion;
typedef struct { Motion motion; const char *mark; } Mass;
ESCAPEMENT_MESSAGE(Motion, ESCAPEMENT_FIELD(Motion, position, "m", "N"), ESCAPEMENT_FIELD(Motion, velocity, "m/s", "N"));

static escapement_status describe(const escapement_host *host, void **own) {
    Mass *mass = *own;
    host->kind(host, ESCAPEMENT_CONTINUOUS);
    ESCAPEMENT_INPUT(host, "neighbour", Motion);
    ESCAPEMENT_OUTPUT(host, "motion", Motion);
    escapement_number(host, "position", NULL, &mass->motion.position);
    return host->text(host, "mark", 1, &mass->mark);
}

static escapement_status initialise(const escapement_host *host, void *own, double t, void *const *outputs) {
    (void)host, (void)t;
    *(Motion *)outputs[0] = ((Mass *)own)->motion;
    return ESCAPEMENT_OK;
}

static escapement_status step(const escapement_host *host, void *own, const escapement_step *step, const void *const *inputs,
                              void *const *outputs) {
    const Motion *neighbour = inputs[0];
    Mass *mass = own;
    Motion *motion = &mass->motion;
    double acceleration = 5.0 * (neighbour->position - motion->position) - 40.0 * motion->position;
    if (step->index == 2000 && access(mass->mark, F_OK) != 0) {
        fclose(fopen(mass->mark, "w"));
        host->log(host, "is killed now");
        kill(getpid(), SIGKILL);
    }
    motion->velocity += step->period * acceleration;
    motion->position += step->period * motion->velocity;
    *(Motion *)outputs[0] = *motion;
    return ESCAPEMENT_OK;
}

static const escapement_participant dies = {
    ESCAPEMENT_TABLE, .name = "dies", .version = "1.0", .own_size = sizeof(Mass), .state_size = sizeof(Motion),
    .describe = describe, .initialise = initialise, .step = step,
};
ESCAPEMENT_PLUGIN(&dies);
