/* Makes the calls that a run made, without a master: what they cost by themselves.
 *
 * replay CALLS ROUNDS
 * CALLS is text: `library PATH`, `instance NAME GUID RESOURCES LIBRARY` and calls, one a line:
 * `INSTANCE r REFERENCES`, `INSTANCE w REFERENCES VALUES` (Reals), `INSTANCE i REFERENCES VALUES`
 * (Integers), `INSTANCE b REFERENCES VALUES` (Booleans), `INSTANCE s TIME STEP`, `INSTANCE e START STOP`
 * (experiment), `INSTANCE n` and `INSTANCE x` (enters and exits initialization). Lists begin with their
 * length. Calls after the last `x` are timed. Prints seconds, a round a line, then the last Real of
 * every instance that was read, to be compared with what the run gave. FMI 2.0. */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef int Status;
typedef void *Component;
typedef struct {
    void (*logger)(void *, const char *, Status, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, Status);
    void *environment;
} Callbacks;

typedef struct {
    Component (*instantiate)(const char *, int, const char *, const char *, const Callbacks *, int, int);
    void (*free_instance)(Component);
    Status (*setup)(Component, int, double, double, int, double);
    Status (*enter)(Component);
    Status (*leave)(Component);
    Status (*get_real)(Component, const unsigned *, size_t, double *);
    Status (*set_real)(Component, const unsigned *, size_t, const double *);
    Status (*set_integer)(Component, const unsigned *, size_t, const int *);
    Status (*set_boolean)(Component, const unsigned *, size_t, const int *);
    Status (*step)(Component, double, double, int);
} Library;

typedef struct {
    char name[256], guid[256], resources[2048];
    int library;
    Component component;
    double last;
} Instance;

typedef struct {
    char kind;
    int instance;
    size_t count;
    unsigned *references;
    double *reals, times[2];
    int *integers;
} Call;

static Library libraries[64];
static Instance instances[64];
static Call *calls;
static size_t library_count, instance_count, call_count, first_timed;

static void fail(const char *what) {
    fprintf(stderr, "%s\n", what);
    exit(1);
}

static void says(void *e, const char *name, Status status, const char *category, const char *text, ...) {
    (void)e; (void)category;
    va_list rest;
    if (status < 2) return;
    va_start(rest, text);
    fprintf(stderr, "%s: ", name);
    vfprintf(stderr, text, rest);
    fputc('\n', stderr);
    va_end(rest);
}

static void *symbol(void *handle, const char *name) {
    void *found = dlsym(handle, name);
    if (!found) fail(dlerror());
    return found;
}

static void load(const char *path) {
    void *handle = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!handle) fail(dlerror());
    Library *l = &libraries[library_count++];
    *(void **)&l->instantiate = symbol(handle, "fmi2Instantiate");
    *(void **)&l->free_instance = symbol(handle, "fmi2FreeInstance");
    *(void **)&l->setup = symbol(handle, "fmi2SetupExperiment");
    *(void **)&l->enter = symbol(handle, "fmi2EnterInitializationMode");
    *(void **)&l->leave = symbol(handle, "fmi2ExitInitializationMode");
    *(void **)&l->get_real = symbol(handle, "fmi2GetReal");
    *(void **)&l->set_real = symbol(handle, "fmi2SetReal");
    *(void **)&l->set_integer = symbol(handle, "fmi2SetInteger");
    *(void **)&l->set_boolean = symbol(handle, "fmi2SetBoolean");
    *(void **)&l->step = symbol(handle, "fmi2DoStep");
}

static size_t length(FILE *file) {
    size_t count;
    if (fscanf(file, "%zu", &count) != 1) fail("a list without a length");
    return count;
}

