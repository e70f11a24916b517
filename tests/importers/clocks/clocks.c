/* An FMI 3.0 co-simulation FMU with event mode and input clocks of each kind. `periodic` (1) ticks every
 * 0.2 s, `later` (2) every 0.3 s from 0.1 s, `countdown` (3) 0.05 s after each tick of `periodic`, and
 * `changing` (4) 0.1, 0.2, 0.3 s... apart. Outputs 11 to 14 (Int32) count the ticks; 15 (Float64) is the
 * input 20 (Float64, of the clock `periodic`) in the last tick, 16 the time of that tick. The input clock
 * `triggered` (5) ticks when another clock says so; output 17 (Int32) counts its ticks, 18 is the input 21
 * (Int32, of that clock) in the last one and 19 its time. The output clock `ticks` (6) ticks with `periodic`,
 * `relay` (7) with `triggered`, and `early` (8) at 0.33 s, at which a step returns early. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

typedef struct {
    int ticks[5], changed, countdown, v, held;
    bool active[5], event, is_early;
    double time, u, sampled, at, triggered_at;
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
        if (references[k] < 1 || references[k] > 5) return 3;
        i->active[references[k] - 1] = values[k];
    }
    return 0;
}
int fmi3GetClock(void *c, const uint32_t references[], size_t n, bool values[]) {
    Instance *i = c;
    if (!i->event) return 3;
    for (size_t k = 0; k < n; k++) {
        if (references[k] < 6 || references[k] > 8) return 3;
        values[k] = references[k] == 6 ? i->active[0] : references[k] == 7 ? i->active[4] : i->is_early;
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
    if (i->active[4]) {
        i->held = i->v;
        i->triggered_at = i->time;
    }
    i->is_early = false;
    for (int k = 0; k < 5; k++) {
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
        values[k] = references[k] == 15   ? i->sampled
                    : references[k] == 16 ? i->at
                    : references[k] == 19 ? i->triggered_at
                                          : i->u;
    return 0;
}
int fmi3GetInt32(void *c, const uint32_t references[], size_t n, int32_t values[], size_t m) {
    (void)m;
    for (size_t k = 0; k < n; k++) {
        Instance *i = c;
        if (references[k] < 11 || references[k] > 18) return 3;
        values[k] = references[k] == 17 ? i->ticks[4] : references[k] == 18 ? i->held : i->ticks[references[k] - 11];
    }
    return 0;
}
/* What belongs to a clock is set when it ticks, and not otherwise. */
int fmi3SetInt32(void *c, const uint32_t references[], size_t n, const int32_t values[], size_t m) {
    Instance *i = c;
    (void)m;
    for (size_t k = 0; k < n; k++)
        if (references[k] == 21 && i->event && i->active[4]) i->v = values[k];
    return 0;
}
int fmi3DoStep(void *c, double time, double step, bool no_state, bool *event, bool *end, bool *early,
               double *last) {
    Instance *i = c;
    (void)no_state;
    if (i->event) return 3;
    *event = *end = *early = false;
    *last = i->time = time + step;
    if (time < 0.33 && time + step > 0.33 + 1e-9) {
        *last = i->time = 0.33;
        *event = *early = i->is_early = true;
    }
    return 0;
}
