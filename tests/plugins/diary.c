/* The participant of tests/src/diary.rs in C. */
#include <escapement.h>

typedef struct { uint64_t number; } Page;
ESCAPEMENT_MESSAGE(Page, ESCAPEMENT_FIELD(Page, number, "1", ""));

typedef struct {
    Page page;
    int64_t fails_at;
} Diary;

static escapement_status describe(const escapement_host *host, void **own) {
    Diary *diary = *own;
    diary->fails_at = -1;
    host->kind(host, ESCAPEMENT_SAMPLED);
    ESCAPEMENT_OUTPUT(host, "page", Page);
    return host->integer(host, "fails-at", 0, &diary->fails_at);
}

static escapement_status initialise(const escapement_host *host, void *own, double t, void *const *outputs) {
    (void)own, (void)t, (void)outputs;
    host->log(host, "begins");
    return ESCAPEMENT_OK;
}

static escapement_status step(const escapement_host *host, void *own, const escapement_step *step, const void *const *inputs,
                              void *const *outputs) {
    Diary *diary = own;
    (void)inputs;
    diary->page.number++;
    *(Page *)outputs[0] = diary->page;
    if (step->index == 2) escapement_log(host, "is at page %d", (int)diary->page.number);
    if ((int64_t)step->index == diary->fails_at) return escapement_fail(host, "has no more pages");
    return ESCAPEMENT_OK;
}

static void terminate(const escapement_host *host, void *own) {
    static const char *const words[] = {"", "finished", "stopped", "replaced"};
    const uint32_t why = escapement_termination(host);
    if (why) escapement_log(host, "ends, %s, at page %d", words[why], (int)((Diary *)own)->page.number);
}

static const escapement_participant diary = {
    ESCAPEMENT_TABLE, .name = "diary", .version = "1.0", .own_size = sizeof(Diary), .state_size = sizeof(Page),
    .describe = describe, .initialise = initialise, .step = step, .terminate = terminate,
};
ESCAPEMENT_PLUGIN(&diary);
ESCAPEMENT_MAIN(&diary);
