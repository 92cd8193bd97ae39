/* An FMU of FMI 3.0 for co-simulation, written against the standard without its headers. With SIZE it has one array of that size. */
#include "model.h"
#include <stdbool.h>
#include <stdint.h>

typedef void (*Logger)(void *, int, const char *, const char *);
typedef struct { Model model; Logger logger; void *environment; } Instance;

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging, bool events, bool early,
                                  const unsigned *required, size_t n, void *environment, Logger logger, void *update) {
    size_t length = strlen(resources);
    Instance *i;
    (void)name; (void)visible; (void)logging; (void)required; (void)n; (void)update;
    if (events || early || strcmp(token, "{spring}") != 0 || resources[0] != '/' || resources[length - 1] != '/') {
        logger(environment, 3, "error", "wrong token or resources");
        return NULL;
    }
    i = calloc(1, sizeof *i);
    start(&i->model);
    i->logger = logger;
    i->environment = environment;
    return i;
}
void fmi3FreeInstance(void *c) { free(c); }
int fmi3EnterInitializationMode(void *c, bool d, double e, double t, bool s, double u) { (void)d; (void)e; (void)s; (void)u; ((Instance *)c)->model.t = t; return 0; }
int fmi3ExitInitializationMode(void *c) { (void)c; return 0; }
int fmi3EnterConfigurationMode(void *c) { (void)c; return 0; }
int fmi3ExitConfigurationMode(void *c) { (void)c; return 0; }
int fmi3Terminate(void *c) { (void)c; return end(); }
int fmi3GetFloat64(void *c, const unsigned *vr, size_t n, double *v, size_t m) {
    Instance *i = c;
#ifdef SIZE
    if (m != SIZE) { i->logger(i->environment, 3, "error", "the array has another size"); return 3; }
    for (size_t k = 0; k < m; k++) v[k] = i->model.value[1] + k;
    (void)vr; (void)n;
#else
    if (m != n) return 3;
    for (size_t k = 0; k < n; k++) v[k] = i->model.value[vr[k]];
#endif
    return 0;
}
int fmi3SetFloat64(void *c, const unsigned *vr, size_t n, const double *v, size_t m) {
    (void)m;
    for (size_t k = 0; k < n; k++) ((Instance *)c)->model.value[vr[k]] = v[k];
    return 0;
}
#define NOT_THERE(TYPE, NAME) \
    int fmi3Get##NAME(void *c, const unsigned *vr, size_t n, TYPE *v, size_t m) { (void)c; (void)vr; (void)n; (void)v; (void)m; return 3; } \
    int fmi3Set##NAME(void *c, const unsigned *vr, size_t n, const TYPE *v, size_t m) { (void)c; (void)vr; (void)n; (void)v; (void)m; return 3; }
NOT_THERE(float, Float32)
NOT_THERE(int8_t, Int8)
NOT_THERE(uint8_t, UInt8)
NOT_THERE(int16_t, Int16)
NOT_THERE(uint16_t, UInt16)
NOT_THERE(int32_t, Int32)
NOT_THERE(uint32_t, UInt32)
NOT_THERE(int64_t, Int64)
NOT_THERE(uint64_t, UInt64)
NOT_THERE(bool, Boolean)
int fmi3SetString(void *c, const unsigned *vr, size_t n, const char *const *v, size_t m) { (void)vr; (void)n; (void)m; snprintf(((Instance *)c)->model.marker, 256, "%s", v[0]); return 0; }
int fmi3SetBinary(void *c, const unsigned *vr, size_t n, const size_t *s, const uint8_t *const *v, size_t m) { (void)c; (void)vr; (void)n; (void)s; (void)v; (void)m; return 3; }
int fmi3DoStep(void *c, double t, double h, bool keep, bool *event, bool *terminate, bool *early, double *last) {
    Instance *i = c;
    int status = step(&i->model, t, h);
    double value[2] = {0, 0};
    const unsigned reference = 1;
    (void)keep;
    if (FAULT == CALLS_ITSELF && fmi3GetFloat64(c, &reference, 1, value, 1) != 0) status = 3;
    *event = *terminate = *early = false;
    *last = status == 2 ? t : t + h;
    if (FAULT == NO_INSTANT) *last = NAN;
    if (status) i->logger(i->environment, status, "error", "the spring broke");
    return status;
}
#ifdef STATE
int fmi3GetFMUState(void *c, void **s) { *s = malloc(sizeof(Model)); memcpy(*s, &((Instance *)c)->model, sizeof(Model)); return 0; }
int fmi3SetFMUState(void *c, void *s) { memcpy(&((Instance *)c)->model, s, sizeof(Model)); return 0; }
int fmi3FreeFMUState(void *c, void **s) { (void)c; free(*s); *s = NULL; return 0; }
int fmi3SerializedFMUStateSize(void *c, void *s, size_t *n) { (void)c; (void)s; *n = FAULT == HUGE_STATE ? (size_t)1 << 40 : sizeof(Model); return 0; }
int fmi3SerializeFMUState(void *c, void *s, uint8_t *b, size_t n) { (void)c; memcpy(b, s, n); return FAULT == UNSAVED ? 3 : 0; }
int fmi3DeserializeFMUState(void *c, const uint8_t *b, size_t n, void **s) { (void)c; if (n != sizeof(Model)) return 3; *s = malloc(n); memcpy(*s, b, n); return 0; }
#endif
