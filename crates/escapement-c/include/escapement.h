/* A participant of a co-simulation in C. A participant that is a separate program links the library; a plug-in needs only this header.
 *
 * A participant is a table of functions (escapement_participant). It becomes
 *   - a program:  ESCAPEMENT_MAIN(&table), linked with libescapement; a scenario names it as run = { exe = "./mine" }
 *   - a plug-in:  ESCAPEMENT_PLUGIN(&table) in a shared library; a scenario names it as run = { library = "./libmine.so" }
 * One source can be both: compiled with ESCAPEMENT_NO_MAIN, it has no main.
 *
 * Rules for all functions:
 *   - Strings are UTF-8 and NUL-terminated. The side that passes a string or a struct keeps ownership; the receiver copies it before the
 *     call returns, unless stated otherwise.
 *   - Values are in the units stated by messages and calls, times in s, sizes in bytes.
 *   - A function that returns escapement_status returns ESCAPEMENT_OK, or any other value on failure. It has then reported the reason.
 *   - Calls to one participant are sequential, but not always from the same thread. Calls to different participants of one process may be
 *     concurrent. Keep data in the participant's state, not in globals.
 *   - No exception and no longjmp may leave a function of the table. (In C++, escapement.hpp ensures this.)
 *   - A step allocates no memory and opens no file: it is on the path that limits the speed of the whole run.
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

/* The ABI version of this header. A table of another version is rejected when it is loaded. */
#define ESCAPEMENT_ABI 1u

typedef int32_t escapement_status;
#define ESCAPEMENT_OK 0
#define ESCAPEMENT_FAILED 1

/* How outputs depend on inputs. */
#define ESCAPEMENT_SAMPLED 1u    /* computes its outputs at t from the inputs at t: controllers, estimators, sensors */
#define ESCAPEMENT_CONTINUOUS 2u /* holds the inputs over a period, and writes its outputs for the end of the period: plants */

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
#define ESCAPEMENT_BOOL 11u /* a byte: 0 or 1, as the bool of C and C++ */
#define ESCAPEMENT_ENUM 12u /* a byte: one of named values, one of which is 0 */

#define ESCAPEMENT_TEXT 13u /* UTF-8 in an array of char, padded with zeros; the last extent is the capacity */
#define ESCAPEMENT_BYTES 14u /* their number (uint32_t), then the bytes, padded with zeros; the last extent is the capacity */

#define ESCAPEMENT_RANK_MAX 4

/* The state_size of a participant without state. */
#define ESCAPEMENT_STATELESS UINT64_MAX

/* A field of a message. */
typedef struct escapement_field {
    const char *name;
    const char *unit;                     /* such as "N m"; "1" if dimensionless; for an ESCAPEMENT_ENUM its values: "closed = 0, open = 1" */
    const char *frame;                    /* the reference frame of a vector's components; "" or NULL if not applicable */
    uint32_t element;                     /* ESCAPEMENT_F64 … */
    uint32_t offset;                      /* in the struct */
    uint32_t rank;                        /* the number of extents; 0 for a scalar */
    uint32_t extents[ESCAPEMENT_RANK_MAX]; /* outermost first */
} escapement_field;

/* The message type of a port: a plain struct without padding, described field by field. */
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

/* The services of the program that runs a participant (the host). The struct is valid, at a fixed address, from the call of `describe` to the
 * end of `terminate`. Most of its functions are called through the helpers at the end of this file. */
