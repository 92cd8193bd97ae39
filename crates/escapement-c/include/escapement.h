/* A participant of a co-simulation in C. The library is needed for a program of its own; a plug-in needs this header only.
 *
 * A participant is a table of functions (escapement_participant). It becomes
 *   - a program:  ESCAPEMENT_MAIN(&table), linked with libescapement; a scenario names it as run = { exe = "./mine" }
 *   - a plug-in:  ESCAPEMENT_PLUGIN(&table) in a shared library; a scenario names it as run = { library = "./libmine.so" }
 * or both from one source: compiled with ESCAPEMENT_NO_MAIN it has no main.
 *
 * Rules that hold everywhere:
 *   - Texts are UTF-8 and end with a zero byte. Whoever gives a text or a struct keeps it; whoever takes it copies it before the call
 *     returns, unless it is said otherwise.
 *   - Values are in the units that messages and calls say, times in s, sizes in bytes.
 *   - A function that returns escapement_status returns ESCAPEMENT_OK, or anything else when it failed. It has said why then.
 *   - The calls of one participant come one after the other, not always from the same thread; those of different participants of one
 *     process may come at the same time. So what is kept belongs into the participant's state, not into globals.
 *   - No exception and no longjmp may leave a function of the table. (escapement.hpp sees to that for C++.)
 *   - A step takes no memory and opens no file: it is on the path that decides how fast everybody runs.
 */
#ifndef ESCAPEMENT_H
#define ESCAPEMENT_H

#include <stddef.h>
#include <stdint.h>

#ifndef __cplusplus
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* The version of everything in here. A table of another version is refused when it is loaded. */
#define ESCAPEMENT_ABI 1u

typedef int32_t escapement_status;
#define ESCAPEMENT_OK 0
#define ESCAPEMENT_FAILED 1

/* How outputs depend on inputs. */
#define ESCAPEMENT_SAMPLED 1u    /* computes at t from the inputs at t: controllers, estimators, sensors */
#define ESCAPEMENT_CONTINUOUS 2u /* holds the inputs over a period, and writes its outputs for the end of it: plants */

/* Element types of fields. */
#define ESCAPEMENT_F64 1u
#define ESCAPEMENT_F32 2u
#define ESCAPEMENT_I64 3u
#define ESCAPEMENT_I32 4u
#define ESCAPEMENT_U64 5u
#define ESCAPEMENT_U32 6u
#define ESCAPEMENT_U8 7u
#define ESCAPEMENT_I8 8u
#define ESCAPEMENT_I16 9u
#define ESCAPEMENT_U16 10u
#define ESCAPEMENT_BOOL 11u /* a byte: 0 or 1, as bool of C and C++ */
#define ESCAPEMENT_ENUM 12u /* a byte: one of named values, one of which is 0 */

#define ESCAPEMENT_TEXT 13u /* UTF-8 in an array of char, with zeros behind its end; the last extent is its room */
#define ESCAPEMENT_BYTES 14u /* their number (uint32_t), then room for them, zeros behind them; the last extent is the room */

#define ESCAPEMENT_RANK_MAX 4

/* A state_size: there is no state. */
#define ESCAPEMENT_STATELESS UINT64_MAX

/* A field of a message. */
typedef struct escapement_field {
    const char *name;
    const char *unit;                     /* such as "N m"; "1" for a pure number; of an ESCAPEMENT_ENUM its values: "closed = 0, open = 1" */
    const char *frame;                    /* of a vector's components; "" or NULL where that means nothing */
    uint32_t element;                     /* ESCAPEMENT_F64 … */
    uint32_t offset;                      /* in the struct */
    uint32_t rank;                        /* how many extents; 0 for a single number */
    uint32_t extents[ESCAPEMENT_RANK_MAX]; /* outermost first */
} escapement_field;

/* What a port carries: a plain struct without padding, field by field. */
typedef struct escapement_message {
    const char *name;
    const escapement_field *fields; /* in the order of their offsets, without gaps */
    uint32_t field_count;
    uint32_t size;                  /* of the struct */
} escapement_message;

/* The instant of an activation. */
typedef struct escapement_step {
    uint32_t size; /* of this struct */
    uint32_t reserved;
    uint64_t index; /* from 0 */
    double t;       /* s */
    double t_next;  /* s: a continuous participant writes its outputs for this instant */
    double period;  /* s: the period itself, not t_next - t */
} escapement_step;

