/* Runs from C: a program loads a scenario, advances the run to an instant, reads outputs of participants, sets unconnected inputs, restores
 * checkpoints, and ends the run. The run executes in this process, in one loop: its participants are builtins of Escapement, plug-ins and FMUs.
 *
 *     escapement_run *run;
 *     if (escapement_run_start("tank.toml", NULL, &run) != ESCAPEMENT_RUN_OK) puts(escapement_run_error(run));
 *     escapement_run_to(run, 2.0);
 *     escapement_run_free(run);
 *
 * Rules for all functions:
 *   - A function that returns escapement_run_status returns ESCAPEMENT_RUN_OK or ESCAPEMENT_RUN_FAILED. After a failure escapement_run_error
 *     returns the reason. A rejected call changes nothing. When a participant fails, the run is over; escapement_run_end reports how it ended.
 *   - Runs and checkpoints are opaque. The caller owns them and frees them. Everything else that a function returns is owned by the run, and is
 *     valid until the next call with that run.
 *   - Structs begin with their size, which the caller sets, so that a later version can add fields.
 *   - Strings are UTF-8 and NUL-terminated; they are copied before a call returns. Times are in s, sizes in bytes.
 *   - Several runs may exist at the same time. A run is called only by the thread that started it. No panic crosses the C boundary.
 *   - A call with NULL instead of a run fails; `escapement_run_error(NULL)` returns "there is no run (NULL)".
 */
#ifndef ESCAPEMENT_RUN_H
#define ESCAPEMENT_RUN_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The ABI version of this header. */
#define ESCAPEMENT_RUN_ABI 1u

typedef int32_t escapement_run_status;
#define ESCAPEMENT_RUN_OK 0
#define ESCAPEMENT_RUN_FAILED 1

/* What is recorded of a run. */
#define ESCAPEMENT_RECORD_MEMORY 0u  /* every sample, in memory: checkpoints can be restored */
#define ESCAPEMENT_RECORD_NOTHING 1u /* only the figures: memory use does not grow */
#define ESCAPEMENT_RECORD_FOLDER 2u  /* a run folder with the tape: checkpoints can be restored */

typedef struct escapement_run escapement_run;
typedef struct escapement_run_checkpoint escapement_run_checkpoint;

typedef struct escapement_run_options {
    uint32_t size;            /* of this struct */
    uint32_t record;          /* ESCAPEMENT_RECORD_… */
    const char *folder;       /* for ESCAPEMENT_RECORD_FOLDER: a new folder; NULL creates one below runs/ */
    const char *const *changes; /* "participants.plant.period=2ms", in the syntax of --set */
    uint32_t change_count;
    uint32_t reserved;        /* 0 */
} escapement_run_options;

/* A sample of an output. */
typedef struct escapement_run_sample {
    uint32_t size; /* of this struct */
    uint32_t reserved;
    uint64_t index; /* of the sample among those of its port, from 0 */
    double stamp;
    const void *bytes; /* the message as it was published; owned by the run, valid until the next call with it */
    uint64_t byte_count;
} escapement_run_sample;

/* How a run ended. */
typedef struct escapement_run_outcome {
    uint32_t size;      /* of this struct */
    uint32_t complete;  /* 1 when the run reached the end of the scenario */
    uint32_t met;       /* 1 when all criteria of the scenario are met */
    uint32_t reserved;
    double simulated;   /* s */
    char digest[72];    /* of the tape; empty if there is no tape */
} escapement_run_outcome;

/* Returns ESCAPEMENT_RUN_ABI of the linked library. */
uint32_t escapement_run_abi(void);

/* Starts the scenario in the file `scenario`: the participants are started, and the run is paused at its start. If `options` is NULL, samples are
 * recorded in memory. *run is also set on failure; it may then be passed only to escapement_run_error and escapement_run_free. */
escapement_run_status escapement_run_start(const char *scenario, const escapement_run_options *options, escapement_run **run);

/* Returns why the last failed call with `run` failed: the key and line of the scenario, the value and the remedy. Owned by the run. */
const char *escapement_run_error(const escapement_run *run);

/* The present time of the run: all participants have executed exactly their activations before this instant. NaN if there is no run. */
double escapement_run_now(const escapement_run *run);

/* Returns 1 when the run is over: no activation follows. */
uint32_t escapement_run_is_over(const escapement_run *run);

/* Advances the run to `time` and pauses it there. `time` is converted to the simplest fraction that rounds to it (0.1 is 1/10). */
escapement_run_status escapement_run_to(escapement_run *run, double time);

/* Advances the run to the next communication point. */
escapement_run_status escapement_run_step(escapement_run *run);

/* Advances the run until `participant` is about to step: the inputs of its next activation are available, and all activations that must precede
 * it have been executed. *reached is then 1. It is 0 when the participant has no further activation: the run has reached its end. */
escapement_run_status escapement_run_to_step(escapement_run *run, const char *participant, uint32_t *reached);

/* Reads the sample that "PARTICIPANT.INPUT" has in the activation before which the participant is paused, with delays and faults applied. */
escapement_run_status escapement_run_read_input(escapement_run *run, const char *port, escapement_run_sample *sample);

/* Sets "PARTICIPANT.OUTPUT" for that activation; the participant is then not stepped. If no output is set, it steps as usual when the run
 * continues. */
escapement_run_status escapement_run_set_output(escapement_run *run, const char *port, const void *bytes, uint64_t byte_count);

/* Reads the newest sample of "PARTICIPANT.OUTPUT". */
escapement_run_status escapement_run_newest(escapement_run *run, const char *port, escapement_run_sample *sample);

/* Reads the elements of a field of the newest sample of "PARTICIPANT.OUTPUT", in row-major order, in the field's unit. `count` must be the
 * number of elements of the field. */
escapement_run_status escapement_run_field(escapement_run *run, const char *port, const char *field, double *values, uint32_t count);

/* Sets the unconnected input "PARTICIPANT.INPUT" to a message: activations from the present time on see it until it is set again. */
escapement_run_status escapement_run_set(escapement_run *run, const char *port, const void *bytes, uint64_t byte_count);

/* Returns the log of a participant so far, at least the newest 64 KiB of it: lines with the simulated time. NULL if there is no run, or no such
 * participant. */
const char *escapement_run_log(escapement_run *run, const char *participant);

/* Reads a figure of merit or a measure of the run so far; fails if it has no value yet. */
escapement_run_status escapement_run_figure(escapement_run *run, const char *name, double *value);

/* Saves the state as a checkpoint, which the caller frees. The run can be restored to it unless it has since been restored to an earlier instant. */
escapement_run_status escapement_run_save(escapement_run *run, escapement_run_checkpoint **checkpoint);
escapement_run_status escapement_run_restore(escapement_run *run, const escapement_run_checkpoint *checkpoint);
void escapement_run_checkpoint_free(escapement_run_checkpoint *checkpoint);

/* Ends the run at its present time. `outcome` may be NULL. Afterwards `run` may be passed only to escapement_run_error and escapement_run_free. */
escapement_run_status escapement_run_end(escapement_run *run, escapement_run_outcome *outcome);

/* Frees a run. A run that was not ended is discarded. */
void escapement_run_free(escapement_run *run);

#ifdef __cplusplus
}
#endif
#endif
