/* A participant with one fault, which MISUSE selects. Otherwise it counts. */
#include <escapement.h>

#include <fenv.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <signal.h>

typedef struct { double value; uint64_t count; } Count;
ESCAPEMENT_MESSAGE(Count, ESCAPEMENT_FIELD(Count, value, "1", ""), ESCAPEMENT_FIELD(Count, count, "1", ""));

/* As an object that is compiled with -ffast-math: it sets floating-point modes when it is loaded. */
__attribute__((constructor)) static void load(void) {
    if (strcmp(MISUSE, "rounds-up") == 0)
        fesetround(FE_UPWARD);
}

static escapement_status describe(const escapement_host *host, void **own) {
    (void)own;
    if (strcmp(MISUSE, "no-kind") != 0)
        host->kind(host, ESCAPEMENT_SAMPLED);
    ESCAPEMENT_OPTIONAL_INPUT(host, "other", Count);
    ESCAPEMENT_OUTPUT(host, "count", Count);
    if (strcmp(MISUSE, "port-twice") == 0)
        ESCAPEMENT_OUTPUT(host, "count", Count);
    if (strcmp(MISUSE, "padding") == 0) {
        static const escapement_message odd = {"Odd", Count_fields, 1, sizeof(Count)};
        host->output(host, "odd", &odd);
    }
    if (strcmp(MISUSE, "steering-field") == 0) {
        static const escapement_field field = {"width\n", "1", "", ESCAPEMENT_F64, 0, 0, {0}};
        static const escapement_message odd = {"Odd", &field, 1, 8};
        host->output(host, "odd", &odd);
    }
    if (strcmp(MISUSE, "own-past-end") == 0)
        memset(*own, 0, sizeof(Count) + 1);
    if (strcmp(MISUSE, "no-reason") == 0)
        return 7;
    return ESCAPEMENT_OK;
}

static escapement_status step(const escapement_host *host, void *own, const escapement_step *step, const void *const *inputs,
                              void *const *outputs) {
    Count *count = own, *output = outputs[0], *input = (Count *)(uintptr_t)inputs[0];
    count->count += 1;
    count->value += 0.1;
    *output = *count;
    if (strcmp(MISUSE, "unseen") == 0 && (escapement_is_seen(host, 0) || escapement_is_ever_seen(host, 0)))
        return escapement_fail(host, "the count is seen");
    if (step->index == 5) {
        if (strcmp(MISUSE, "past-end") == 0)
            memset(output + 1, 0, 1);
        if (strcmp(MISUSE, "to-input") == 0)
            input->count = 1;
        if (strcmp(MISUSE, "past-input") == 0)
            memset(input + 1, 0, 1);
        if (strcmp(MISUSE, "before-start") == 0)
            memset((char *)output - 8, 0, 8);
        while (strcmp(MISUSE, "hangs") == 0) {
            escapement_log(host, "hangs");
            pause();
        }
        if (strcmp(MISUSE, "exit") == 0)
            exit(0);
        if (strcmp(MISUSE, "fails") == 0)
            return escapement_fail(host, "the count is %d; at most %d are allowed", (int)count->count, 5);
        if (strcmp(MISUSE, "fails-at-length") == 0) {
            char reason[1000];
            memset(reason, 'a', 999);
            reason[999] = 0;
            return escapement_fail(host, "%s\xc3\xa9 and more", reason);
        }
        if (strcmp(MISUSE, "fails-in-latin-1") == 0)
            return host->fail(host, "the angle is 100\xb0, too large");
        if (strcmp(MISUSE, "late-parameter") == 0)
            escapement_number(host, "late", NULL, &count->value);
    }
    return ESCAPEMENT_OK;
}

static escapement_status save(const escapement_host *host, void *own) {
    if (strcmp(MISUSE, "save-fails") == 0)
        return escapement_fail(host, "the file of the state is locked");
    if (strcmp(MISUSE, "save-much") == 0)
        return host->state(host, own, (uint64_t)65 << 20);
    return host->state(host, own, sizeof(Count));
}

static escapement_status restore(const escapement_host *host, void *own, const void *bytes, uint64_t size) {
    if (size != sizeof(Count))
        return escapement_fail(host, "a state has %d bytes", (int)sizeof(Count));
    memcpy(own, bytes, size);
    return ESCAPEMENT_OK;
}

static escapement_participant table = {
    ESCAPEMENT_TABLE, .name = "misuse", .version = "1.0", .own_size = sizeof(Count), .state_size = sizeof(Count),
    .describe = describe, .step = step,
};

const escapement_participant *escapement_plugin(uint32_t index) {
    if (strcmp(MISUSE, "version") == 0)
        table.abi = 7;
    if (strcmp(MISUSE, "size") == 0)
        table.size = 16;
    if (strcmp(MISUSE, "null-step") == 0)
        table.step = NULL;
    if (strcmp(MISUSE, "half") == 0)
        table.save = save;
    if (strncmp(MISUSE, "save-", 5) == 0) {
        table.save = save;
        table.restore = restore;
    }
    if (strcmp(MISUSE, "no-name") == 0)
        table.name = NULL;
    if (strcmp(MISUSE, "state-size") == 0)
        table.state_size = 100;
    if (strcmp(MISUSE, "empty") == 0)
        return NULL;
    return index == 0 ? &table : NULL;
}
ESCAPEMENT_MAIN(escapement_plugin(0));
