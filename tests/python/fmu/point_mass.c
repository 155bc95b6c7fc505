/* An FMU to test with: a point mass that is pulled and resisted. FMI 2, or 3 with -DFMI=3; model
 * exchange and co-simulation in one.
 * Variables: 0 force, 1 mass (tunable), 2 speed, 3 acceleration, 4 drag per speed. */
#include <stdlib.h>
#include <string.h>

typedef struct {
    double value[5];
} Car;

static void refresh(Car *c) {
    c->value[3] = (c->value[0] - c->value[4] * c->value[2]) / c->value[1];
}

static Car *make(void) {
    Car *c = calloc(1, sizeof *c);
    c->value[1] = 1000.0;
    c->value[2] = 10.0;
    c->value[4] = 50.0;
    refresh(c);
    return c;
}

static void put(Car *c, const unsigned *which, size_t n, const double *values) {
    for (size_t i = 0; i < n; ++i) c->value[which[i]] = values[i];
    refresh(c);
}

static void take(const Car *c, const unsigned *which, size_t n, double *values) {
    for (size_t i = 0; i < n; ++i) values[i] = c->value[which[i]];
}

static void advance(Car *c, double step) {
    for (int i = 0; i < 10; ++i) {
        refresh(c);
        c->value[2] += 0.1 * step * c->value[3];
    }
    refresh(c);
}

#define API __attribute__((visibility("default")))

API int TAG(SetTime)(Car *c, double t) { return (void)c, (void)t, 0; }
API int TAG(SetContinuousStates)(Car *c, const double *x, size_t n) {
    (void)n;
    c->value[2] = x[0];
    refresh(c);
    return 0;
}
API int TAG(GetContinuousStates)(Car *c, double *x, size_t n) {
    (void)n;
    x[0] = c->value[2];
    return 0;
}
API int TAG(EnterContinuousTimeMode)(Car *c) { return (void)c, 0; }
API int TAG(EnterEventMode)(Car *c) { return (void)c, 0; }
API int TAG(ExitInitializationMode)(Car *c) { return (void)c, 0; }
API int TAG(Terminate)(Car *c) { return (void)c, 0; }
API void TAG(FreeInstance)(Car *c) { free(c); }

#if FMI == 2
API Car *fmi2Instantiate(const char *name, int type, const char *id, const char *place,
                         const void *callbacks, int visible, int logging) {
    (void)name, (void)type, (void)id, (void)place, (void)callbacks, (void)visible, (void)logging;
    return make();
}
API int fmi2SetupExperiment(Car *c, int a, double b, double t, int d, double e) {
    return (void)c, (void)a, (void)b, (void)t, (void)d, (void)e, 0;
}
API int fmi2EnterInitializationMode(Car *c) { return (void)c, 0; }
API int fmi2SetReal(Car *c, const unsigned *r, size_t n, const double *v) {
    return put(c, r, n, v), 0;
}
API int fmi2GetReal(Car *c, const unsigned *r, size_t n, double *v) { return take(c, r, n, v), 0; }
API int fmi2GetDerivatives(Car *c, double *x, size_t n) {
    (void)n;
    x[0] = c->value[3];
    return 0;
}
API int fmi2NewDiscreteStates(Car *c, void *info) { return (void)c, memset(info, 0, 20), 0; }
API int fmi2CompletedIntegratorStep(Car *c, int keep, int *event, int *end) {
    (void)c, (void)keep;
    *event = *end = 0;
    return 0;
}
API int fmi2DoStep(Car *c, double t, double step, int keep) {
    (void)t, (void)keep;
    return advance(c, step), 0;
}
API int fmi2GetFMUstate(Car *c, Car **s) { return *s = memcpy(malloc(sizeof *c), c, sizeof *c), 0; }
API int fmi2SetFMUstate(Car *c, Car *s) { return memcpy(c, s, sizeof *c), 0; }
API int fmi2FreeFMUstate(Car *c, Car **s) { return (void)c, free(*s), *s = 0, 0; }
API int fmi2SerializedFMUstateSize(Car *c, Car *s, size_t *n) {
    return (void)c, (void)s, *n = sizeof *c, 0;
}
API int fmi2SerializeFMUstate(Car *c, Car *s, char *bytes, size_t n) {
    return (void)c, memcpy(bytes, s, n), 0;
}
API int fmi2DeSerializeFMUstate(Car *c, const char *bytes, size_t n, Car **s) {
    return (void)c, *s = memcpy(malloc(n), bytes, n), 0;
}
#else
#include <stdbool.h>
API Car *fmi3InstantiateModelExchange(const char *name, const char *id, const char *place,
                                      bool visible, bool logging, void *env, void *log) {
    (void)name, (void)id, (void)place, (void)visible, (void)logging, (void)env, (void)log;
    return make();
}
API Car *fmi3InstantiateCoSimulation(const char *name, const char *id, const char *place,
                                     bool visible, bool logging, bool events, bool early,
                                     const unsigned *r, size_t n, void *env, void *log,
                                     void *update) {
    (void)name, (void)id, (void)place, (void)visible, (void)logging, (void)events, (void)early;
    (void)r, (void)n, (void)env, (void)log, (void)update;
    return make();
}
API int fmi3EnterInitializationMode(Car *c, bool a, double b, double t, bool d, double e) {
    return (void)c, (void)a, (void)b, (void)t, (void)d, (void)e, 0;
}
API int fmi3SetFloat64(Car *c, const unsigned *r, size_t n, const double *v, size_t m) {
    (void)m;
    return put(c, r, n, v), 0;
}
API int fmi3GetFloat64(Car *c, const unsigned *r, size_t n, double *v, size_t m) {
    (void)m;
    return take(c, r, n, v), 0;
}
API int fmi3GetContinuousStateDerivatives(Car *c, double *x, size_t n) {
    (void)n;
    x[0] = c->value[3];
    return 0;
}
API int fmi3UpdateDiscreteStates(Car *c, bool *a, bool *b, bool *d, bool *e, bool *f, double *t) {
    (void)c;
    *a = *b = *d = *e = *f = false;
    *t = 0.0;
    return 0;
}
API int fmi3CompletedIntegratorStep(Car *c, bool keep, bool *event, bool *end) {
    (void)c, (void)keep;
    *event = *end = false;
    return 0;
}
API int fmi3DoStep(Car *c, double t, double step, bool keep, bool *event, bool *end, bool *early,
                   double *last) {
    (void)keep;
    *event = *end = *early = false;
    *last = t + step;
    return advance(c, step), 0;
}
API int fmi3GetFMUState(Car *c, Car **s) { return *s = memcpy(malloc(sizeof *c), c, sizeof *c), 0; }
API int fmi3SetFMUState(Car *c, Car *s) { return memcpy(c, s, sizeof *c), 0; }
API int fmi3FreeFMUState(Car *c, Car **s) { return (void)c, free(*s), *s = 0, 0; }
API int fmi3SerializedFMUStateSize(Car *c, Car *s, size_t *n) {
    return (void)c, (void)s, *n = sizeof *c, 0;
}
API int fmi3SerializeFMUState(Car *c, Car *s, char *bytes, size_t n) {
    return (void)c, memcpy(bytes, s, n), 0;
}
API int fmi3DeserializeFMUState(Car *c, const char *bytes, size_t n, Car **s) {
    return (void)c, *s = memcpy(malloc(n), bytes, n), 0;
}
#endif