typedef struct escapement_host escapement_host;
struct escapement_host {
    uint32_t size;    /* of this struct */
    uint32_t abi;     /* ESCAPEMENT_ABI of the host */
    const char *name; /* of the participant in the scenario; owned by the host */
    uint64_t seed;    /* of the run */
    double period;    /* s */
    double offset;    /* s: the first activation */
    /* In `describe`: sets the kind, ESCAPEMENT_SAMPLED or ESCAPEMENT_CONTINUOUS. Must be called. */
    escapement_status (*kind)(const escapement_host *host, uint32_t kind);
    /* In `describe`: adds an input. If `required` is 0, the scenario may leave it unconnected, and it then holds zeros. */
    escapement_status (*input)(const escapement_host *host, const char *name, const escapement_message *message, uint32_t required);
    /* In `describe`: adds an output. */
    escapement_status (*output)(const escapement_host *host, const char *name, const escapement_message *message);
    /* In `describe`: reads the parameter `key` (dotted: "gains.kp"). A parameter that is rejected, or absent and not required, leaves the
     * value unchanged. The host remembers a rejection, so the status need not be checked: the participant is rejected when `describe` returns.
     * With a unit, the scenario has a string with any unit of the same dimension ("5 mm" for "m"); without one (NULL, "", "1"), a plain
     * number. `count` 0 reads one number; `count` n reads n numbers in brackets. */
    escapement_status (*numbers)(const escapement_host *host, const char *key, const char *unit, uint32_t required, double *values,
                                 uint32_t count);
    escapement_status (*integer)(const escapement_host *host, const char *key, uint32_t required, int64_t *value);
    escapement_status (*flag)(const escapement_host *host, const char *key, uint32_t required, uint8_t *value);
    /* The string is owned by the host, and valid to the end of `terminate`. */
    escapement_status (*text)(const escapement_host *host, const char *key, uint32_t required, const char **value);
    /* Returns all parameters as a TOML document, for a participant that parses them itself. Owned by the host. A parameter that the
     * participant has not read is rejected as misspelt, unless this function was called. */
    const char *(*parameters)(const escapement_host *host);
    /* In `describe`: rejects a parameter, with the reason and the remedy. Returns ESCAPEMENT_FAILED. */
    escapement_status (*refuse)(const escapement_host *host, const char *key, const char *reason);
    /* Reports why the current call fails: quantity, value, remedy. Returns ESCAPEMENT_FAILED. Here, in `refuse` and in `log`, U+FFFD takes the
     * place of bytes of the text that are not UTF-8. */
    escapement_status (*fail)(const escapement_host *host, const char *reason);
    /* In `initialise`, `step` and `terminate`: writes a line with the simulated time to the participant's log. In C, escapement_log formats
     * the line as printf does. */
    void (*log)(const escapement_host *host, const char *text);
    /* In `save`: passes the state to the host, at most 63 MiB. */
    escapement_status (*state)(const escapement_host *host, const void *bytes, uint64_t size);
    /* Sample number `index` of the random stream `stream`, derived from the run's seed: uniform in [0, 1), or standard normal. The same on
     * every machine. A participant may use no other random numbers. */
    double (*uniform)(const escapement_host *host, const char *stream, uint64_t index);
    double (*normal)(const escapement_host *host, const char *stream, uint64_t index);
    /* In `initialise` and `step`: whether output number `output` is seen, as the flags ESCAPEMENT_SEEN_NOW and ESCAPEMENT_SEEN_EVER. Older hosts
     * lack this function: call escapement_is_seen and escapement_is_ever_seen, which check `size`. */
    uint32_t (*seen)(const escapement_host *host, uint32_t output);
    /* In `terminate`: why the participant ends, ESCAPEMENT_FINISHED … Older hosts lack this function: call escapement_termination, which
     * checks `size`. */
    uint32_t (*termination)(const escapement_host *host);
};

#define ESCAPEMENT_FINISHED 1u /* the participant has executed all of its activations */
#define ESCAPEMENT_STOPPED 2u  /* the run ends earlier: it was stopped, or this participant or another part of the run has failed */
#define ESCAPEMENT_REPLACED 3u /* another participant replaces this one, and the run continues */

/* In `terminate`: the reason for it. 0 for a participant that was never started, for example one loaded only to query its ports; ESCAPEMENT_STOPPED
 * if the host is too old to report a reason. */
static inline uint32_t escapement_termination(const escapement_host *host) {
    return host->size < offsetof(escapement_host, termination) + sizeof host->termination ? ESCAPEMENT_STOPPED : host->termination(host);
}

#define ESCAPEMENT_SEEN_NOW 1u  /* the sample now being written is seen */
#define ESCAPEMENT_SEEN_EVER 2u /* some sample of the output is seen in this run */

/* Whether the sample of output number `output` that `initialise` or `step` writes is seen: read by an input, recorded on the tape, measured,
 * assessed or guarded. An unseen sample need not be computed. A seen sample must not depend on which earlier samples were seen. */
static inline int escapement_seen_(const escapement_host *host, uint32_t output, uint32_t how) {
    return host->size < offsetof(escapement_host, seen) + sizeof host->seen || (host->seen(host, output) & how) != 0;
}
static inline int escapement_is_seen(const escapement_host *host, uint32_t output) {
    return escapement_seen_(host, output, ESCAPEMENT_SEEN_NOW);
}
/* Whether any sample of the output is seen in this run. */
static inline int escapement_is_ever_seen(const escapement_host *host, uint32_t output) {
    return escapement_seen_(host, output, ESCAPEMENT_SEEN_EVER);
}

/* A participant's function table. Begin it with ESCAPEMENT_TABLE and use designated initialisers: .step = step. Members left out are NULL. */
typedef struct escapement_participant {
    uint32_t size;       /* sizeof(escapement_participant) */
    uint32_t abi;        /* ESCAPEMENT_ABI */
    const char *name;    /* of the participant; identifies it in a library that has several */
    const char *version;
    /* Size of the memory that the host passes as `own`: zeroed, aligned to 16, freed by the host. If 0, `describe` allocates `own` and `terminate`
     * frees it. */
    uint64_t own_size;
    /* The first `state_size` bytes of `own` are the whole state. They are saved and restored as they are, so they hold no pointers. Place
     * parameters after the state, not in it: a run that is resumed with other parameters must use those. ESCAPEMENT_STATELESS if there is
     * no state. If 0, the participant cannot be saved unless it has `save`. */
    uint64_t state_size;
    /* Required. Creates the participant: declares its kind and ports, reads its parameters. On failure it frees what it has allocated. */
    escapement_status (*describe)(const escapement_host *host, void **own);
    /* Called once, before the first step. A continuous participant writes its outputs at `t` (s). */
    escapement_status (*initialise)(const escapement_host *host, void *own, double t, void *const *outputs);
    /* Required. One activation. Inputs and outputs are in the order in which `describe` added them. Each is a struct of its message type, owned
     * by the host and valid during the call. Inputs are const: a step that writes to one fails. An output that is not written keeps its last
     * value. */
    escapement_status (*step)(const escapement_host *host, void *own, const escapement_step *step, const void *const *inputs,
                              void *const *outputs);
    /* Passes the whole state to host->state. After `restore`, possibly in another process, the participant must continue bit-identically. Define
     * both or neither; without them and with a state_size of 0 the participant cannot be saved. */
    escapement_status (*save)(const escapement_host *host, void *own);
    /* The bytes may come from a file: check them. */
    escapement_status (*restore)(const escapement_host *host, void *own, const void *bytes, uint64_t size);
    /* Called once, when the participant ends; escapement_termination returns why. Frees what `describe` has allocated, so it is called for every
     * participant that `describe` has created. Not called if the process is killed. */
    void (*terminate)(const escapement_host *host, void *own);
} escapement_participant;

