/* A crane that is not ours, by hand: FMI 2.0 without a header. Each axis follows its command with deadband and lag; a point mass
   hangs on a rope of another length in each plane. Semi-implicit Euler in steps of 1 ms. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>

enum { SLEW, NEAR, LIFT, VALUES = 13 };
static const double full[3] = {0.5, 1.0, 0.8}, rope_m[2] = {1.38, 1.2}, g = 9.81, lag_s = 0.1, dead = 0.05, h = 0.001;
typedef struct { double v[VALUES]; } crane; /* commands, positions, speeds, swings across and along, their rates */
#ifndef FAILS_AT
#define FAILS_AT 1e9
#endif
#define OK 0
#define ERROR 3
#define STUB(name, arguments) int fmi2##name arguments { (void)c; return ERROR; }

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const *names) { (void)c; (void)on; (void)n; (void)names; return OK; }
void *fmi2Instantiate(const char *name, int type, const char *guid, const char *where, const void *functions, int seen, int log)
{
    (void)name; (void)type; (void)guid; (void)where; (void)functions; (void)seen; (void)log;
    crane *c = calloc(1, sizeof *c);
    c->v[3 + NEAR] = 3.0;
    c->v[3 + LIFT] = 4.0;
    return c;
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int t, double e, double start, int s, double stop) { (void)c; (void)t; (void)e; (void)start; (void)s; (void)stop; return OK; }
int fmi2EnterInitializationMode(void *c) { (void)c; return OK; }
int fmi2ExitInitializationMode(void *c) { (void)c; return OK; }
int fmi2Terminate(void *c) { (void)c; return OK; }
STUB(Reset, (void *c))
int fmi2GetReal(void *c, const unsigned *at, size_t n, double *out)
{
    for (size_t i = 0; i < n; i++) { out[i] = ((crane *)c)->v[at[i]]; }
    return OK;
}
int fmi2SetReal(void *c, const unsigned *at, size_t n, const double *in)
{
    for (size_t i = 0; i < n; i++) { ((crane *)c)->v[at[i]] = in[i]; }
    return OK;
}
int fmi2DoStep(void *instance, double now, double step, int prior)
{
    double *v = ((crane *)instance)->v, *x = v + 3, *dx = v + 6, *swing = v + 9, *rate = v + 11;
    (void)prior;
    if (now > FAILS_AT) { return ERROR; }
    for (long k = lround(step / h); k > 0; k--) {
        double a[3];
        for (int i = 0; i < 3; i++) {
            double opened = fmax(fabs(v[i]) - dead, 0.0) / (1.0 - dead);
            a[i] = (full[i] * copysign(opened, v[i]) - dx[i]) / lag_s;
            dx[i] += h * a[i];
            x[i] += h * dx[i];
        }
        double push[2] = {-(x[NEAR] * a[SLEW] + 2.0 * dx[NEAR] * dx[SLEW]), a[NEAR] - x[NEAR] * dx[SLEW] * dx[SLEW]};
        for (int i = 0; i < 2; i++) {
            rate[i] += h * ((push[i] * cos(swing[i]) - g * sin(swing[i])) / rope_m[i] - 0.2 * rate[i]);
            swing[i] += h * rate[i];
        }
    }
    return OK;
}
STUB(GetInteger, (void *c)) STUB(GetBoolean, (void *c)) STUB(GetString, (void *c)) STUB(SetInteger, (void *c))
STUB(SetBoolean, (void *c)) STUB(SetString, (void *c)) STUB(GetFMUstate, (void *c)) STUB(SetFMUstate, (void *c))
STUB(FreeFMUstate, (void *c)) STUB(SerializedFMUstateSize, (void *c)) STUB(SerializeFMUstate, (void *c))
STUB(DeSerializeFMUstate, (void *c)) STUB(GetDirectionalDerivative, (void *c)) STUB(SetRealInputDerivatives, (void *c))
STUB(GetRealOutputDerivatives, (void *c)) STUB(CancelStep, (void *c)) STUB(GetStatus, (void *c))
STUB(GetRealStatus, (void *c)) STUB(GetIntegerStatus, (void *c)) STUB(GetBooleanStatus, (void *c))
STUB(GetStringStatus, (void *c))
