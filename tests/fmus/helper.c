/* A library that a test FMU or plug-in needs. */
int number(void);
int number(void) { return NUMBER; }
