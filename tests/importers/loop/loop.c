/* An FMU without states, y = offset + gain u + bend u^2, for loops of direct feedthrough. With FMI3
 * defined it is one of FMI 3.0, without it one of FMI 2.0. DERIVATIVES: 0 none, 1 directional, 2 adjoint
 * (FMI 3.0), 3 directional with the wrong sign.
 *
 * Value references: y 0, u 1, gain 2, bend 3, offset 4. */
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

typedef int Status;
typedef struct {
    double v[5];
} Instance;

static Instance *new(void) {
    Instance *i = calloc(1, sizeof(Instance));
    i->v[2] = 1;
    return i;
}

static double slope(const Instance *i) {
    double by = i->v[2] + 2 * i->v[3] * i->v[1];
    return DERIVATIVES == 3 ? -by : by;
}

static Status get(Instance *i, const unsigned vr[], size_t n, double value[]) {
    double u = i->v[1];
    i->v[0] = i->v[4] + i->v[2] * u + i->v[3] * u * u;
    for (size_t k = 0; k < n; k++) {
        if (vr[k] > 4) return 3;
        value[k] = i->v[vr[k]];
    }
    return 0;
}

static Status set(Instance *i, const unsigned vr[], size_t n, const double value[]) {
    for (size_t k = 0; k < n; k++) {
        if (vr[k] > 4) return 3;
        i->v[vr[k]] = value[k];
    }
    return 0;
}

/* Of `y` by `u` alone; everything else stays as it is. */
static void derivative(Instance *i, const unsigned of[], size_t n, const unsigned by[], size_t m,
                       const double seed[], double out[], int is_adjoint) {
    for (size_t k = 0; k < (is_adjoint ? m : n); k++) out[k] = 0;
    for (size_t a = 0; a < n; a++)
        for (size_t b = 0; b < m; b++)
            if (of[a] == 0 && by[b] == 1) out[is_adjoint ? b : a] += slope(i) * seed[is_adjoint ? a : b];
}

#ifdef FMI3
void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                  bool logging, bool event_mode, bool early, const unsigned required[],
                                  size_t n, void *environment, void *log, void *intermediate) {
    (void)name; (void)token; (void)resources; (void)visible; (void)logging; (void)event_mode; (void)early;
    (void)required; (void)n; (void)environment; (void)log; (void)intermediate;
    return new();
}
Status fmi3EnterInitializationMode(void *c, bool a, double b, double d, bool e, double f) {
    (void)c; (void)a; (void)b; (void)d; (void)e; (void)f;
    return 0;
}
Status fmi3ExitInitializationMode(void *c) { (void)c; return 0; }
Status fmi3Terminate(void *c) { (void)c; return 0; }
void fmi3FreeInstance(void *c) { free(c); }
Status fmi3GetFloat64(void *c, const unsigned vr[], size_t n, double value[], size_t m) {
    (void)m;
    return get(c, vr, n, value);
}
Status fmi3SetFloat64(void *c, const unsigned vr[], size_t n, const double value[], size_t m) {
    (void)m;
    return set(c, vr, n, value);
}
Status fmi3DoStep(void *c, double time, double step, bool no, bool *event, bool *end, bool *early, double *last) {
    (void)c; (void)no;
    *event = *end = *early = false;
    *last = time + step;
    return 0;
}
Status fmi3GetDirectionalDerivative(void *c, const unsigned of[], size_t n, const unsigned by[], size_t m,
                                    const double seed[], size_t seeds, double out[], size_t outs) {
    if (DERIVATIVES != 1 || seeds != m || outs != n) return 3;
    derivative(c, of, n, by, m, seed, out, 0);
    return 0;
}
Status fmi3GetAdjointDerivative(void *c, const unsigned of[], size_t n, const unsigned by[], size_t m,
                                const double seed[], size_t seeds, double out[], size_t outs) {
    if (DERIVATIVES != 2 || seeds != n || outs != m) return 3;
    derivative(c, of, n, by, m, seed, out, 1);
    return 0;
}
#else
void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *resources,
                      const void *callbacks, int visible, int logging) {
    (void)name; (void)kind; (void)guid; (void)resources; (void)callbacks; (void)visible; (void)logging;
    return new();
}
void fmi2FreeInstance(void *c) { free(c); }
Status fmi2SetupExperiment(void *c, int a, double b, double start, int d, double stop) {
    (void)c; (void)a; (void)b; (void)start; (void)d; (void)stop;
    return 0;
}
Status fmi2EnterInitializationMode(void *c) { (void)c; return 0; }
Status fmi2ExitInitializationMode(void *c) { (void)c; return 0; }
Status fmi2Terminate(void *c) { (void)c; return 0; }
Status fmi2GetReal(void *c, const unsigned vr[], size_t n, double value[]) {
    return get(c, vr, n, value);
}
Status fmi2SetReal(void *c, const unsigned vr[], size_t n, const double value[]) {
    return set(c, vr, n, value);
}
Status fmi2DoStep(void *c, double time, double step, int no) {
    (void)c; (void)time; (void)step; (void)no;
    return 0;
}
Status fmi2GetDirectionalDerivative(void *c, const unsigned of[], size_t n, const unsigned by[], size_t m,
                                    const double seed[], double out[]) {
    if (DERIVATIVES != 1 && DERIVATIVES != 3) return 3;
    derivative(c, of, n, by, m, seed, out, 0);
    return 0;
}
#endif