static void read_call(FILE *file, const char *word) {
    calls = realloc(calls, (call_count + 1) * sizeof *calls);
    Call *call = &calls[call_count++];
    memset(call, 0, sizeof *call);
    call->instance = atoi(word);
    if (fscanf(file, " %c", &call->kind) != 1) fail("a call without a kind");
    if (strchr("rwib", call->kind)) {
        call->count = length(file);
        call->references = calloc(call->count + 1, sizeof *call->references);
        call->reals = calloc(call->count + 1, sizeof *call->reals);
        call->integers = calloc(call->count + 1, sizeof *call->integers);
        for (size_t k = 0; k < call->count; k++)
            if (fscanf(file, "%u", &call->references[k]) != 1) fail("no reference");
    }
    if (call->kind != 'r' && call->count && length(file) != call->count) fail("lists that differ in length");
    for (size_t k = 0; k < call->count && call->kind != 'r'; k++) {
        if (fscanf(file, "%lf", &call->reals[k]) != 1) fail("no value");
        call->integers[k] = (int)call->reals[k];
    }
    if (strchr("se", call->kind) && fscanf(file, "%lf %lf", &call->times[0], &call->times[1]) != 2) fail("no times");
    if (call->kind == 'x') first_timed = call_count;
}

static inline Status make(Call *call) {
    Instance *i = &instances[call->instance];
    const Library *l = &libraries[i->library];
    switch (call->kind) {
    case 'r': {
        Status status = l->get_real(i->component, call->references, call->count, call->reals);
        i->last = call->reals[call->count - 1];
        return status;
    }
    case 'w': return l->set_real(i->component, call->references, call->count, call->reals);
    case 's': return l->step(i->component, call->times[0], call->times[1], 1);
    case 'i': return l->set_integer(i->component, call->references, call->count, call->integers);
    case 'b': return l->set_boolean(i->component, call->references, call->count, call->integers);
    case 'e': return l->setup(i->component, 0, 0.0, call->times[0], 1, call->times[1]);
    case 'n': return l->enter(i->component);
    case 'x': return l->leave(i->component);
    default: return 3;
    }
}

int main(int count, char **arguments) {
    if (count != 3) fail("replay CALLS ROUNDS");
    FILE *file = fopen(arguments[1], "r");
    char word[2048];
    if (!file) fail("no calls");
    while (fscanf(file, "%2047s", word) == 1) {
        if (!strcmp(word, "library")) {
            if (fscanf(file, "%2047s", word) != 1) fail("no path");
            load(word);
        } else if (!strcmp(word, "instance")) {
            Instance *i = &instances[instance_count++];
            if (fscanf(file, "%255s %255s %2047s %d", i->name, i->guid, i->resources, &i->library) != 4)
                fail("no instance");
        } else {
            read_call(file, word);
        }
    }
    Callbacks callbacks = {says, calloc, free, NULL, NULL};
    for (int round = 0; round < atoi(arguments[2]); round++) {
        for (size_t k = 0; k < instance_count; k++) {
            Instance *i = &instances[k];
            i->component = libraries[i->library].instantiate(i->name, 1, i->guid, i->resources, &callbacks, 0, 0);
            if (!i->component) fail("an FMU refuses");
        }
        for (size_t k = 0; k < first_timed; k++)
            if (make(&calls[k]) > 1) fail("a call before the run is refused");
        struct timespec begin, end;
        Status worst = 0;
        clock_gettime(CLOCK_MONOTONIC, &begin);
        for (size_t k = first_timed; k < call_count; k++) worst |= make(&calls[k]);
        clock_gettime(CLOCK_MONOTONIC, &end);
        if (worst > 1) fail("a call is refused");
        printf("%.9f\n", (double)(end.tv_sec - begin.tv_sec) + 1e-9 * (double)(end.tv_nsec - begin.tv_nsec));
        for (size_t k = 0; k < instance_count; k++) libraries[instances[k].library].free_instance(instances[k].component);
    }
    printf("%zu\n", call_count - first_timed);
    for (size_t k = 0; k < instance_count; k++) printf("%.17g\n", instances[k].last);
    return 0;
}
