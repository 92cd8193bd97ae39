/* The exchange of `escapement bench`, in C: 27 doubles are read and forwarded. RELAY_KIND is the kind. */
#include <string.h>

#include <escapement.h>

typedef struct {
    double values[27];
} Parcel;
ESCAPEMENT_MESSAGE(Parcel, ESCAPEMENT_FIELD(Parcel, values, "1", ""));

static escapement_status describe(const escapement_host *host, void **own) {
    (void)own;
    host->kind(host, RELAY_KIND);
    ESCAPEMENT_INPUT(host, "from", Parcel);
    ESCAPEMENT_OUTPUT(host, "to", Parcel);
    return ESCAPEMENT_OK;
}

static escapement_status step(const escapement_host *host, void *own, const escapement_step *now, const void *const *inputs,
                              void *const *outputs) {
    (void)host;
    (void)own;
    (void)now;
    Parcel *given = outputs[0];
    memcpy(given, inputs[0], sizeof *given);
    given->values[0] += 1.0;
    return ESCAPEMENT_OK;
}

static const escapement_participant relay = {
    ESCAPEMENT_TABLE, .name = "relay", .version = "1.0", .state_size = ESCAPEMENT_STATELESS, .describe = describe, .step = step,
};
ESCAPEMENT_MAIN(&relay);
