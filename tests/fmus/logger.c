/* Steps an FMU of FMI 3.0 five times by 10 ms and prints the messages that its logger receives.
 *
 *     logger LIBRARY RESOURCES TOKEN [off | CATEGORY ...]
 */
#include <dlfcn.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

typedef void *Instance;

static void logger(void *environment, int status, const char *category, const char *message) {
    (void)environment;
    printf("%d %s: %s\n", status, category, message);
}

#define FUNCTION(result, name, ...) \
    result (*name)(__VA_ARGS__) = (result (*)(__VA_ARGS__))dlsym(library, "fmi3" #name); \
    if (!name) return printf("there is no %s\n", #name), 2

int main(int count, char **words) {
    if (count < 4) return 2;
    void *library = dlopen(words[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) return printf("%s\n", dlerror()), 2;
    FUNCTION(Instance, InstantiateCoSimulation, const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *, size_t,
             void *, void (*)(void *, int, const char *, const char *), void *);
    FUNCTION(int, SetDebugLogging, Instance, bool, size_t, const char *const *);
    FUNCTION(int, EnterInitializationMode, Instance, bool, double, double, bool, double);
    FUNCTION(int, ExitInitializationMode, Instance);
    FUNCTION(int, DoStep, Instance, double, double, bool, bool *, bool *, bool *, double *);
    FUNCTION(int, Terminate, Instance);
    FUNCTION(void, FreeInstance, Instance);

    Instance it = InstantiateCoSimulation("it", words[3], words[2], false, false, false, false, NULL, 0, NULL, logger, NULL);
    if (!it) return 1;
    if (count > 4) {
        bool off = strcmp(words[4], "off") == 0;
        if (SetDebugLogging(it, !off, off ? 0 : (size_t)count - 4, (const char *const *)words + 4)) return 3;
    }
    int wrong = EnterInitializationMode(it, false, 0, 0, false, 0) || ExitInitializationMode(it);
    for (int k = 0; k < 5 && !wrong; k++) {
        bool event, terminate, early;
        double last;
        wrong = DoStep(it, k * 0.01, 0.01, true, &event, &terminate, &early, &last);
    }
    wrong = wrong || Terminate(it);
    FreeInstance(it);
    return wrong;
}
