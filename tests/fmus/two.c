/* An FMU of FMI 2.0 for co-simulation, written against the standard without its headers. */
#include "model.h"

typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct { Logger logger; void *allocate, *release, *finished, *environment; } Callbacks;
typedef struct { Model model; const Callbacks *callbacks; } Instance;

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const Callbacks *callbacks, int visible, int logging) {
    Instance *i = calloc(1, sizeof *i);
    (void)name; (void)visible; (void)logging;
    if (type != 1 || strcmp(guid, "{spring}") != 0 || strncmp(resources, "file:///", 8) != 0) {
        callbacks->logger(callbacks->environment, name, 3, "error", "wrong guid `%s` or resources", guid);
        free(i);
        return NULL;
    }
    start(&i->model);
    i->callbacks = callbacks;
    return i;
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int d, double e, double t, int s, double u) { (void)d; (void)e; (void)s; (void)u; ((Instance *)c)->model.t = t; return 0; }
int fmi2EnterInitializationMode(void *c) { (void)c; return 0; }
int fmi2ExitInitializationMode(void *c) { (void)c; return 0; }
int fmi2Terminate(void *c) { (void)c; return end(); }
int fmi2GetReal(void *c, const unsigned *vr, size_t n, double *v) { for (size_t k = 0; k < n; k++) v[k] = ((Instance *)c)->model.value[vr[k]]; return 0; }
int fmi2SetReal(void *c, const unsigned *vr, size_t n, const double *v) { for (size_t k = 0; k < n; k++) ((Instance *)c)->model.value[vr[k]] = v[k]; return 0; }
int fmi2GetInteger(void *c, const unsigned *vr, size_t n, int *v) { (void)c; (void)vr; (void)n; (void)v; return 3; }
int fmi2SetInteger(void *c, const unsigned *vr, size_t n, const int *v) { (void)c; (void)vr; (void)n; (void)v; return 3; }
int fmi2GetBoolean(void *c, const unsigned *vr, size_t n, int *v) { (void)c; (void)vr; (void)n; (void)v; return 3; }
int fmi2SetBoolean(void *c, const unsigned *vr, size_t n, const int *v) { (void)c; (void)vr; (void)n; (void)v; return 3; }
int fmi2SetString(void *c, const unsigned *vr, size_t n, const char *const *v) { (void)vr; (void)n; snprintf(((Instance *)c)->model.marker, 256, "%s", v[0]); return 0; }
int fmi2DoStep(void *c, double t, double h, int keep) {
    Instance *i = c;
    int status = step(&i->model, t, h);
    double value[2] = {0, 0};
    const unsigned reference = 1;
    (void)keep;
    if (FAULT == CALLS_ITSELF && fmi2GetReal(c, &reference, 1, value) != 0) status = 3;
    if (status) i->callbacks->logger(i->callbacks->environment, "spring", status, "error", "the spring broke at %g s", t);
    return status;
}
int fmi2GetRealStatus(void *c, int kind, double *v) { *v = ((Instance *)c)->model.t; return kind == 2 ? 0 : 3; }
int fmi2GetBooleanStatus(void *c, int kind, int *v) { (void)c; *v = 0; return kind == 3 ? 0 : 3; }
#ifdef STATE
int fmi2GetFMUstate(void *c, void **s) { *s = malloc(sizeof(Model)); memcpy(*s, &((Instance *)c)->model, sizeof(Model)); return 0; }
int fmi2SetFMUstate(void *c, void *s) { memcpy(&((Instance *)c)->model, s, sizeof(Model)); return 0; }
int fmi2FreeFMUstate(void *c, void **s) { (void)c; free(*s); *s = NULL; return 0; }
int fmi2SerializedFMUstateSize(void *c, void *s, size_t *n) { (void)c; (void)s; *n = FAULT == HUGE_STATE ? (size_t)1 << 40 : sizeof(Model); return 0; }
int fmi2SerializeFMUstate(void *c, void *s, char *b, size_t n) { (void)c; memcpy(b, s, n); return FAULT == UNSAVED ? 3 : 0; }
int fmi2DeSerializeFMUstate(void *c, const char *b, size_t n, void **s) { (void)c; if (n != sizeof(Model)) return 3; *s = malloc(n); memcpy(*s, b, n); return 0; }
#endif
