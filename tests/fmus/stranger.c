/* A library with functions of the standard in the global scope, as a program has that is linked with an exported simulation. */
int fmi2GetReal(void *c, const unsigned *vr, unsigned long n, double *v) { (void)c; (void)vr; (void)n; (void)v; return 3; }
int fmi3GetFloat64(void *c, const unsigned *vr, unsigned long n, double *v, unsigned long m) { (void)c; (void)vr; (void)n; (void)v; (void)m; return 3; }
