/* A PID controller with a limited force, whose integral is frozen at the limit. */
#include "messages.h"

typedef struct { double integral, gain, integral_time, damping, limit; } Pid; /* the state, then the parameters */

static escapement_status describe(const escapement_host *host, void **own) {
    Pid *pid = *own;
    host->kind(host, ESCAPEMENT_SAMPLED);
    ESCAPEMENT_INPUT(host, "measured", Motion);
    ESCAPEMENT_INPUT(host, "target", Target);
    ESCAPEMENT_OUTPUT(host, "push", Push);
    escapement_number(host, "gain", "N/m", &pid->gain);
    escapement_number(host, "integral-time", "s", &pid->integral_time);
    escapement_number(host, "damping", "N s/m", &pid->damping);
    escapement_number(host, "limit", "N", &pid->limit);
    return pid->limit >= 0 ? ESCAPEMENT_OK : host->refuse(host, "limit", "a limit is not negative");
}

static escapement_status step(const escapement_host *host, void *own, const escapement_step *step, const void *const *inputs,
                              void *const *outputs) {
    const Motion *measured = inputs[0];
    const Target *target = inputs[1];
    Pid *pid = own;
    double error = target->position - measured->position;
    double wanted = pid->gain * (error + pid->integral / pid->integral_time) - pid->damping * measured->velocity;
    double force = wanted > pid->limit ? pid->limit : wanted < -pid->limit ? -pid->limit : wanted;
    (void)host;
    if (force == wanted)
        pid->integral += step->period * error;
    ((Push *)outputs[0])->force = force;
    return ESCAPEMENT_OK;
}

static const escapement_participant pid = {
    ESCAPEMENT_TABLE, .name = "pid", .version = "1.0", .own_size = sizeof(Pid), .state_size = sizeof(double),
    .describe = describe, .step = step,
};
ESCAPEMENT_PLUGIN(&pid);
ESCAPEMENT_MAIN(&pid);
