/* Runs two springs twice: once by themselves, once with the law of the left one in this program. Both tapes have one digest. */
#include <escapement-run.h>
#include <stdio.h>
#include <string.h>

typedef struct { double position, velocity; } Motion;

static int failed(const escapement_run *run) {
    fprintf(stderr, "error: %s\n", escapement_run_error(run));
    return 1;
}

int main(int argc, char **argv) {
    const char *scenario = argc > 1 ? argv[1] : "";
    for (int here = 0; here < 2; here++) {
        escapement_run *run;
        escapement_run_sample input = {.size = sizeof input};
        escapement_run_outcome outcome = {.size = sizeof outcome};
        uint32_t reached = 0;
        Motion mass = {0.02, 0.0}, neighbour;
        if (escapement_run_start(scenario, NULL, &run)) return failed(run);
        if (!here) {
            if (!escapement_run_read_input(run, "left.neighbour", &input)) return 1;
            puts(escapement_run_error(run));
            if (escapement_run_to(run, 1.0)) return failed(run);
        }
        while (here) {
            if (escapement_run_to_step(run, "left", &reached)) return failed(run);
            if (!reached) break;
            if (escapement_run_read_input(run, "left.neighbour", &input)) return failed(run);
            memcpy(&neighbour, input.bytes, sizeof neighbour);
            double pull = 20.0 * (neighbour.position - mass.position) - 40.0 * mass.position;
            mass.velocity += 0.001 * (pull - 0.0 * mass.velocity);
            mass.position += 0.001 * mass.velocity;
            if (escapement_run_set_output(run, "left.motion", &mass, sizeof mass)) return failed(run);
        }
        if (escapement_run_end(run, &outcome)) return failed(run);
        puts(outcome.digest);
        escapement_run_free(run);
    }
    return 0;
}