/* The main function of a participant's program: joins the run named by the environment, executes the participant until it has finished or the run
 * terminates it, and returns the exit code. The caller keeps ownership of the table, which must remain valid to the end. */
int escapement_participant_main(int argc, char **argv, const escapement_participant *table);

#ifdef ESCAPEMENT_NO_MAIN
#define ESCAPEMENT_MAIN(table) typedef int escapement_no_main
#else
#define ESCAPEMENT_MAIN(table)                                                                                                 \
    int main(int argc, char **argv) { return escapement_participant_main(argc, argv, table); }                                 \
    typedef int escapement_has_main
#endif

/* Returns ESCAPEMENT_ABI of the linked library. */
uint32_t escapement_abi(void);

/* The only function that a plug-in exports: returns the table of participant number `index`, from 0, and NULL after the last one. ESCAPEMENT_PLUGIN
 * defines it. */
#if defined(__GNUC__)
__attribute__((visibility("default")))
#endif
const escapement_participant *escapement_plugin(uint32_t index);

#ifdef __cplusplus
}
#else /* The rest is for C only; escapement.hpp has its C++ counterparts. */

/* The first fields of a table. */
#define ESCAPEMENT_TABLE .size = sizeof(escapement_participant), .abi = ESCAPEMENT_ABI

/* Makes a plug-in of the participants whose tables are given: ESCAPEMENT_PLUGIN(&first, &second) */
#define ESCAPEMENT_PLUGIN(...)                                                                                                 \
    const escapement_participant *escapement_plugin(uint32_t index) {                                                          \
        static const escapement_participant *const all[] = {__VA_ARGS__};                                                      \
        return index < sizeof all / sizeof all[0] ? all[index] : NULL;                                                         \
    }                                                                                                                          \
    typedef int escapement_is_plugin

/* The message type of a struct, whose name it takes. The compiler checks the type of each field.
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

/* A text, and a variable number of bytes:
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

/* Parameters, in `describe`: a required one, and an optional one, whose value stays unchanged if the scenario does not set it. */
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

/* Copies a text into an array of `room` bytes and pads it with zeros. Returns 0, and changes nothing, if the text is too long. */
static inline int escapement_put_text(char *to, size_t room, const char *text) {
    size_t length = strlen(text);
    if (length > room) {
        return 0;
    }
    memset(to, 0, room);
    memcpy(to, text, length);
    return 1;
}

/* Formats a text into 1001 bytes. One that is longer is cut in front of the character that does not fit: UTF-8 stays UTF-8. */
#if defined(__GNUC__)
__attribute__((format(printf, 2, 0)))
#endif
static inline void
escapement_format_(char text[1001], const char *format, va_list arguments) {
    size_t start = 1000, bytes;
    unsigned char lead;
    text[0] = 0;
    if (vsnprintf(text, 1001, format, arguments) <= 1000) {
        return;
    }
    do {
        lead = (unsigned char)text[--start];
    } while ((lead & 0xc0u) == 0x80u && start > 996);
    bytes = lead >= 0xf0u ? 4 : lead >= 0xe0u ? 3 : lead >= 0xc0u ? 2 : 1;
    if (start + bytes > 1000) {
        text[start] = 0;
    }
}

/* Reports a failure with a message formatted as by printf, up to 1000 bytes: return escapement_fail(host, "the angle is %g rad; …", angle); */
#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
static inline escapement_status
escapement_fail(const escapement_host *host, const char *format, ...) {
    char text[1001];
    va_list arguments;
    va_start(arguments, format);
    escapement_format_(text, format, arguments);
    va_end(arguments);
    return host->fail(host, text);
}

/* Writes a line to the log with the simulated time, formatted as by printf, up to 1000 bytes: escapement_log(host, "opens at %g m", level); */
#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
static inline void
escapement_log(const escapement_host *host, const char *format, ...) {
    char text[1001];
    va_list arguments;
    va_start(arguments, format);
    escapement_format_(text, format, arguments);
    va_end(arguments);
    host->log(host, text);
}

#endif
#endif
