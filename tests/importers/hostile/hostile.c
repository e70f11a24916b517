/* FMI 2.0 co-simulation FMUs that do what FMUs must not do, or what few expect of them. Which one is
 * chosen by the macro BEHAVIOUR when it is compiled. An output `y` (0), an input `u` (1), a time to
 * misbehave `at` (2); `y` is the input of the step before where nothing else is said. */
#include <fenv.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum {
    HONEST, KEEPS_CALLBACKS, UNKNOWN_STATUS, NULL_MESSAGE, SEGFAULT, ABORT, EXIT, LOOP, PRINTS, STRICT,
    LATE, ENDS, ESCAPES, REPEATS, ONCE, DISCARDS, DIES_WHEN_LOADED, DIES_WHEN_FREED, DIVERGES, DIRECT,
    FORKS, RETURNS_TWICE, DAEMON, STRANGE_ENVIRONMENT, TRUNCATES, FORGES, ROUNDS, THIRDS
};

typedef int Status;
typedef void (*Logger)(void *, const char *, Status, const char *, const char *, ...);
typedef struct {
    Logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, Status);
    void *environment;
} Callbacks;

typedef struct {
    const Callbacks *callbacks;
    double u, y, at, time;
    int is_set;
    char *name;
} Instance;

static int instances;

__attribute__((constructor)) static void loaded(void) {
    if (BEHAVIOUR == DIES_WHEN_LOADED) abort();
}

/* As the old FMU SDK: the pointer is kept, not what it points to. */
void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *resources,
                      const Callbacks *callbacks, int visible, int logging) {
    Instance *i = callbacks->allocate(1, sizeof(Instance));
    (void)kind; (void)guid; (void)resources; (void)visible; (void)logging;
    if (BEHAVIOUR == ONCE && instances++ > 0) {
        callbacks->logger(callbacks->environment, name, 3, "logStatusError", "only once in a process");
        return NULL;
    }
    i->callbacks = callbacks;
    i->name = callbacks->allocate(strlen(name) + 1, 1);
    strcpy(i->name, name);
    i->at = 1.0;
    i->u = 0.25;
    return i;
}

static void says(Instance *i, Status status, const char *text, double number) {
    i->callbacks->logger(i->callbacks->environment, i->name, status, "logAll", text, number);
}

void fmi2FreeInstance(void *c) {
    Instance *i = c;
    void (*release)(void *) = i->callbacks->release;
    if (BEHAVIOUR == KEEPS_CALLBACKS) says(i, 1, "freed at %g s", i->time);
    if (BEHAVIOUR == DIES_WHEN_FREED) abort();
    release(i->name);
    release(i);
}

Status fmi2SetupExperiment(void *c, int a, double b, double start, int d, double stop) {
    (void)c; (void)a; (void)b; (void)start; (void)d; (void)stop;
    return 0;
}
Status fmi2EnterInitializationMode(void *c) { (void)c; return 0; }
Status fmi2ExitInitializationMode(void *c) {
    Instance *i = c;
    if (BEHAVIOUR != LATE) i->y = i->u;
    i->is_set = 0;
    return 0;
}
Status fmi2Terminate(void *c) {
    if (BEHAVIOUR == KEEPS_CALLBACKS) says(c, 1, "terminated at %g s", ((Instance *)c)->time);
    return 0;
}
Status fmi2Reset(void *c) { (void)c; return 0; }
Status fmi2SetDebugLogging(void *c, int on, size_t n, const char *const names[]) {
    (void)c; (void)on; (void)n; (void)names;
    return 0;
}

Status fmi2GetReal(void *c, const unsigned vr[], size_t n, double value[]) {
    Instance *i = c;
    if (BEHAVIOUR == STRICT && i->is_set) {
        says(i, 3, "fmi2GetReal after fmi2SetReal without fmi2DoStep at %g s", i->time);
        return 3;
    }
    for (size_t k = 0; k < n; k++)
        value[k] = vr[k] == 0 ? (BEHAVIOUR == DIRECT ? 2 * i->u : i->y) : vr[k] == 1 ? i->u : i->at;
    return 0;
}

