/* The logger of FMI 2.0 takes any number of arguments, which Rust cannot: the text is put together
 * here. The environment comes back from the FMU and is handed on without being looked into. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

void shakebench_print_by_the_line(void) {
    setvbuf(stdout, NULL, _IOLBF, BUFSIZ);
}

void shakebench_log(void *environment, int status, const char *category, const char *text);

void shakebench_fmi2_logger(void *environment, const char *instance, int status,
                            const char *category, const char *message, ...) {
    char buffer[1024], *text = buffer;
    va_list arguments;
    int length;

    (void)instance;
    if (!message) {
        shakebench_log(environment, status, category, NULL);
        return;
    }
    va_start(arguments, message);
    length = vsnprintf(buffer, sizeof buffer, message, arguments);
    va_end(arguments);
    if (length < 0) {
        shakebench_log(environment, status, category, message);
        return;
    }
    if ((size_t)length >= sizeof buffer) {
        text = malloc((size_t)length + 1);
        if (text) {
            va_start(arguments, message);
            vsnprintf(text, (size_t)length + 1, message, arguments);
            va_end(arguments);
        } else {
            text = buffer;
        }
    }
    shakebench_log(environment, status, category, text);
    if (text != buffer) free(text);
}