/* What the program that runs a participant offers to it: from the call of `describe` to the end of `terminate`, at one address. The
 * functions below the fields are mostly called through the helpers at the end of this file. */
typedef struct escapement_host escapement_host;
struct escapement_host {
    uint32_t size;    /* of this struct */
    uint32_t abi;     /* ESCAPEMENT_ABI of the host */
    const char *name; /* of the participant in the scenario; the host's */
    uint64_t seed;    /* of the run */
    double period;    /* s */
    double offset;    /* s: the first activation */
    /* In `describe`: ESCAPEMENT_SAMPLED or ESCAPEMENT_CONTINUOUS. Must be called. */
    escapement_status (*kind)(const escapement_host *host, uint32_t kind);
    /* In `describe`: adds an input; with `required` 0 the scenario may leave it unconnected, and it holds zeros. */
    escapement_status (*input)(const escapement_host *host, const char *name, const escapement_message *message, uint32_t required);
    /* In `describe`: adds an output. */
    escapement_status (*output)(const escapement_host *host, const char *name, const escapement_message *message);
    /* In `describe`: the parameter `key` (dotted: "gains.kp"). One that is absent and not required, or refused, leaves the value as
     * it is. A refusal is kept by the host, so the status need not be looked at: the participant is refused when `describe` returns.
     * With a unit, the scenario says a text with any unit of the same dimension ("5 mm" for "m"); without one (NULL, "", "1") a plain
     * number. `count` 0 is one number; `count` n are n numbers in brackets. */
    escapement_status (*numbers)(const escapement_host *host, const char *key, const char *unit, uint32_t required, double *values,
                                 uint32_t count);
    escapement_status (*integer)(const escapement_host *host, const char *key, uint32_t required, int64_t *value);
    escapement_status (*flag)(const escapement_host *host, const char *key, uint32_t required, uint8_t *value);
    /* The text is the host's, and stays to the end of `terminate`. */
    escapement_status (*text)(const escapement_host *host, const char *key, uint32_t required, const char **value);
    /* All parameters as a TOML document, for a participant that reads them itself. The host's. A parameter that nobody has asked for
     * is refused as misspelt, unless this was called. */
    const char *(*parameters)(const escapement_host *host);
    /* In `describe`: refuses a parameter, with the reason and the remedy. Returns ESCAPEMENT_FAILED. */
    escapement_status (*refuse)(const escapement_host *host, const char *key, const char *reason);
    /* Says why the present call fails: quantity, value, remedy. Returns ESCAPEMENT_FAILED. */
    escapement_status (*fail)(const escapement_host *host, const char *reason);
    /* Writes a line into the participant's log, with the simulated time: in `initialise`, `step` and `terminate`. In C, escapement_log
     * formats it as printf does. */
    void (*log)(const escapement_host *host, const char *text);
    /* In `save`: the state. */
    escapement_status (*state)(const escapement_host *host, const void *bytes, uint64_t size);
    /* Draw number `index` of the random stream called `stream`, of the run's seed: uniform in [0, 1), or standard normal. The same on
     * every machine. No other random number may enter a participant. */
    double (*uniform)(const escapement_host *host, const char *stream, uint64_t index);
    double (*normal)(const escapement_host *host, const char *stream, uint64_t index);
    /* In `initialise` and `step`: whether output number `output` is seen, ESCAPEMENT_SEEN_NOW and ESCAPEMENT_SEEN_EVER. An older host does not
     * have it: call escapement_is_seen and escapement_is_ever_seen, which look at `size`. */
    uint32_t (*seen)(const escapement_host *host, uint32_t output);
    /* In `terminate`: why the participant's part in the run is over, ESCAPEMENT_FINISHED … An older host does not have it: call
     * escapement_termination, which looks at `size`. */
    uint32_t (*termination)(const escapement_host *host);
};

#define ESCAPEMENT_FINISHED 1u /* it has done all of its activations */
#define ESCAPEMENT_STOPPED 2u  /* the run ends before that: it was stopped, or something has failed, here or elsewhere */
#define ESCAPEMENT_REPLACED 3u /* another one takes its place, and the run goes on */

