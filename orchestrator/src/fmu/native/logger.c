/* The logger of FMI 2.0 takes any number of arguments, which Rust cannot: the text is put together
 * here. The environment begins with the function that takes it. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

void shakebench_print_by_the_line(void) {
    setvbuf(stdout, NULL, _IOLBF, BUFSIZ);
}

struct environment {
    void (*log)(void *environment, int status, const char *category, const char *text);
};

void shakebench_fmi2_logger(void *environment, const char *instance, int status,
                            const char *category, const char *message, ...) {
    struct environment *to = environment;
    char buffer[1024], *text = buffer;
    va_list arguments;
    int length;

    (void)instance;
    if (!to) return;
    if (!message) {
        to->log(to, status, category, NULL);
        return;
    }
    va_start(arguments, message);
    length = vsnprintf(buffer, sizeof buffer, message, arguments);
    va_end(arguments);
    if (length < 0) {
        to->log(to, status, category, message);
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
    to->log(to, status, category, text);
    if (text != buffer) free(text);
}
