/* Steps one component's library, whatever platform it was built for, and writes down every output
 * bit by bit.
 *
 *     driver LIBRARY VERSION PLAN OUT
 *
 * VERSION is 2 or 3. PLAN is text, a line each:
 *     token TEXT | step SIZE COUNT | input REFERENCE AMPLITUDE | output REFERENCE
 *     choice REFERENCE VALUE     an integer or enumeration, set before initialization
 *     fault                      steps are expected to fail, and the process to live on
 * OUT gets the outputs as doubles, a row a step. The inputs are triangles of whole numbers, so they
 * are the same to the bit wherever this runs. Half way the state is saved as bytes; after a further
 * stretch it is restored and the stretch repeated, which has to give the same bits.
 */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#include <windows.h>
static void *load(const char *path) { return (void *)LoadLibraryA(path); }
static void *find(void *library, const char *name) {
    return (void *)GetProcAddress((HMODULE)library, name);
}
static const char *problem(void) { return "LoadLibrary failed"; }
#else
#include <dlfcn.h>
static void *load(const char *path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }
static void *find(void *library, const char *name) { return dlsym(library, name); }
static const char *problem(void) { return dlerror(); }
#endif

#define MOST 512
#define STRETCH 200

typedef void *Instance;
typedef void *State;

static struct {
    char token[128];
    double step;
    int steps;
    unsigned inputs[MOST], outputs[MOST], choices[MOST];
    double amplitudes[MOST];
    int values[MOST];
    int input_count, output_count, choice_count;
    bool fault;
} plan;

static int messages;
static int version;
static void *library;

static void fail(const char *what) {
    fprintf(stderr, "driver: %s\n", what);
    exit(1);
}

static void *symbol(const char *name) {
    char whole[96];
    snprintf(whole, sizeof whole, "fmi%d%s", version, name);
    /* FMI 2.0 wrote two of them otherwise. */
    char *state = strstr(whole, "FMUState"), *read = strstr(whole, "Deserialize");
    if (version == 2 && state) state[3] = 's';
    if (version == 2 && read) read[2] = 'S';
    void *found = find(library, whole);
    if (!found) fail(whole);
    return found;
}

static void check(int status, const char *call) {
    if (status > 1) fail(call);
}

static void log_fmi2(void *env, const char *instance, int status, const char *category,
                 const char *text, ...) {
    (void)env, (void)instance, (void)status, (void)category, (void)text;
    messages++;
}

static void log_fmi3(void *env, int status, const char *category, const char *text) {
    (void)env, (void)status, (void)category, (void)text;
    messages++;
}

typedef struct {
    void *logger, *allocate, *release, *step_finished, *environment;
} Callbacks2;

static Instance instantiate(const char *name) {
    if (version == 2) {
        static Callbacks2 callbacks;
        callbacks.logger = (void *)log_fmi2;
        callbacks.allocate = (void *)calloc;
        callbacks.release = (void *)free;
        Instance (*make)(const char *, int, const char *, const char *, const Callbacks2 *, int,
                         int) = symbol("Instantiate");
        return make(name, 1, plan.token, NULL, &callbacks, 0, 1);
    }
    Instance (*make)(const char *, const char *, const char *, bool, bool, bool, bool,
                     const unsigned *, size_t, void *, void *, void *) =
        symbol("InstantiateCoSimulation");
    return make(name, plan.token, NULL, false, true, false, false, NULL, 0, NULL, (void *)log_fmi3,
                NULL);
}