/* In `terminate`: why. 0 for a participant that has never begun, such as one that was only asked for its ports; ESCAPEMENT_STOPPED where the host
 * is too old to know. */
static inline uint32_t escapement_termination(const escapement_host *host) {
    return host->size < offsetof(escapement_host, termination) + sizeof host->termination ? ESCAPEMENT_STOPPED : host->termination(host);
}

#define ESCAPEMENT_SEEN_NOW 1u  /* the sample that is written is seen */
#define ESCAPEMENT_SEEN_EVER 2u /* a sample of it is seen in this run */

/* Whether the sample of output number `output` that `initialise` or `step` writes is seen: read by an input, kept on the tape, measured,
 * assessed, guarded. An unseen sample need not be computed. A sample that is seen must not depend on which were seen before. */
static inline int escapement_seen_(const escapement_host *host, uint32_t output, uint32_t how) {
    return host->size < offsetof(escapement_host, seen) + sizeof host->seen || (host->seen(host, output) & how) != 0;
}
static inline int escapement_is_seen(const escapement_host *host, uint32_t output) {
    return escapement_seen_(host, output, ESCAPEMENT_SEEN_NOW);
}
/* Whether any sample of it is seen in this run. */
static inline int escapement_is_ever_seen(const escapement_host *host, uint32_t output) {
    return escapement_seen_(host, output, ESCAPEMENT_SEEN_EVER);
}

/* A participant. Begin it with ESCAPEMENT_TABLE, and name the others: .step = step. What is not named is NULL. */
typedef struct escapement_participant {
    uint32_t size;       /* sizeof(escapement_participant) */
    uint32_t abi;        /* ESCAPEMENT_ABI */
    const char *name;    /* of the participant; a library with several tells them apart by it */
    const char *version;
    /* So many bytes are given as `own`: zeros, aligned to 16, freed by the host. With 0, `describe` makes `own` and `terminate` frees it. */
    uint64_t own_size;
    /* So many of them, from the first on, are the whole state: saved and restored as they are, so without pointers. Parameters stand
     * behind the state, not in it: a run that is resumed with others shall have the others. ESCAPEMENT_STATELESS when there is
     * nothing to save. With 0, unless there is a `save`, the participant cannot be saved. */
    uint64_t state_size;
    /* Required. Makes the participant: says its kind and ports, reads its parameters. When it fails it frees what it has made. */
    escapement_status (*describe)(const escapement_host *host, void **own);
    /* Once, before the first step. A continuous participant writes its outputs at `t` (s). */
    escapement_status (*initialise)(const escapement_host *host, void *own, double t, void *const *outputs);
    /* Required. One activation. Inputs and outputs stand in the order in which `describe` added them, each a struct of its message, the
     * host's, and there during the call. What is not written keeps its last value. */
    escapement_status (*step)(const escapement_host *host, void *own, const escapement_step *step, const void *const *inputs,
                              void *const *outputs);
    /* Gives the whole state with host->state: `restore` must continue from it to the last bit, maybe in another process. Both or none;
     * without them and with a state_size of 0 the participant cannot be saved. */
    escapement_status (*save)(const escapement_host *host, void *own);
    /* The bytes may come from a file: check them. */
    escapement_status (*restore)(const escapement_host *host, void *own, const void *bytes, uint64_t size);
    /* Once, when the participant's part is over: escapement_termination says why. Frees what `describe` has made, so it is called for every
     * participant that `describe` has made. Not called where the process is killed. */
    void (*terminate)(const escapement_host *host, void *own);
} escapement_participant;

/* The main of a participant's program: takes its place in the run that the environment names, stays until it is done or told to leave,
 * and returns the exit code. The table stays the caller's, and must be there to the end. */
int escapement_participant_main(int argc, char **argv, const escapement_participant *table);

#ifdef ESCAPEMENT_NO_MAIN
#define ESCAPEMENT_MAIN(table) typedef int escapement_no_main
#else
#define ESCAPEMENT_MAIN(table)                                                                                                 \
    int main(int argc, char **argv) { return escapement_participant_main(argc, argv, table); }                                 \
    typedef int escapement_has_main
#endif

/* ESCAPEMENT_ABI of the library that is linked. */
uint32_t escapement_abi(void);

