/* The same exchange as bare calls: bare LIBRARY-ONE LIBRARY-TWO STEPS. Prints the seconds that the steps took,
 * those of the processor, and a checksum. */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { COUNT = 27 };
typedef struct {
    void *instance;
    int (*get)(void *, const unsigned *, size_t, double *);
    int (*set)(void *, const unsigned *, size_t, const double *);
    int (*step)(void *, double, double, int);
} Model;

static Model load(const char *file) {
    void *library = dlopen(file, RTLD_NOW | RTLD_LOCAL);
    if (!library) { fprintf(stderr, "%s\n", dlerror()); exit(1); }
    void *(*make)(const char *, int, const char *, const char *, const void *, int, int) = dlsym(library, "fmi2Instantiate");
    Model m = { make("it", 1, "{exchange}", "file:///", NULL, 0, 0), dlsym(library, "fmi2GetReal"), dlsym(library, "fmi2SetReal"), dlsym(library, "fmi2DoStep") };
    return m;
}

int main(int count, char **arguments) {
    if (count != 4) return 2;
    Model one = load(arguments[1]), two = load(arguments[2]);
    long steps = atol(arguments[3]);
    unsigned in[COUNT], out[COUNT];
    double ours[COUNT], theirs[COUNT];
    for (unsigned k = 0; k < COUNT; k++) { in[k] = k; out[k] = COUNT + k; }
    struct timespec start, end;
    clock_gettime(CLOCK_MONOTONIC, &start);
    clock_t begin = clock();
    for (long k = 0; k < steps; k++) {
        if (one.get(one.instance, out, COUNT, ours) || two.get(two.instance, out, COUNT, theirs)) return 1;
        if (two.set(two.instance, in, COUNT, ours) || one.set(one.instance, in, COUNT, theirs)) return 1;
        if (one.step(one.instance, k * 1e-3, 1e-3, 1) || two.step(two.instance, k * 1e-3, 1e-3, 1)) return 1;
    }
    clock_gettime(CLOCK_MONOTONIC, &end);
    double used = (double)(clock() - begin) / CLOCKS_PER_SEC, sum = 0;
    one.get(one.instance, out, COUNT, ours);
    for (int k = 0; k < COUNT; k++) sum += ours[k];
    printf("%.9f %.9f %.17g\n", (end.tv_sec - start.tv_sec) + 1e-9 * (end.tv_nsec - start.tv_nsec), used, sum);
    return 0;
}