static void initialize(Instance instance) {
    for (int i = 0; i < plan.choice_count; i++) {
        if (version == 2) {
            int (*set)(Instance, const unsigned *, size_t, const int *) = symbol("SetInteger");
            check(set(instance, &plan.choices[i], 1, &plan.values[i]), "SetInteger");
        } else {
            int (*set)(Instance, const unsigned *, size_t, const int64_t *, size_t) =
                symbol("SetInt64");
            int64_t value = plan.values[i];
            check(set(instance, &plan.choices[i], 1, &value, 1), "SetInt64");
        }
    }
    int (*leave)(Instance) = symbol("ExitInitializationMode");
    if (version == 2) {
        int (*setup)(Instance, int, double, double, int, double) = symbol("SetupExperiment");
        int (*enter)(Instance) = symbol("EnterInitializationMode");
        check(setup(instance, 0, 0, 0, 0, 0), "SetupExperiment");
        check(enter(instance), "EnterInitializationMode");
    } else {
        int (*enter)(Instance, bool, double, double, bool, double) =
            symbol("EnterInitializationMode");
        check(enter(instance, false, 0, 0, false, 0), "EnterInitializationMode");
    }
    check(leave(instance), "ExitInitializationMode");
}

/* A triangle between -1 and 1 of whole period. */
static double triangle(int k, int period) {
    int phase = k % period;
    int up = 4 * phase <= 2 * period ? 4 * phase - period : 3 * period - 4 * phase;
    return (double)up / period;
}

static void set_inputs(Instance instance, int k) {
    double values[MOST];
    for (int i = 0; i < plan.input_count; i++) {
        double wave = triangle(k + 31 * i, 97 + 2 * i) + 0.5 * triangle(k + 7 * i, 411 + i);
        values[i] = plan.amplitudes[i] * wave;
    }
    size_t count = plan.input_count;
    if (!count) return;
    if (version == 2) {
        int (*set)(Instance, const unsigned *, size_t, const double *) = symbol("SetReal");
        check(set(instance, plan.inputs, count, values), "SetReal");
    } else {
        int (*set)(Instance, const unsigned *, size_t, const double *, size_t) =
            symbol("SetFloat64");
        check(set(instance, plan.inputs, count, values, count), "SetFloat64");
    }
}

static int step(Instance instance, int k) {
    double time = k * plan.step;
    if (version == 2) {
        int (*advance)(Instance, double, double, int) = symbol("DoStep");
        return advance(instance, time, plan.step, 1);
    }
    bool event, end, early;
    double last;
    int (*advance)(Instance, double, double, bool, bool *, bool *, bool *, double *) =
        symbol("DoStep");
    return advance(instance, time, plan.step, true, &event, &end, &early, &last);
}

static void get_outputs(Instance instance, double *values) {
    size_t count = plan.output_count;
    if (!count) return;
    if (version == 2) {
        int (*get)(Instance, const unsigned *, size_t, double *) = symbol("GetReal");
        check(get(instance, plan.outputs, count, values), "GetReal");
    } else {
        int (*get)(Instance, const unsigned *, size_t, double *, size_t) = symbol("GetFloat64");
        check(get(instance, plan.outputs, count, values, count), "GetFloat64");
    }
}

static unsigned char *save(Instance instance, size_t *size) {
    State state = NULL;
    int (*get)(Instance, State *) = symbol("GetFMUState");
    int (*size_of)(Instance, State, size_t *) = symbol("SerializedFMUStateSize");
    int (*write)(Instance, State, unsigned char *, size_t) = symbol("SerializeFMUState");
    int (*release)(Instance, State *) = symbol("FreeFMUState");
    check(get(instance, &state), "GetFMUState");
    check(size_of(instance, state, size), "SerializedFMUStateSize");
    unsigned char *bytes = malloc(*size);
    check(write(instance, state, bytes, *size), "SerializeFMUState");
    check(release(instance, &state), "FreeFMUState");
    return bytes;
}

static void restore(Instance instance, const unsigned char *bytes, size_t size) {
    State state = NULL;
    int (*read)(Instance, const unsigned char *, size_t, State *) =
        symbol("DeserializeFMUState");
    int (*set)(Instance, State) = symbol("SetFMUState");
    int (*release)(Instance, State *) = symbol("FreeFMUState");
    check(read(instance, bytes, size, &state), "DeserializeFMUState");
    check(set(instance, state), "SetFMUState");
    check(release(instance, &state), "FreeFMUState");
}

