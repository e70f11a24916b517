/* An FMI 3.0 co-simulation FMU with event mode and input clocks of each kind. `periodic` (1) ticks every
 * 0.2 s, `later` (2) every 0.3 s from 0.1 s, `countdown` (3) 0.05 s after each tick of `periodic`, and
 * `changing` (4) 0.1, 0.2, 0.3 s... apart. Outputs 11 to 14 (Int32) count the ticks; 15 (Float64) is the
 * input 20 (Float64, of the clock `periodic`) in the last tick, 16 the time of that tick. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

typedef struct {
    int ticks[4], changed, countdown;
    bool active[4], event;
    double time, u, sampled, at;
} Instance;

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                  bool logging, bool events, bool early, const uint32_t *required, size_t n,
                                  void *environment, void *log, void *update) {
    (void)name; (void)token; (void)resources; (void)visible; (void)logging; (void)events; (void)early;
    (void)required; (void)n; (void)environment; (void)log; (void)update;
    Instance *i = calloc(1, sizeof(Instance));
    i->changed = 1;
    return i;
}
void fmi3FreeInstance(void *c) { free(c); }
int fmi3EnterInitializationMode(void *c, bool a, double b, double start, bool d, double e) {
    (void)a; (void)b; (void)d; (void)e;
    ((Instance *)c)->time = start;
    return 0;
}
int fmi3ExitInitializationMode(void *c) { ((Instance *)c)->event = true; return 0; }
int fmi3EnterEventMode(void *c) { ((Instance *)c)->event = true; return 0; }
int fmi3EnterStepMode(void *c) { ((Instance *)c)->event = false; return 0; }
int fmi3Terminate(void *c) { (void)c; return 0; }
int fmi3SetDebugLogging(void *c, bool on, size_t n, const char *const names[]) {
    (void)c; (void)on; (void)n; (void)names;
    return 0;
}

int fmi3SetClock(void *c, const uint32_t references[], size_t n, const bool values[]) {
    Instance *i = c;
    if (!i->event) return 3;
    for (size_t k = 0; k < n; k++) {
        if (references[k] < 1 || references[k] > 4) return 3;
        i->active[references[k] - 1] = values[k];
    }
    return 0;
}
int fmi3GetIntervalDecimal(void *c, const uint32_t references[], size_t n, double intervals[],
                           int qualifiers[]) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++) {
        int *fresh = references[k] == 3 ? &i->countdown : &i->changed;
        if (references[k] < 3) return 3;
        intervals[k] = references[k] == 3 ? 0.05 : 0.1 * (i->ticks[3] + 1);
        qualifiers[k] = *fresh ? 2 : 0;
        *fresh = 0;
    }
    return 0;
}
int fmi3UpdateDiscreteStates(void *c, bool *again, bool *end, bool *nominals, bool *states, bool *defined,
                             double *next) {
    Instance *i = c;
    if (!i->event) return 3;
    *again = *end = *nominals = *states = *defined = false;
    *next = 0;
    if (i->active[0]) {
        i->sampled = i->u;
        i->at = i->time;
        i->countdown = 1;
    }
    if (i->active[3]) i->changed = 1;
    for (int k = 0; k < 4; k++) {
        i->ticks[k] += i->active[k];
        i->active[k] = false;
    }
    return 0;
}

int fmi3SetFloat64(void *c, const uint32_t references[], size_t n, const double values[], size_t m) {
    (void)m;
    for (size_t k = 0; k < n; k++) if (references[k] == 20) ((Instance *)c)->u = values[k];
    return 0;
}
int fmi3GetFloat64(void *c, const uint32_t references[], size_t n, double values[], size_t m) {
    Instance *i = c;
    (void)m;
    for (size_t k = 0; k < n; k++)
        values[k] = references[k] == 15 ? i->sampled : references[k] == 16 ? i->at : i->u;
    return 0;
}
int fmi3GetInt32(void *c, const uint32_t references[], size_t n, int32_t values[], size_t m) {
    (void)m;
    for (size_t k = 0; k < n; k++) {
        if (references[k] < 11 || references[k] > 14) return 3;
        values[k] = ((Instance *)c)->ticks[references[k] - 11];
    }
    return 0;
}
int fmi3DoStep(void *c, double time, double step, bool no_state, bool *event, bool *end, bool *early,
               double *last) {
    Instance *i = c;
    (void)no_state;
    if (i->event) return 3;
    *event = *end = *early = false;
    *last = i->time = time + step;
    return 0;
}
