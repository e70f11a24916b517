/* FMI 2.0 and 3.0 co-simulation that misbehaves in one of its functions. HOSTILE in the environment says
 * how and where, as in `segfault:DoStep`. An output `y` (0), an input `u` (1). */
#define _GNU_SOURCE
#include <fenv.h>
#include <pthread.h>
#include <setjmp.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

typedef struct {
    double u, y;
} Instance;

typedef void (*Update)(void *, double, _Bool, _Bool, _Bool, _Bool, _Bool *, double *);

static double first;
static Update intermediate;
static void *host;
static int is_over;

static void *spin(void *nothing) {
    for (volatile int k = 0;; k++) {}
    return nothing;
}

static void *print(void *nothing) {
    for (;;) puts("printed without end, printed without end, printed without end, printed without end");
    return nothing;
}

static void ignore(int number) { (void)number; }

static int deep(volatile char *before) {
    volatile char room[4096];
    room[0] = before ? before[0] : 1;
    return deep(room) + room[0];
}

static void children(int leave) {
    if (fork() == 0) {
        if (leave) setsid();
        if (leave && fork() != 0) _exit(0);
        for (;;) pause();
    }
}

/* Does what is asked for in the function `where`; gives the status. */
static int act(const char *where) {
    static jmp_buf nowhere;
    const char *wish = getenv("HOSTILE"), *colon = wish ? strchr(wish, ':') : NULL;
    char what[64] = "";
    pthread_t thread;
    volatile double zero = 0.0;
    if (!colon || strcmp(colon + 1, where) || colon - wish > 63) return 0;
    memcpy(what, wish, (size_t)(colon - wish));
#define IS(name) (!strcmp(what, name))
    if (IS("status-99")) return 99;
    if (IS("status-minus")) return -1;
    if (IS("fatal")) return 4;
    if (IS("error")) return 3;
    if (IS("spin")) spin(NULL);
    if (IS("print")) print(NULL);
    if (IS("stop")) raise(SIGSTOP);
    if (IS("stop-all")) kill(0, SIGSTOP);
    if (IS("deep")) return deep(NULL);
    if (is_over) return 0;
    is_over = 1;
    if (IS("segfault")) *(volatile int *)8 = 1;
    if (IS("wild-call")) ((void (*)(void))16)();
    if (IS("abort")) abort();
    if (IS("exit")) exit(0);
    if (IS("exit-3")) exit(3);
    if (IS("quick-exit")) _exit(0);
    if (IS("kill")) raise(SIGKILL);
    if (IS("terminate")) raise(SIGTERM);
    if (IS("interrupt")) raise(SIGINT);
    if (IS("pipe")) raise(SIGPIPE);
    if (IS("alarm")) { alarm(1); sleep(2); }
    if (IS("fork")) children(0);
    if (IS("forks")) for (int k = 0; k < 20; k++) children(0);
    if (IS("returns-twice")) fork();
    if (IS("daemon")) children(1);
    if (IS("daemon-dies")) { children(1); usleep(100000); abort(); }
    if (IS("thread-spins")) pthread_create(&thread, NULL, spin, NULL);
    if (IS("thread-prints")) pthread_create(&thread, NULL, print, NULL);
    if (IS("exit-thread")) pthread_exit(NULL);
    if (IS("longjmp")) { memset(&nowhere, 0x5a, sizeof nowhere); longjmp(nowhere, 1); }
    if (IS("traps")) { feenableexcept(FE_DIVBYZERO | FE_INVALID); }
    if (IS("trapped")) { feenableexcept(FE_DIVBYZERO); first = 1.0 / zero; }
    if (IS("rounds")) fesetround(FE_UPWARD);
    if (IS("closes")) for (int file = 0; file < 256; file++) close(file);
    if (IS("closes-output")) { close(1); close(2); }
    if (IS("truncates")) for (int file = 3; file < 256; file++) if (ftruncate(file, 0)) continue;
    if (IS("unmaps")) {
        char line[512];
        unsigned long from = 0, to = 0;
        FILE *maps = fopen("/proc/self/maps", "r");
        while (maps && fgets(line, sizeof line, maps))
            if (strstr(line, "shakebench-calls") && sscanf(line, "%lx-%lx", &from, &to) == 2)
                munmap((void *)from, to - from);
    }
    if (IS("handlers")) for (int k = 1; k < 32; k++) signal(k, ignore);
    if (IS("masks")) { sigset_t all; sigfillset(&all); sigprocmask(SIG_SETMASK, &all, NULL); }
    if (IS("group")) { setpgid(0, 0); spin(NULL); }
    if (IS("session")) { if (fork() == 0) { setsid(); spin(NULL); } spin(NULL); }
    if (IS("limits")) { struct rlimit none = {0, 0}; setrlimit(RLIMIT_FSIZE, &none); setrlimit(RLIMIT_NOFILE, &none); }
    if (IS("directory") && chdir("/")) return 3;
    if (IS("environment")) clearenv();
    if (IS("prints-much")) for (int k = 0; k < 20000; k++) printf("line %d of many\n", k);
    if (IS("prints-bytes")) for (int k = 0; k < 300000; k++) putchar(128 + k % 100);
    if (IS("memory")) memset(malloc((size_t)1 << 46), 1, 1);
    if (IS("frees-twice")) { void *room = malloc(2000); free(room); free(room); }
    if (IS("no-number")) first = zero / zero;
    if (IS("updates")) {
        _Bool early = 1;
        double at = 0;
        intermediate(host, 0.02, 0, 1, 1, 1, &early, &at);
        if (early) abort();
    }
    if (IS("sleep")) usleep(300000);
    return 0;
}

