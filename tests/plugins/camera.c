/* A camera whose pictures are ROWS by COLUMNS bytes, and a viewer that reports exposure, sum and last pixel of each. */
#include <string.h>

#include "escapement.h"

typedef struct {
    double exposure;
    uint8_t pixels[ROWS][COLUMNS];
} Picture;
ESCAPEMENT_MESSAGE(Picture, ESCAPEMENT_FIELD(Picture, exposure, "s", ""), ESCAPEMENT_MATRIX(Picture, pixels, "1", ""));

typedef struct {
    double exposure; /* of the picture that was seen */
    uint64_t sum;    /* of its pixels */
    uint64_t last;   /* its last pixel */
} Seen;
ESCAPEMENT_MESSAGE(Seen, ESCAPEMENT_FIELD(Seen, exposure, "s", ""), ESCAPEMENT_FIELD(Seen, sum, "1", ""),
                   ESCAPEMENT_FIELD(Seen, last, "1", ""));

static escapement_status describe_camera(const escapement_host *host, void **own) {
    (void)own;
    host->kind(host, ESCAPEMENT_SAMPLED);
    ESCAPEMENT_OUTPUT(host, "picture", Picture);
    return ESCAPEMENT_OK;
}

static escapement_status step_camera(const escapement_host *host, void *own, const escapement_step *step, const void *const *inputs,
                                     void *const *outputs) {
    Picture *picture = outputs[0];
    (void)host;
    (void)own;
    (void)inputs;
    picture->exposure = 0.001 * (double)(step->index + 1);
    for (size_t row = 0; row < ROWS; row++) {
        memset(picture->pixels[row], (int)((step->index + row) % 251), COLUMNS);
    }
    picture->pixels[ROWS - 1][COLUMNS - 1] = (uint8_t)(step->index + 1);
    return ESCAPEMENT_OK;
}

static escapement_status describe_viewer(const escapement_host *host, void **own) {
    (void)own;
    host->kind(host, ESCAPEMENT_SAMPLED);
    ESCAPEMENT_INPUT(host, "picture", Picture);
    ESCAPEMENT_OUTPUT(host, "seen", Seen);
    return ESCAPEMENT_OK;
}

static escapement_status step_viewer(const escapement_host *host, void *own, const escapement_step *step, const void *const *inputs,
                                     void *const *outputs) {
    const Picture *picture = inputs[0];
    Seen *seen = outputs[0];
    (void)host;
    (void)own;
    (void)step;
    *seen = (Seen){.exposure = picture->exposure, .last = picture->pixels[ROWS - 1][COLUMNS - 1]};
    for (size_t row = 0; row < ROWS; row++) {
        for (size_t column = 0; column < COLUMNS; column++) {
            seen->sum += picture->pixels[row][column];
        }
    }
    return ESCAPEMENT_OK;
}

static const escapement_participant camera = {
    ESCAPEMENT_TABLE,
    .name = "camera",
    .version = "1.0",
    .describe = describe_camera,
    .step = step_camera,
};
static const escapement_participant viewer = {
    ESCAPEMENT_TABLE,
    .name = "viewer",
    .version = "1.0",
    .describe = describe_viewer,
    .step = step_viewer,
};
ESCAPEMENT_PLUGIN(&camera, &viewer);
