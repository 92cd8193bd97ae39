/* Invalid calls of a program that drives runs: each line of its output gives a rejected call and the reason. */
#include <escapement-run.h>
#include <math.h>
#include <stdio.h>

typedef struct { double position, velocity; } Motion;

static int refused;

static void expect(const char *what, escapement_run_status status, const escapement_run *run) {
    printf("%s: %s\n", what, status == ESCAPEMENT_RUN_OK ? "TAKEN" : escapement_run_error(run));
    refused += status != ESCAPEMENT_RUN_OK;
}

static void start(const char *what, const char *scenario, const escapement_run_options *options) {
    escapement_run *run = NULL;
    escapement_run_status status = escapement_run_start(scenario, options, &run);
    expect(what, status, run);
    expect("after that", escapement_run_step(run), run);
    escapement_run_free(run);
}

int main(int argc, char **argv) {
    const char *scenario = argc > 1 ? argv[1] : "";
    escapement_run *run = NULL, *other = NULL;
    start("no file", "nowhere.toml", NULL);
    start("no name", NULL, NULL);
    escapement_run_options options = {.size = 4};
    start("small options", scenario, &options);
    const char *changes[] = {"participants.mass.period=-1ms"};
    options = (escapement_run_options){.size = sizeof options, .changes = changes, .change_count = 1};
    start("bad change", scenario, &options);
    options = (escapement_run_options){.size = sizeof options, .record = ESCAPEMENT_RECORD_NOTHING};
    if (escapement_run_start(scenario, &options, &other) || escapement_run_start(scenario, NULL, &run)) return 1;

    Motion motion = {0.0, 0.0};
    escapement_run_sample sample = {.size = 8};
    double values[2];
    escapement_run_checkpoint *checkpoint = NULL, *none = NULL;
    expect("no run", escapement_run_step(NULL), NULL);
    expect("unknown output", escapement_run_field(run, "mass.motto", "position", values, 1), run);
    expect("unknown field", escapement_run_field(run, "mass.motion", "place", values, 1), run);
    expect("wrong count", escapement_run_field(run, "mass.motion", "position", values, 2), run);
    expect("no place", escapement_run_field(run, "mass.motion", "position", NULL, 1), run);
    const char *log = escapement_run_log(run, "mess");
    expect("unknown log", log ? ESCAPEMENT_RUN_OK : ESCAPEMENT_RUN_FAILED, run);
    expect("small sample", escapement_run_newest(run, "mass.motion", &sample), run);
    expect("unknown input", escapement_run_set(run, "mass.neighbor", &motion, sizeof motion), run);
    expect("wrong size", escapement_run_set(run, "mass.neighbour", &motion, 8), run);
    motion.velocity = NAN;
    expect("not a number", escapement_run_set(run, "mass.neighbour", &motion, sizeof motion), run);
    expect("unknown figure", escapement_run_figure(run, "nearest", values), run);
    expect("no instant", escapement_run_to(run, NAN), run);
    if (escapement_run_to(run, 1.0) || escapement_run_save(run, &checkpoint)) return 1;
    expect("back", escapement_run_to(run, 0.5), run);
    expect("behind the end", escapement_run_to(run, 5.0), run);
    expect("no checkpoint", escapement_run_restore(run, NULL), run);
    expect("another one's checkpoint", escapement_run_restore(other, checkpoint), other);
    expect("nothing kept", escapement_run_save(other, &none), other);
    escapement_run_outcome outcome = {.size = 4};
    expect("small outcome", escapement_run_end(run, &outcome), run);
    outcome.size = sizeof outcome;
    if (escapement_run_end(run, &outcome) || outcome.complete || outcome.simulated != 1.0) return 1;
    expect("after the end", escapement_run_end(run, &outcome), run);
    escapement_run_checkpoint_free(checkpoint);
    escapement_run_free(run);
    escapement_run_free(other);
    escapement_run_free(NULL);
    const char *far[] = {"participants.mass.parameters.position=1e308 m"};
    options = (escapement_run_options){.size = sizeof options, .changes = far, .change_count = 1};
    if (escapement_run_start(scenario, &options, &run) || !escapement_run_to(run, 1.0)) return 1;
    expect("failed run", escapement_run_end(run, NULL), run);
    escapement_run_free(run);
    printf("%d refused\n", refused);
    return 0;
}
