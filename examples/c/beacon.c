/* A beacon that reports its activity as text and sends frames of varying length, and a station that reads them: texts and bytes as signals.
 *
 * One plug-in, two participants: run = { library = "libbeacon.so", participant = "beacon" } */
#include <string.h>

#include "escapement.h"

enum { IDLE, SENDING, FAULT = 9 };

typedef struct {
    uint32_t count; /* of frames */
    struct {
        uint32_t length;
        uint8_t data[32];
    } frame;
    char phase[24];
    uint8_t state;
    uint8_t padding[3];
} Beacon;
ESCAPEMENT_MESSAGE(Beacon, ESCAPEMENT_FIELD(Beacon, count, "1", ""), ESCAPEMENT_BYTES_FIELD(Beacon, frame),
                   ESCAPEMENT_TEXT_FIELD(Beacon, phase), ESCAPEMENT_ENUM_FIELD(Beacon, state, "idle = 0, sending = 1, fault = 9"),
                   ESCAPEMENT_FIELD(Beacon, padding, "1", ""));

typedef struct {
    uint32_t sum;    /* of the bytes of the last frame */
    char answer[24]; /* to the beacon */
    uint8_t heard;   /* the state of the beacon */
    uint8_t padding[3];
} Station;
ESCAPEMENT_MESSAGE(Station, ESCAPEMENT_FIELD(Station, sum, "1", ""), ESCAPEMENT_TEXT_FIELD(Station, answer),
                   ESCAPEMENT_ENUM_FIELD(Station, heard, "idle = 0, sending = 1, fault = 9"),
                   ESCAPEMENT_FIELD(Station, padding, "1", ""));

/* The beacon: three idle steps, then a frame, longer each time; each frame contains the station's previous answer. */
static escapement_status describe_beacon(const escapement_host *host, void **own) {
    (void)own;
    host->kind(host, ESCAPEMENT_SAMPLED);
    ESCAPEMENT_INPUT(host, "station", Station);
    ESCAPEMENT_OUTPUT(host, "beacon", Beacon);
    return ESCAPEMENT_OK;
}

static escapement_status step_beacon(const escapement_host *host, void *own, const escapement_step *step, const void *const *inputs,
                                     void *const *outputs) {
    Beacon *beacon = own;
    const Station *station = inputs[0];
    (void)host;
    memset(&beacon->frame, 0, sizeof beacon->frame);
    beacon->state = IDLE;
    escapement_put_text(beacon->phase, sizeof beacon->phase, "wartet \xe2\x80\x93 idle");
    if (step->index % 4 == 3) {
        beacon->count++;
        beacon->state = beacon->count % 5 == 0 ? FAULT : SENDING;
        beacon->frame.length = beacon->count % (sizeof beacon->frame.data + 1);
        for (uint32_t at = 0; at < beacon->frame.length; at++) {
            beacon->frame.data[at] = (uint8_t)(at * 37 + (uint8_t)station->answer[at % sizeof station->answer]);
        }
        escapement_put_text(beacon->phase, sizeof beacon->phase, beacon->state == FAULT ? "fault, \"again\"" : "sending");
    }
    memcpy(outputs[0], beacon, sizeof *beacon);
    return ESCAPEMENT_OK;
}

/* The station: adds up the bytes, and answers with the beacon's text in brackets. */
static escapement_status describe_station(const escapement_host *host, void **own) {
    (void)own;
    host->kind(host, ESCAPEMENT_SAMPLED);
    ESCAPEMENT_INPUT(host, "beacon", Beacon);
    ESCAPEMENT_OUTPUT(host, "station", Station);
    return ESCAPEMENT_OK;
}

static escapement_status step_station(const escapement_host *host, void *own, const escapement_step *step, const void *const *inputs,
                                      void *const *outputs) {
    Station *station = own;
    const Beacon *beacon = inputs[0];
    char answer[sizeof beacon->phase + 3];
    (void)host;
    (void)step;
    for (uint32_t at = 0; at < beacon->frame.length; at++) {
        station->sum += beacon->frame.data[at];
    }
    snprintf(answer, sizeof answer, "<%.*s>", (int)sizeof beacon->phase, beacon->phase);
    if (!escapement_put_text(station->answer, sizeof station->answer, answer)) {
        return escapement_fail(host, "the answer `%s` is too long", answer);
    }
    station->heard = beacon->state;
    memcpy(outputs[0], station, sizeof *station);
    return ESCAPEMENT_OK;
}

static const escapement_participant beacon = {
    ESCAPEMENT_TABLE,
    .name = "beacon",
    .version = "1.0",
    .own_size = sizeof(Beacon),
    .state_size = sizeof(Beacon),
    .describe = describe_beacon,
    .step = step_beacon,
};
static const escapement_participant station = {
    ESCAPEMENT_TABLE,
    .name = "station",
    .version = "1.0",
    .own_size = sizeof(Station),
    .state_size = sizeof(Station),
    .describe = describe_station,
    .step = step_station,
};
ESCAPEMENT_PLUGIN(&beacon, &station);
