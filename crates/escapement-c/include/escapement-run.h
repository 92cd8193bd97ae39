/* Runs from C: a program loads a scenario, lets it run to an instant, reads what participants gave out, sets inputs that nobody feeds, goes
 * back, and ends it. The run is in this process, in one loop: its participants are builtins of Escapement, plug-ins and FMUs.
 *
 *     escapement_run *run;
 *     if (escapement_run_start("tank.toml", NULL, &run) != ESCAPEMENT_RUN_OK) puts(escapement_run_error(run));
 *     escapement_run_to(run, 2.0);
 *     escapement_run_free(run);
 *
 * Rules that hold everywhere:
 *   - A function that returns escapement_run_status returns ESCAPEMENT_RUN_OK, or ESCAPEMENT_RUN_FAILED with escapement_run_error saying why.
 *     A call that is refused changes nothing. When a participant fails the run is over; escapement_run_end then says how.
 *   - A run and a checkpoint are opaque, and the caller's: it frees both. Everything else that a function gives belongs to the run, and stays
 *     until the next call with it.
 *   - Structs begin with their size, which the caller sets, so that a later version may have more fields.
 *   - Texts are UTF-8 and end with a zero byte; they are copied before a call returns. Times are in s, sizes in bytes.
 *   - Several runs may be under way. One run is called by the thread that started it. No panic leaves a function.
 *   - A NULL in place of a run is a failure without a text.
 */
#ifndef ESCAPEMENT_RUN_H
#define ESCAPEMENT_RUN_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The version of everything in here. */
#define ESCAPEMENT_RUN_ABI 1u

typedef int32_t escapement_run_status;
#define ESCAPEMENT_RUN_OK 0
#define ESCAPEMENT_RUN_FAILED 1

/* What is kept of a run. */
#define ESCAPEMENT_RECORD_MEMORY 0u  /* every sample, in memory: the run can go back */
#define ESCAPEMENT_RECORD_NOTHING 1u /* figures alone: the memory does not grow */
#define ESCAPEMENT_RECORD_FOLDER 2u  /* a run folder with the tape: the run can go back */

typedef struct escapement_run escapement_run;
typedef struct escapement_run_checkpoint escapement_run_checkpoint;

typedef struct escapement_run_options {
    uint32_t size;            /* of this struct */
    uint32_t record;          /* ESCAPEMENT_RECORD_… */
    const char *folder;       /* of ESCAPEMENT_RECORD_FOLDER: a new folder; NULL is one below runs/ */
    const char *const *changes; /* "participants.plant.period=2ms", as --set takes them */
    uint32_t change_count;
    uint32_t reserved;        /* 0 */
} escapement_run_options;

/* A sample of an output. */
typedef struct escapement_run_sample {
    uint32_t size; /* of this struct */
    uint32_t reserved;
    uint64_t index; /* in the sequence of its port, from 0 */
    double stamp;
    const void *bytes; /* the message, as it was published; the run's, until the next call with it */
    uint64_t byte_count;
} escapement_run_sample;

/* How a run ended. */
typedef struct escapement_run_outcome {
    uint32_t size;      /* of this struct */
    uint32_t complete;  /* 1 when it came to the end of the scenario */
    uint32_t met;       /* 1 when all criteria of the scenario are met */
    uint32_t reserved;
    double simulated;   /* s */
    char digest[72];    /* of the tape; empty where there is none */
} escapement_run_outcome;

/* ESCAPEMENT_RUN_ABI of the library that is linked. */
uint32_t escapement_run_abi(void);

/* Starts the scenario in the file `scenario`: participants are there and rest at the start. `options` may be NULL: the samples are kept in
 * memory. *run is set also on failure, and then good for escapement_run_error and escapement_run_free alone. */
escapement_run_status escapement_run_start(const char *scenario, const escapement_run_options *options, escapement_run **run);

/* Why the last call with `run` that failed did: the key and line of the scenario, the value and the remedy. The run's. */
const char *escapement_run_error(const escapement_run *run);

/* Everybody has done exactly the activations before this instant. NaN where there is no run. */
double escapement_run_now(const escapement_run *run);

/* 1 when nothing more happens. */
uint32_t escapement_run_is_over(const escapement_run *run);

/* Lets the run on to `time`, which is taken for the simplest fraction that it is nearest to (0.1 is 1/10), and rests there. */
escapement_run_status escapement_run_to(escapement_run *run, double time);

/* Lets the run on to the next communication point. */
escapement_run_status escapement_run_step(escapement_run *run);

/* Lets the run on until `participant` is about to step: it has the inputs of its next activation, and everything that must come before that has been
 * done. *held is 1 then, and 0 when it has no activation any more: the run has come to its end. */
escapement_run_status escapement_run_before(escapement_run *run, const char *participant, uint32_t *held);

/* What "PARTICIPANT.INPUT" shows to the activation before which the participant is held, behind delays and faults. */
escapement_run_status escapement_run_shown(escapement_run *run, const char *port, escapement_run_sample *sample);

/* Gives "PARTICIPANT.OUTPUT" of that activation: the participant is not stepped then. Without an answer it steps as ever when the run goes on. */
escapement_run_status escapement_run_answer(escapement_run *run, const char *port, const void *bytes, uint64_t byte_count);

/* The newest sample of "PARTICIPANT.OUTPUT". */
escapement_run_status escapement_run_newest(escapement_run *run, const char *port, escapement_run_sample *sample);

/* `count` elements of a field of the newest sample of "PARTICIPANT.OUTPUT", row by row, in the field's unit. There must be as many. */
escapement_run_status escapement_run_field(escapement_run *run, const char *port, const char *field, double *values, uint32_t count);

/* Sets "PARTICIPANT.INPUT", which nobody feeds, to a message: activations at or after now see it until it is set again. */
escapement_run_status escapement_run_set(escapement_run *run, const char *port, const void *bytes, uint64_t byte_count);

/* What a participant has said by its log so far, the newest 64 KiB at least: lines with the simulated time. NULL where there is no run. */
const char *escapement_run_log(escapement_run *run, const char *participant);

/* A figure of merit or measure of what has happened so far; a failure where there is none yet. */
escapement_run_status escapement_run_figure(escapement_run *run, const char *name, double *value);

/* The state, which the caller frees. The run can go back to it as long as it has not gone back to before it. */
escapement_run_status escapement_run_save(escapement_run *run, escapement_run_checkpoint **checkpoint);
escapement_run_status escapement_run_restore(escapement_run *run, const escapement_run_checkpoint *checkpoint);
void escapement_run_checkpoint_free(escapement_run_checkpoint *checkpoint);

/* Ends the run where it is. `outcome` may be NULL. Afterwards `run` is good for escapement_run_error and escapement_run_free alone. */
escapement_run_status escapement_run_end(escapement_run *run, escapement_run_outcome *outcome);

/* Frees a run; one that was not ended is dropped. */
void escapement_run_free(escapement_run *run);

#ifdef __cplusplus
}
#endif
#endif