/* The one function of a plug-in: its participant number `index` from 0, NULL behind the last. ESCAPEMENT_PLUGIN writes it. */
#if defined(__GNUC__)
__attribute__((visibility("default")))
#endif
const escapement_participant *escapement_plugin(uint32_t index);

#ifdef __cplusplus
}
#else /* What follows is for C; escapement.hpp has its own. */

/* The first fields of a table. */
#define ESCAPEMENT_TABLE .size = sizeof(escapement_participant), .abi = ESCAPEMENT_ABI

/* Makes a plug-in of the participants whose tables are given: ESCAPEMENT_PLUGIN(&first, &second) */
#define ESCAPEMENT_PLUGIN(...)                                                                                                 \
    const escapement_participant *escapement_plugin(uint32_t index) {                                                          \
        static const escapement_participant *const all[] = {__VA_ARGS__};                                                      \
        return index < sizeof all / sizeof all[0] ? all[index] : NULL;                                                         \
    }                                                                                                                          \
    typedef int escapement_is_plugin

/* The message of a struct, from which it takes the name. The type of each field is looked at by the compiler.
 *
 *     typedef struct { double position, velocity; } Motion;
 *     ESCAPEMENT_MESSAGE(Motion, ESCAPEMENT_FIELD(Motion, position, "m", "N"), ESCAPEMENT_FIELD(Motion, velocity, "m/s", "N"));
 */
#define ESCAPEMENT_MESSAGE(type, ...)                                                                                          \
    static const escapement_field type##_fields[] = {__VA_ARGS__};                                                             \
    static const escapement_message type##_message = {#type, type##_fields, sizeof type##_fields / sizeof type##_fields[0],    \
                                                      sizeof(type)}

/* A field: a number, or a list of numbers. */
#define ESCAPEMENT_FIELD(type, field, unit, frame)                                                                             \
    {#field, unit, frame, ESCAPEMENT_ELEMENT_(((type *)0)->field), offsetof(type, field),                                      \
     ESCAPEMENT_RANK_(((type *)0)->field),                                                                                     \
     {ESCAPEMENT_RANK_(((type *)0)->field)                                                                                     \
          ? (uint32_t)(sizeof(((type *)0)->field) / ESCAPEMENT_SIZE_(((type *)0)->field))                                      \
          : 0u}}

/* An enumeration: a field of one byte, or a list of them, with the names of its values, one of which is 0.
 *
 *     enum { CLOSED, OPEN };
 *     typedef struct { uint8_t valve; } Tank;
 *     ESCAPEMENT_MESSAGE(Tank, ESCAPEMENT_ENUM_FIELD(Tank, valve, "closed = 0, open = 1"));
 */
#define ESCAPEMENT_ENUM_FIELD(type, field, values)                                                                             \
    {#field, values, "", _Generic(((type *)0)->field, unsigned char: ESCAPEMENT_ENUM, unsigned char *: ESCAPEMENT_ENUM),         \
     offsetof(type, field), ESCAPEMENT_RANK_(((type *)0)->field),                                                              \
     {ESCAPEMENT_RANK_(((type *)0)->field) ? (uint32_t)sizeof(((type *)0)->field) : 0u}}

/* A text, and bytes of varying number:
 *
 *     typedef struct { char phase[16]; struct { uint32_t length; uint8_t data[64]; } frame; } Report;
 *     ESCAPEMENT_MESSAGE(Report, ESCAPEMENT_TEXT_FIELD(Report, phase), ESCAPEMENT_BYTES_FIELD(Report, frame));
 */
#define ESCAPEMENT_TEXT_FIELD(type, field)                                                                                     \
    {#field, "1", "", _Generic(((type *)0)->field, char *: ESCAPEMENT_TEXT), offsetof(type, field), 1u,                          \
     {(uint32_t)sizeof(((type *)0)->field)}}
