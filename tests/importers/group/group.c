/* An FMI 2.0 co-simulation FMU whose output follows its input at once: `y` (0) is a state that goes towards the
 * input `u` (1), and a quarter of the input on top. Also whether that is above 20. */
#include <stdlib.h>

typedef int Status;

typedef struct {
    double y, u;
} Instance;

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *resources,
                      const void *callbacks, int visible, int logging) {
    (void)name; (void)kind; (void)guid; (void)resources; (void)callbacks; (void)visible; (void)logging;
    Instance *i = calloc(1, sizeof(Instance));
    if (i) i->y = 1;
    return i;
}
void fmi2FreeInstance(void *c) { free(c); }

Status fmi2GetReal(void *c, const unsigned *references, size_t n, double *values) {
    const Instance *i = c;
    for (size_t k = 0; k < n; k++) values[k] = references[k] == 0 ? i->y + 0.25 * i->u : i->u;
    return 0;
}
Status fmi2SetReal(void *c, const unsigned *references, size_t n, const double *values) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++) *(references[k] == 0 ? &i->y : &i->u) = values[k];
    return 0;
}
Status fmi2GetBoolean(void *c, const unsigned *references, size_t n, int *values) {
    const Instance *i = c;
    (void)references;
    for (size_t k = 0; k < n; k++) values[k] = i->y + 0.25 * i->u > 20;
    return 0;
}
Status fmi2DoStep(void *c, double time, double step, int no_state_before) {
    Instance *i = c;
    (void)time; (void)no_state_before;
    i->y += step * (i->u - i->y);
    return 0;
}

#include "../unused.h"
