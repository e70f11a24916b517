/* An FMU of FMI 2.0: a mass on a spring and a damper to the ground and a spring to another mass,
 *
 *     m x'' = force - c x' - k x + coupling (other - x),
 *
 * stepped exactly for what it is given, which it holds over a step. It discards steps that are longer
 * than `longest`, where that is above 0, and comes to no number after one longer than -`longest`, where that
 * is below.
 *
 * Value references: x 0, v 1, other 2, force 3, m 4, c 5, k 6, coupling 7, x0 8, longest 9. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef int Status;
typedef struct {
    double v[10];
    double reached;
} Instance;
enum { X, V, OTHER, FORCE, M, C, K, COUPLING, X0, LONGEST };

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                      const void *callbacks, int visible, int logging) {
    (void)name; (void)type; (void)guid; (void)resources; (void)callbacks; (void)visible; (void)logging;
    Instance *i = calloc(1, sizeof(Instance));
    i->v[M] = i->v[K] = i->v[COUPLING] = 1;
    return i;
}
void fmi2FreeInstance(void *c) { free(c); }
Status fmi2SetupExperiment(void *c, int a, double b, double start, int d, double e) {
    (void)a; (void)b; (void)d; (void)e;
    ((Instance *)c)->reached = start;
    return 0;
}
Status fmi2EnterInitializationMode(void *c) { (void)c; return 0; }
Status fmi2ExitInitializationMode(void *c) {
    Instance *i = c;
    i->v[X] = i->v[X0];
    return 0;
}
Status fmi2Terminate(void *c) { (void)c; return 0; }
Status fmi2Reset(void *c) { (void)c; return 0; }
Status fmi2SetDebugLogging(void *c, int on, size_t n, const char *const of[]) {
    (void)c; (void)on; (void)n; (void)of;
    return 0;
}
Status fmi2GetReal(void *c, const unsigned vr[], size_t n, double value[]) {
    for (size_t k = 0; k < n; k++) value[k] = ((Instance *)c)->v[vr[k]];
    return 0;
}
Status fmi2SetReal(void *c, const unsigned vr[], size_t n, const double value[]) {
    for (size_t k = 0; k < n; k++) ((Instance *)c)->v[vr[k]] = value[k];
    return 0;
}
Status fmi2DoStep(void *c, double time, double h, int none) {
    (void)none;
    Instance *i = c;
    double *v = i->v;
    if (v[LONGEST] > 0 && h > v[LONGEST] * (1 + 1e-9)) return 2;
    double stiffness = v[K] + v[COUPLING], rest = (v[FORCE] + v[COUPLING] * v[OTHER]) / stiffness;
    double decay = v[C] / (2 * v[M]), w = sqrt(stiffness / v[M] - decay * decay);
    double a = v[X] - rest, b = (v[V] + decay * a) / w;
    double fade = exp(-decay * h), co = cos(w * h), si = sin(w * h);
    v[X] = rest + fade * (a * co + b * si);
    v[V] = fade * ((b * w - decay * a) * co - (a * w + decay * b) * si);
    if (v[LONGEST] < 0 && h > -v[LONGEST] * (1 + 1e-9)) v[X] = NAN;
    i->reached = time + h;
    return 0;
}
Status fmi2GetRealStatus(void *c, int kind, double *value) {
    (void)kind;
    *value = ((Instance *)c)->reached;
    return 0;
}
Status fmi2GetBooleanStatus(void *c, int kind, int *value) {
    (void)c; (void)kind;
    *value = 0;
    return 0;
}
Status fmi2GetFMUstate(void *c, void **state) {
    if (!*state) *state = malloc(sizeof(Instance));
    memcpy(*state, c, sizeof(Instance));
    return 0;
}
Status fmi2SetFMUstate(void *c, void *state) {
    memcpy(c, state, sizeof(Instance));
    return 0;
}
Status fmi2FreeFMUstate(void *c, void **state) {
    (void)c;
    free(*state);
    *state = NULL;
    return 0;
}
Status fmi2SerializedFMUstateSize(void *c, void *state, size_t *size) {
    (void)c; (void)state;
    *size = sizeof(Instance);
    return 0;
}
Status fmi2SerializeFMUstate(void *c, void *state, char bytes[], size_t size) {
    (void)c;
    memcpy(bytes, state, size);
    return 0;
}
Status fmi2DeSerializeFMUstate(void *c, const char bytes[], size_t size, void **state) {
    (void)c;
    if (!*state) *state = malloc(sizeof(Instance));
    memcpy(*state, bytes, size);
    return 0;
}
Status fmi2GetInteger(void *c, const unsigned vr[], size_t n, int value[]) { (void)c; (void)vr; (void)value; return n ? 3 : 0; }
Status fmi2SetInteger(void *c, const unsigned vr[], size_t n, const int value[]) { (void)c; (void)vr; (void)value; return n ? 3 : 0; }
Status fmi2GetBoolean(void *c, const unsigned vr[], size_t n, int value[]) { (void)c; (void)vr; (void)value; return n ? 3 : 0; }
Status fmi2SetBoolean(void *c, const unsigned vr[], size_t n, const int value[]) { (void)c; (void)vr; (void)value; return n ? 3 : 0; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
