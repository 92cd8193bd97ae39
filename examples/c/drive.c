/* A run from C: a mass of the scenario is attached to a spring, and this program moves the spring's other end. Then it restores a checkpoint
 * and repeats the motion: both tapes have the same digest.
 *
 *     cc drive.c $(pkg-config --cflags --libs escapement-run) -o drive && ./drive drive.toml
 */
#include <escapement-run.h>
#include <stdio.h>
#include <string.h>

typedef struct { double position, velocity; } Motion;

static int failed(const escapement_run *run) {
    fprintf(stderr, "error: %s\n", escapement_run_error(run));
    return 1;
}

/* Moves the neighbour to and fro until `end`. */
static escapement_run_status shake(escapement_run *run, double end) {
    for (int step = (int)(escapement_run_now(run) * 100.0 + 0.5); step < (int)(end * 100.0 + 0.5); step++) {
        Motion neighbour = {0.002 * (step % 50), 0.0};
        if (escapement_run_set(run, "mass.neighbour", &neighbour, sizeof neighbour)) return ESCAPEMENT_RUN_FAILED;
        if (escapement_run_to(run, (step + 1) / 100.0)) return ESCAPEMENT_RUN_FAILED;
    }
    return ESCAPEMENT_RUN_OK;
}

int main(int argc, char **argv) {
    char first[72];
    for (int again = 0; again < 2; again++) {
        escapement_run *run;
        escapement_run_checkpoint *half = NULL;
        if (escapement_run_start(argc > 1 ? argv[1] : "drive.toml", NULL, &run) || shake(run, 1.0) || escapement_run_save(run, &half) ||
            shake(run, 1.7))
            return failed(run);
        /* The second time, continue from the checkpoint again. */
        if (again && escapement_run_restore(run, half)) return failed(run);
        if (shake(run, 2.0)) return failed(run);
        escapement_run_sample sample = {.size = sizeof sample};
        escapement_run_outcome outcome = {.size = sizeof outcome};
        double position, farthest;
        if (escapement_run_newest(run, "mass.motion", &sample)) return failed(run);
        printf("t = %g s: position %.17g m\n", sample.stamp, ((const Motion *)sample.bytes)->position);
        if (escapement_run_field(run, "mass.motion", "position", &position, 1) || escapement_run_figure(run, "farthest", &farthest) ||
            escapement_run_end(run, &outcome))
            return failed(run);
        printf("farthest %.17g m, complete %u, digest %s\n", farthest, outcome.complete, outcome.digest);
        escapement_run_checkpoint_free(half);
        escapement_run_free(run);
        if (again && strcmp(first, outcome.digest) != 0) return 1;
        memcpy(first, outcome.digest, sizeof first);
    }
    return 0;
}