#define ESCAPEMENT_BYTES_FIELD(type, field)                                                                                    \
    {#field, "1", "", ESCAPEMENT_BYTES, offsetof(type, field), 1u, {(uint32_t)(sizeof(((type *)0)->field) - 4u)}}

/* A field that is a matrix: double field[rows][columns]. */
#define ESCAPEMENT_MATRIX(type, field, unit, frame)                                                                            \
    {#field, unit, frame, ESCAPEMENT_ELEMENT_(((type *)0)->field[0]), offsetof(type, field), 2u,                               \
     {(uint32_t)(sizeof(((type *)0)->field) / sizeof(((type *)0)->field[0])),                                                  \
      (uint32_t)(sizeof(((type *)0)->field[0]) / ESCAPEMENT_SIZE_(((type *)0)->field[0]))}}

#define ESCAPEMENT_ELEMENT_(value)                                                                                             \
    _Generic((value), double: ESCAPEMENT_F64, double *: ESCAPEMENT_F64, float: ESCAPEMENT_F32, float *: ESCAPEMENT_F32,        \
        long: ESCAPEMENT_I64, long *: ESCAPEMENT_I64, long long: ESCAPEMENT_I64, long long *: ESCAPEMENT_I64,                  \
        int: ESCAPEMENT_I32, int *: ESCAPEMENT_I32, unsigned long: ESCAPEMENT_U64, unsigned long *: ESCAPEMENT_U64,            \
        unsigned long long: ESCAPEMENT_U64, unsigned long long *: ESCAPEMENT_U64, unsigned: ESCAPEMENT_U32,                    \
        unsigned *: ESCAPEMENT_U32, unsigned char: ESCAPEMENT_U8, unsigned char *: ESCAPEMENT_U8, signed char: ESCAPEMENT_I8,  \
        signed char *: ESCAPEMENT_I8, short: ESCAPEMENT_I16, short *: ESCAPEMENT_I16, unsigned short: ESCAPEMENT_U16,           \
        unsigned short *: ESCAPEMENT_U16, _Bool: ESCAPEMENT_BOOL, _Bool *: ESCAPEMENT_BOOL)
#define ESCAPEMENT_RANK_(value)                                                                                                \
    _Generic((value), double: 0u, float: 0u, long: 0u, long long: 0u, int: 0u, unsigned long: 0u, unsigned long long: 0u,      \
        unsigned: 0u, unsigned char: 0u, signed char: 0u, short: 0u, unsigned short: 0u, _Bool: 0u, default: 1u)
#define ESCAPEMENT_SIZE_(value)                                                                                                \
    _Generic((value), double *: 8u, long *: 8u, long long *: 8u, unsigned long *: 8u, unsigned long long *: 8u, float *: 4u,   \
        int *: 4u, unsigned *: 4u, short *: 2u, unsigned short *: 2u, default: 1u)

/* Ports, in `describe`. */
#define ESCAPEMENT_INPUT(host, name, type) ((host)->input((host), (name), &type##_message, 1u))
#define ESCAPEMENT_OPTIONAL_INPUT(host, name, type) ((host)->input((host), (name), &type##_message, 0u))
#define ESCAPEMENT_OUTPUT(host, name, type) ((host)->output((host), (name), &type##_message))

/* Parameters, in `describe`: one that must be there, and one whose value stays as it is where the scenario says nothing. */
static inline escapement_status escapement_number(const escapement_host *host, const char *key, const char *unit, double *value) {
    return host->numbers(host, key, unit, 1u, value, 0u);
}
static inline escapement_status escapement_optional_number(const escapement_host *host, const char *key, const char *unit,
                                                           double *value) {
    return host->numbers(host, key, unit, 0u, value, 0u);
}
static inline escapement_status escapement_numbers(const escapement_host *host, const char *key, const char *unit, double *values,
                                                   uint32_t count) {
    return host->numbers(host, key, unit, 1u, values, count);
}

/* Puts a text into its room, with zeros behind it; 0 where it is too long, and nothing is done then. */
static inline int escapement_put_text(char *to, size_t room, const char *text) {
    size_t length = strlen(text);
    if (length > room) {
        return 0;
    }
    memset(to, 0, room);
    memcpy(to, text, length);
    return 1;
}

/* Fails with a message as printf writes it, up to 1000 bytes: return escapement_fail(host, "the angle is %g rad; …", angle); */
#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
static inline escapement_status
escapement_fail(const escapement_host *host, const char *format, ...) {
    char text[1001];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    return host->fail(host, text);
}

/* Writes a line into the log with the simulated time, formatted as printf does, up to 1000 bytes: escapement_log(host, "opens at %g m", level); */
#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
static inline void
escapement_log(const escapement_host *host, const char *format, ...) {
    char text[1001];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    host->log(host, text);
}

#endif
#endif