static void read_plan(const char *path) {
    FILE *file = fopen(path, "r");
    char word[32];
    if (!file) fail("the plan cannot be read");
    while (fscanf(file, "%31s", word) == 1) {
        int read = 0, wanted = 1;
        if (!strcmp(word, "token")) {
            read = fscanf(file, "%127s", plan.token);
        } else if (!strcmp(word, "step")) {
            wanted = 2;
            read = fscanf(file, "%lf %d", &plan.step, &plan.steps);
        } else if (!strcmp(word, "input") && plan.input_count < MOST) {
            int i = plan.input_count++;
            wanted = 2;
            read = fscanf(file, "%u %lf", &plan.inputs[i], &plan.amplitudes[i]);
        } else if (!strcmp(word, "output") && plan.output_count < MOST) {
            read = fscanf(file, "%u", &plan.outputs[plan.output_count++]);
        } else if (!strcmp(word, "choice") && plan.choice_count < MOST) {
            int i = plan.choice_count++;
            wanted = 2;
            read = fscanf(file, "%u %d", &plan.choices[i], &plan.values[i]);
        } else if (!strcmp(word, "fault")) {
            wanted = 0;
            plan.fault = true;
        }
        if (read != wanted) fail("the plan has a line that is not understood");
    }
    fclose(file);
}

/* A failing component beside one that does not know: the fault stays inside its instance. */
static void expect_faults(void) {
    Instance instance = instantiate("faulty");
    if (!instance) fail("Instantiate");
    initialize(instance);
    for (int k = 0; k < 3; k++) {
        if (step(instance, k) < 2) fail("the step went well and should have failed");
    }
    void (*release)(Instance) = symbol("FreeInstance");
    release(instance);
    plan.choice_count = 0;
    Instance sound = instantiate("sound");
    if (!sound) fail("Instantiate after the fault");
    initialize(sound);
    for (int k = 0; k < 3; k++) check(step(sound, k), "DoStep after the fault");
    release(sound);
    if (!messages) fail("nothing was logged");
    printf("caught\n");
}

int main(int count, char **arguments) {
    if (count != 5) fail("expected LIBRARY VERSION PLAN OUT");
    version = atoi(arguments[2]);
    read_plan(arguments[3]);
    library = load(arguments[1]);
    if (!library) fail(problem());
    if (plan.fault) {
        expect_faults();
        return 0;
    }
    FILE *out = fopen(arguments[4], "wb");
    if (!out) fail("the output cannot be written");

    Instance instance = instantiate("driven");
    if (!instance) fail("Instantiate");
    initialize(instance);
    size_t row = plan.output_count, size = 0;
    double *first = malloc(STRETCH * row * sizeof *first), *values = malloc((row + 1) * sizeof *values);
    unsigned char *bytes = NULL;
    int begin = plan.steps / 2, restored = 0;
    for (int k = 0; k < plan.steps; k++) {
        if (k == begin && !restored) bytes = save(instance, &size);
        set_inputs(instance, k);
        check(step(instance, k), "DoStep");
        get_outputs(instance, values);
        int within = k - begin;
        if (within >= 0 && within < STRETCH) {
            double *kept = first + within * row;
            if (!restored) memcpy(kept, values, row * sizeof *values);
            else if (memcmp(kept, values, row * sizeof *values))
                fail("the restored state gives other values");
        }
        if (within == STRETCH - 1 && !restored) {
            restored = 1;
            restore(instance, bytes, size);
            k = begin - 1;
            continue; /* its rows are written when they are repeated */
        }
        if (restored || within < 0) fwrite(values, sizeof *values, row, out);
    }
    void (*release)(Instance) = symbol("FreeInstance");
    release(instance);
    if (fclose(out)) fail("the output cannot be written");
    printf("restored\n");
    return 0;
}
