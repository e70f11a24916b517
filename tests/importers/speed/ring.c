/* A ring of four instances stepped without a master: what its calls cost by themselves.
 *
 * ring LIBRARY STEPS ROUNDS
 * In each step the input of every instance is set to the output of the one before it, all step by 1 ms, and
 * all outputs are read, as a master in Jacobi order does. Prints the seconds of each round, a line each, then
 * the last outputs. FMI 2.0. */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define PARTS 4

typedef int Status;
typedef void *Component;

static void *symbol(void *library, const char *name) {
    void *found = dlsym(library, name);
    if (!found) {
        fprintf(stderr, "%s\n", dlerror());
        exit(1);
    }
    return found;
}

int main(int count, char **arguments) {
    void *library = count == 4 ? dlopen(arguments[1], RTLD_NOW | RTLD_LOCAL) : NULL;
    if (!library) {
        fprintf(stderr, "ring LIBRARY STEPS ROUNDS\n");
        return 1;
    }
    Component (*instantiate)(const char *, int, const char *, const char *, const void *, int, int);
    Status (*get)(Component, const unsigned *, size_t, double *);
    Status (*set)(Component, const unsigned *, size_t, const double *);
    Status (*step)(Component, double, double, int);
    *(void **)&instantiate = symbol(library, "fmi2Instantiate");
    *(void **)&get = symbol(library, "fmi2GetReal");
    *(void **)&set = symbol(library, "fmi2SetReal");
    *(void **)&step = symbol(library, "fmi2DoStep");
    long steps = atol(arguments[2]), rounds = atol(arguments[3]);
    const unsigned y = 0, u = 1;
    double outputs[PARTS], *rows = malloc(sizeof(double) * steps * (PARTS + 1));
    for (long round = 0; round < rounds; round++) {
        Component parts[PARTS];
        for (int k = 0; k < PARTS; k++) {
            outputs[k] = k;
            parts[k] = instantiate("part", 1, "", "", NULL, 0, 0);
            if (set(parts[k], &y, 1, &outputs[k])) return 1;
        }
        struct timespec begin, end;
        clock_gettime(CLOCK_MONOTONIC, &begin);
        for (long tick = 0; tick < steps; tick++) {
            double *row = rows + tick * (PARTS + 1);
            row[0] = tick * 1e-3;
            for (int k = 0; k < PARTS; k++) row[k + 1] = outputs[k];
            for (int k = 0; k < PARTS; k++)
                if (set(parts[k], &u, 1, &outputs[(k + PARTS - 1) % PARTS])) return 1;
            for (int k = 0; k < PARTS; k++)
                if (step(parts[k], row[0], 1e-3, 1)) return 1;
            for (int k = 0; k < PARTS; k++)
                if (get(parts[k], &y, 1, &outputs[k])) return 1;
        }
        clock_gettime(CLOCK_MONOTONIC, &end);
        printf("%.9f\n", end.tv_sec - begin.tv_sec + 1e-9 * (end.tv_nsec - begin.tv_nsec));
    }
    const double *last = rows + (steps - 1) * (PARTS + 1);
    for (int k = 0; k < PARTS; k++) printf("%.17g\n", last[k + 1]);
    return 0;
}