static Instance *make(const char *name) {
    Instance *i = calloc(1, sizeof(Instance));
    (void)name;
    i->u = 0.25;
    if (act("Instantiate")) return NULL;
    return i;
}

static int step(void *c, double time) {
    Instance *i = c;
    int status = 0;
    if (time > 0.0199) status = act("DoStep");
    i->y = i->u + first;
    return status;
}

static int get(void *c, const unsigned vr[], size_t n, double value[]) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++) value[k] = vr[k] ? i->u : i->y;
    return act("Get");
}

static int set(void *c, const unsigned vr[], size_t n, const double value[]) {
    for (size_t k = 0; k < n; k++) if (vr[k] == 1) ((Instance *)c)->u = value[k];
    return act("Set");
}

/* FMI 2.0 */
void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *resources,
                      const void *callbacks, int visible, int logging) {
    (void)kind; (void)guid; (void)resources; (void)callbacks; (void)visible; (void)logging;
    return make(name);
}
void fmi2FreeInstance(void *c) { act("FreeInstance"); free(c); }
int fmi2SetupExperiment(void *c, int a, double b, double start, int d, double stop) {
    (void)c; (void)a; (void)b; (void)start; (void)d; (void)stop;
    return act("SetupExperiment");
}
int fmi2EnterInitializationMode(void *c) { (void)c; return act("EnterInitializationMode"); }
int fmi2ExitInitializationMode(void *c) { (void)c; return act("ExitInitializationMode"); }
int fmi2Terminate(void *c) { (void)c; return act("Terminate"); }
int fmi2Reset(void *c) { (void)c; return 0; }
int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const names[]) {
    (void)c; (void)on; (void)n; (void)names;
    return 0;
}
int fmi2GetReal(void *c, const unsigned vr[], size_t n, double value[]) { return get(c, vr, n, value); }
int fmi2SetReal(void *c, const unsigned vr[], size_t n, const double value[]) { return set(c, vr, n, value); }
int fmi2DoStep(void *c, double time, double size, int no_state) {
    (void)size; (void)no_state;
    return step(c, time);
}

/* FMI 3.0 */
void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, _Bool visible,
                                  _Bool logging, _Bool events, _Bool early, const unsigned *required,
                                  size_t n, void *environment, void *log, void *update) {
    (void)token; (void)resources; (void)visible; (void)logging; (void)events; (void)early; (void)required;
    (void)n; (void)log;
    intermediate = (Update)update;
    host = environment;
    return make(name);
}
void fmi3FreeInstance(void *c) { act("FreeInstance"); free(c); }
int fmi3EnterInitializationMode(void *c, _Bool a, double b, double start, _Bool d, double stop) {
    (void)c; (void)a; (void)b; (void)start; (void)d; (void)stop;
    return act("EnterInitializationMode");
}
int fmi3ExitInitializationMode(void *c) { (void)c; return act("ExitInitializationMode"); }
int fmi3Terminate(void *c) { (void)c; return act("Terminate"); }
int fmi3Reset(void *c) { (void)c; return 0; }
int fmi3SetDebugLogging(void *c, _Bool on, size_t n, const char *const names[]) {
    (void)c; (void)on; (void)n; (void)names;
    return 0;
}
int fmi3GetFloat64(void *c, const unsigned vr[], size_t n, double value[], size_t m) {
    (void)m;
    return get(c, vr, n, value);
}
int fmi3SetFloat64(void *c, const unsigned vr[], size_t n, const double value[], size_t m) {
    (void)m;
    return set(c, vr, n, value);
}
int fmi3DoStep(void *c, double time, double size, _Bool no_state, _Bool *event, _Bool *end, _Bool *early,
               double *last) {
    (void)no_state;
    *event = *end = *early = 0;
    *last = time + size;
    return step(c, time);
}
