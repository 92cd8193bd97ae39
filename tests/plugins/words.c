/* A participant that sends its name, the last text that it received, and its mood: lists of texts and of enumerations. */
#include "escapement.h"
enum { CALM, PLEASED = 4, CROSS = 200 };
typedef struct { char word[2][16]; uint8_t moods[2]; _Bool heard; } Words;
static const escapement_field fields[] = {
    {"word", "1", "", ESCAPEMENT_TEXT, 0, 2, {2, 16}},
    {"moods", "calm = 0, pleased = 4, cross = 200", "", ESCAPEMENT_ENUM, 32, 1, {2}},
    {"heard", "1", "", ESCAPEMENT_BOOL, 34, 0, {0}}};
static const escapement_message Words_message = {"Words", fields, 3, sizeof(Words)};
static escapement_status describe(const escapement_host *host, void **own) {
    (void)own;
    host->kind(host, ESCAPEMENT_SAMPLED);
    ESCAPEMENT_INPUT(host, "heard", Words);
    ESCAPEMENT_OUTPUT(host, "said", Words);
    return ESCAPEMENT_OK;
}
static escapement_status step(const escapement_host *host, void *own, const escapement_step *step, const void *const *inputs,
                              void *const *outputs) {
    const Words *heard = inputs[0];
    Words *said = outputs[0];
    char text[40];
    (void)own;
    snprintf(text, sizeof text, "%s %u", host->name, (unsigned)step->index);
    escapement_put_text(said->word[0], sizeof said->word[0], text);
    memcpy(said->word[1], heard->word[0], sizeof said->word[1]);
    said->moods[0] = step->index % 3 == 1 ? PLEASED : step->index % 7 == 2 ? CROSS : CALM;
    said->moods[1] = heard->moods[0];
    said->heard = heard->word[0][0] != 0;
    return ESCAPEMENT_OK;
}
static const escapement_participant words = {ESCAPEMENT_TABLE, .name = "words", .version = "1", .state_size = ESCAPEMENT_STATELESS,
                                             .describe = describe, .step = step};
ESCAPEMENT_PLUGIN(&words);
