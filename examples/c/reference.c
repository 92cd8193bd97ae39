/* The reference position: from rest to a height, without a jump in velocity. */
#include "messages.h"

typedef struct { double height, rise; } Reference;

static escapement_status describe(const escapement_host *host, void **own) {
    Reference *reference = *own;
    host->kind(host, ESCAPEMENT_SAMPLED);
    ESCAPEMENT_OUTPUT(host, "target", Target);
    escapement_number(host, "height", "m", &reference->height);
    return escapement_number(host, "rise", "s", &reference->rise);
}

static escapement_status step(const escapement_host *host, void *own, const escapement_step *step, const void *const *inputs,
                              void *const *outputs) {
    Reference *reference = own;
    double part = step->t < reference->rise ? step->t / reference->rise : 1.0;
    (void)host, (void)inputs;
    ((Target *)outputs[0])->position = reference->height * part * part * (3.0 - 2.0 * part);
    return ESCAPEMENT_OK;
}

static const escapement_participant reference = {
    ESCAPEMENT_TABLE, .name = "reference", .version = "1.0", .own_size = sizeof(Reference), .state_size = ESCAPEMENT_STATELESS,
    .describe = describe, .step = step,
};
ESCAPEMENT_PLUGIN(&reference);
ESCAPEMENT_MAIN(&reference);