Status fmi2SetReal(void *c, const unsigned vr[], size_t n, const double value[]) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++) {
        if (vr[k] == 1) i->u = value[k];
        if (vr[k] == 2) i->at = value[k];
        if (vr[k] == 1 && i->time > 0) i->is_set = 1;
    }
    return 0;
}

/* The memory that it shares with the program, overwritten again and again. */
static void *forges(void *nothing) {
    char line[512];
    unsigned long from = 0, to = 0;
    FILE *maps = fopen("/proc/self/maps", "r");
    while (fgets(line, sizeof line, maps))
        if (strstr(line, "shakebench-calls") && sscanf(line, "%lx-%lx", &from, &to) == 2) break;
    fclose(maps);
    /* Behind whose turn it is: lengths, messages, calls. */
    for (int k = 0; k < 2000000 && from; k++)
        memset((char *)from + 64 + k % 5000 * 256, k % 2 ? 0xff : 0x7f, 256);
    return nothing;
}

Status fmi2DoStep(void *c, double time, double step, int no_state) {
    Instance *i = c;
    (void)no_state;
    i->is_set = 0;
    i->time = time + step;
    if (BEHAVIOUR == THIRDS) {
        volatile double u = 1 + i->u;
        i->y = u / 3;
        return 0;
    }
    i->y = BEHAVIOUR == LATE || BEHAVIOUR == STRICT ? 2 * i->u : i->u;
    if (time < i->at - 1e-9) return 0;
    switch (BEHAVIOUR) {
    case KEEPS_CALLBACKS: says(i, 1, "stepped from %g s", time); break;
    case UNKNOWN_STATUS: return 17;
    case NULL_MESSAGE: i->callbacks->logger(i->callbacks->environment, NULL, 1, NULL, NULL); break;
    case SEGFAULT: *(volatile int *)8 = 1; break;
    case ABORT: abort();
    case EXIT: exit(0);
    case LOOP: for (volatile int k = 0;; k++) {}
    case PRINTS: printf("printed at %g s\n", time); break;
    case ENDS: case DISCARDS: return 2;
    case ESCAPES: says(i, 1, "\033[2J\033]0;title\a at %g s", time); break;
    case REPEATS: says(i, 1, "the same again and again", 0); break;
    case FORKS:
        if (time < i->at + 1e-9 && fork() == 0) for (;;) pause();
        break;
    case RETURNS_TWICE:
        if (time < i->at + 1e-9) fork();
        break;
    case DAEMON:
        if (fork() == 0) {
            setsid();
            if (fork() == 0) for (;;) pause();
            _exit(0);
        }
        sleep(1);
        abort();
    case STRANGE_ENVIRONMENT:
        i->callbacks->logger((void *)1, i->name, 1, "logAll", "from %g s", time);
        i->callbacks->logger(i, (const char *)8, 1, "logAll", "and %g s", time);
        break;
    case TRUNCATES:
        for (int file = 3; file < 64; file++) if (ftruncate(file, 0)) continue;
        break;
    case FORGES:
        if (time < i->at + 1e-9) {
            pthread_t thread;
            pthread_create(&thread, NULL, forges, NULL);
        }
        break;
    case ROUNDS: fesetround(FE_UPWARD); break;
    case DIVERGES: i->y = 1e300 * (1 + 1e10 * (time - i->at)); break;
    }
    return 0;
}

Status fmi2GetBooleanStatus(void *c, int kind, int *value) {
    (void)c;
    *value = kind == 3 && BEHAVIOUR == ENDS;
    return 0;
}
Status fmi2GetRealStatus(void *c, int kind, double *value) {
    (void)kind;
    *value = ((Instance *)c)->at;
    return 0;
}
