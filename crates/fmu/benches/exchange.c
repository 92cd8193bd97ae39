/* An FMU of FMI 2.0 that costs nothing itself: 27 outputs, each the mean of its input and of its own number. Variables 0 to 26 are the
 * inputs, 27 to 53 the outputs. EXCHANGE_WORK in the environment makes each step work: so many roots, one after the other. Written against
 * the standard without its headers. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

enum { COUNT = 27 };
typedef struct { double value[2 * COUNT]; } Model;
static long work;

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const *all) { (void)c; (void)on; (void)n; (void)all; return 0; }
void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks, int visible, int logging) {
    (void)name; (void)type; (void)guid; (void)resources; (void)callbacks; (void)visible; (void)logging;
    const char *wanted = getenv("EXCHANGE_WORK");
    work = wanted ? atol(wanted) : 0;
    return calloc(1, sizeof(Model));
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int d, double e, double t, int s, double u) { (void)c; (void)d; (void)e; (void)t; (void)s; (void)u; return 0; }
int fmi2EnterInitializationMode(void *c) { (void)c; return 0; }
int fmi2ExitInitializationMode(void *c) { (void)c; return 0; }
int fmi2Terminate(void *c) { (void)c; return 0; }
int fmi2Reset(void *c) { memset(c, 0, sizeof(Model)); return 0; }
int fmi2GetReal(void *c, const unsigned *vr, size_t n, double *v) {
    for (size_t k = 0; k < n; k++) v[k] = ((Model *)c)->value[vr[k]];
    return 0;
}
int fmi2SetReal(void *c, const unsigned *vr, size_t n, const double *v) {
    for (size_t k = 0; k < n; k++) ((Model *)c)->value[vr[k]] = v[k];
    return 0;
}
int fmi2DoStep(void *c, double t, double h, int keep) {
    double *x = ((Model *)c)->value;
    (void)t; (void)h; (void)keep;
    volatile double root = 2;
    for (long k = 0; k < work; k++) root = sqrt(root + 1);
    for (int k = 0; k < COUNT; k++) x[COUNT + k] = 0.5 * (x[k] + k);
    return 0;
}
/* No variable of another type, but importers want the functions. */
#define NONE(what, type) \
    int fmi2Get##what(void *c, const unsigned *vr, size_t n, type *v) { (void)c; (void)vr; (void)v; return n ? 3 : 0; } \
    int fmi2Set##what(void *c, const unsigned *vr, size_t n, const type *v) { (void)c; (void)vr; (void)v; return n ? 3 : 0; }
NONE(Integer, int)
NONE(Boolean, int)
NONE(String, const char *)
int fmi2GetFMUstate(void *c, void **s) { *s = malloc(sizeof(Model)); memcpy(*s, c, sizeof(Model)); return 0; }
int fmi2SetFMUstate(void *c, void *s) { memcpy(c, s, sizeof(Model)); return 0; }
int fmi2FreeFMUstate(void *c, void **s) { (void)c; free(*s); *s = NULL; return 0; }
int fmi2SerializedFMUstateSize(void *c, void *s, size_t *n) { (void)c; (void)s; *n = sizeof(Model); return 0; }
int fmi2SerializeFMUstate(void *c, void *s, char *b, size_t n) { (void)c; memcpy(b, s, n); return 0; }
int fmi2DeSerializeFMUstate(void *c, const char *b, size_t n, void **s) { (void)c; *s = malloc(n); memcpy(*s, b, n); return 0; }
int fmi2GetDirectionalDerivative(void *c, const unsigned *u, size_t n, const unsigned *k, size_t m, const double *d, double *v) {
    (void)c; (void)u; (void)n; (void)k; (void)m; (void)d; (void)v; return 3;
}
int fmi2SetRealInputDerivatives(void *c, const unsigned *vr, size_t n, const int *o, const double *v) { (void)c; (void)vr; (void)n; (void)o; (void)v; return 3; }
int fmi2GetRealOutputDerivatives(void *c, const unsigned *vr, size_t n, const int *o, double *v) { (void)c; (void)vr; (void)n; (void)o; (void)v; return 3; }
int fmi2CancelStep(void *c) { (void)c; return 3; }
int fmi2GetStatus(void *c, int s, int *v) { (void)c; (void)s; (void)v; return 2; }
int fmi2GetRealStatus(void *c, int s, double *v) { (void)c; (void)s; (void)v; return 2; }
int fmi2GetIntegerStatus(void *c, int s, int *v) { (void)c; (void)s; (void)v; return 2; }
int fmi2GetBooleanStatus(void *c, int s, int *v) { (void)c; (void)s; (void)v; return 2; }
int fmi2GetStringStatus(void *c, int s, const char **v) { (void)c; (void)s; (void)v; return 2; }
