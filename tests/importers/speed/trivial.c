/* An FMI 2.0 co-simulation FMU that does next to nothing: `y` (0) goes towards the input `u` (1), both
 * Real, from the start value of `y`. What is left of the time of a run is that of the master. */
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
    return calloc(1, sizeof(Instance));
}
void fmi2FreeInstance(void *c) { free(c); }

Status fmi2GetReal(void *c, const unsigned *references, size_t n, double *values) {
    const Instance *i = c;
    for (size_t k = 0; k < n; k++) values[k] = references[k] == 0 ? i->y : i->u;
    return 0;
}
Status fmi2SetReal(void *c, const unsigned *references, size_t n, const double *values) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++) *(references[k] == 0 ? &i->y : &i->u) = values[k];
    return 0;
}
Status fmi2DoStep(void *c, double time, double step, int no_state_before) {
    Instance *i = c;
    (void)time; (void)no_state_before;
    i->y += step * (i->u - i->y);
    return 0;
}

#include "../unused.h"
MISSING(fmi2GetBoolean)
