/* The logger of FMI 2.0 is variadic, which stable Rust cannot define. It formats the text and hands it on. */
#include <stdarg.h>
#include <stdio.h>

extern void escapement_fmu_log(void *environment, int status, const char *category, const char *text);

void escapement_fmi2_logger(void *environment, const char *instance, int status, const char *category,
                            const char *message, ...) {
    char text[2048];
    va_list arguments;
    (void)instance;
    va_start(arguments, message);
    vsnprintf(text, sizeof text, message ? message : "", arguments);
    va_end(arguments);
    escapement_fmu_log(environment, status, category, text);
}
