/* The model of the test FMUs, for each version of the standard: a mass on a spring, or a damper (DAMPER). FAULT selects the
 * fault that occurs from t = 0.5 s on. */
#include <fenv.h>
#include <math.h>
#include <pthread.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* 0: input, 1 and 2: outputs, 3: stiffness or damping, 4: mass, 5: acceleration */
typedef struct {
    double value[6];
    double t;
    char marker[256];
} Model;

enum { NO_FAULT, SEGFAULT, LOOP, EXIT, NOT_A_NUMBER, ERROR, DISCARD, FATAL, LEAVES_FILE, NONDETERMINISTIC, CRASH_ONCE, WARN, UNSAVED, PRINT, THREAD, JOINED_THREAD, ROUNDS_UP, CALLS_ITSELF, HUGE_STATE, TERMINATE_ERROR, TERMINATE_ABORT, NO_INSTANT };

#ifndef FAULT
#define FAULT NO_FAULT
#endif

/* A thread of the FMU that executes its code again and again. */
static volatile int wanted = 1;
static void *work(void *m) {
    (void)m;
    while (wanted) usleep(1000);
    return NULL;
}

static void start(Model *m) {
    pthread_t thread;
    memset(m, 0, sizeof *m);
    if (FAULT == THREAD || FAULT == JOINED_THREAD) {
        pthread_create(&thread, NULL, work, m);
        if (FAULT == JOINED_THREAD) { wanted = 0; pthread_join(thread, NULL); }
    }
#ifdef DAMPER
    m->value[3] = 0.5;
#else
    m->value[1] = 0.1;
    m->value[3] = 40;
    m->value[4] = 1;
#endif
}

/* As an object that is compiled with -ffast-math: it sets floating-point modes when it is loaded. */
__attribute__((constructor)) static void load(void) {
    if (FAULT == ROUNDS_UP) fesetround(FE_UPWARD);
}

/* The status of the end of the simulation. */
static int end(void) {
    if (FAULT == TERMINATE_ABORT) abort();
    return FAULT == TERMINATE_ERROR ? 3 : 0;
}

/* The status of the step. */
static int step(Model *m, double t, double h) {
    double *x = m->value;
    m->t = t + h;
#ifdef DAMPER
    x[1] = -x[3] * x[0];
#else
    x[5] = (x[0] - x[3] * x[1]) / x[4];
    x[2] += h * x[5];
    x[1] += h * x[2];
#endif
    if (FAULT == ROUNDS_UP) fesetround(t < 0.5 ? FE_UPWARD : FE_DOWNWARD);
    if (t < 0.5) return 0;
    switch (FAULT) {
    case SEGFAULT: *(volatile int *)8 = 1; break;
    case LOOP: for (;;) { *(volatile double *)&m->t = t; } break;
    case EXIT: exit(7);
    case NOT_A_NUMBER: x[1] = sqrt(-1.0); break;
    case ERROR: return 3;
    case DISCARD: return 2;
    case FATAL: return 4;
    case WARN: return 1;
    case PRINT: printf("{ the spring prints\n"); break;
    case LEAVES_FILE: { FILE *f = fopen("leftover.txt", "w"); if (f) { fputs("leftover", f); fclose(f); } break; }
    case NONDETERMINISTIC: x[1] += 1e-9 * getpid(); break;
    case CRASH_ONCE:
        if (access(m->marker, F_OK) != 0) { FILE *f = fopen(m->marker, "w"); if (f) fclose(f); abort(); }
        break;
    }
    return 0;
}
