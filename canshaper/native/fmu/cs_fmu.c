/* FMI 3.0, co-simulation, for a unit of cs_fmu.h; made of the standard's text, without its headers.

   A tick runs as soon as a step reaches its time, with the inputs of that step: with steps of whole ticks nothing is
   late. What an importer of this unit has no reason to call is there, and is an error. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cs_fmu.h"

#ifndef FMI3_Export
#ifdef _WIN32
#define FMI3_Export __declspec(dllexport)
#else
#define FMI3_Export __attribute__((visibility("default")))
#endif
#endif
#define SAME_TICK 1e-6 /* part of a tick: what rounding of the times may take */

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL } status;
typedef void (*log_message)(void *environment, status how, const char *category, const char *text);
typedef struct {
    double value[CS_UNIT_VALUES], start_s;
    int64_t ticks;
    void *state, *environment;
    log_message log;
} unit;
static const double starts[CS_UNIT_VALUES] = CS_UNIT_START;

static status wrong(const unit *u, const char *text)
{
    if (u->log != NULL) { u->log(u->environment, ERROR, "logStatusError", text); }
    return ERROR;
}

static status begin(unit *u)
{
    (void)memset(u->state, 0, cs_unit_size);
    (void)memcpy(u->value, starts, sizeof(starts));
    u->ticks = 0;
    const char *why = cs_unit_begin(u->state);
    return (why == NULL) ? OK : wrong(u, why);
}

/* -- life */

FMI3_Export const char *fmi3GetVersion(void) { return "3.0"; }

FMI3_Export status fmi3SetDebugLogging(void *u, bool on, size_t n, const char *const categories[])
{
    (void)u, (void)on, (void)n, (void)categories; /* errors are always reported */
    return OK;
}

FMI3_Export void fmi3FreeInstance(void *instance)
{
    unit *u = instance;
    if (u != NULL) { free(u->state); }
    free(u);
}

FMI3_Export void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                              bool logging, bool events, bool early, const uint32_t required[],
                                              size_t required_n, void *environment, log_message log, void *update)
{
    (void)name, (void)resources, (void)visible, (void)logging, (void)events, (void)early, (void)required;
    (void)required_n, (void)update;
    const unit given = {.environment = environment, .log = log};
    unit *u = calloc(1, sizeof(*u));
    if (u != NULL) {
        *u = given;
        u->state = calloc(1, cs_unit_size);
    }
    bool ok = (u != NULL) && (u->state != NULL);
    if (ok && ((token == NULL) || (strcmp(token, CS_UNIT_TOKEN) != 0))) {
        (void)wrong(u, "instantiationToken: expected that of this modelDescription.xml, got another one");
        ok = false;
    }
    if (!ok || (begin(u) != OK)) {
        fmi3FreeInstance(u);
        u = NULL;
    }
    return u;
}

FMI3_Export status fmi3EnterInitializationMode(void *instance, bool has_tolerance, double tolerance, double start_s,
                                               bool has_stop, double stop_s)
{
    unit *u = instance;
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop_s;
    u->start_s = u->value[0] = start_s;
    return OK;
}

FMI3_Export status fmi3ExitInitializationMode(void *u) { (void)u; return OK; }
FMI3_Export status fmi3Terminate(void *u) { (void)u; return OK; }
FMI3_Export status fmi3Reset(void *u) { return begin(u); }

FMI3_Export status fmi3DoStep(void *instance, double now_s, double step_s, bool no_return, bool *event, bool *ends,
                              bool *early, double *last_s)
{
    unit *u = instance;
    const double tick_s = (double)CS_UNIT_TICK_NS / 1e9;
    const char *why = NULL;
    double end_s = now_s + step_s;
    if (!(step_s > 0.0) || !isfinite(end_s)) { why = "communicationStepSize: expected more than 0 s"; }
    if (!(fabs(now_s - u->value[0]) <= (SAME_TICK * tick_s))) {
        why = "currentCommunicationPoint: expected the end of the last step";
    }
    (void)no_return;
    while ((why == NULL) && ((u->start_s + ((double)u->ticks * tick_s)) < (end_s - (SAME_TICK * tick_s)))) {
        why = cs_unit_tick(u->state, u->ticks, u->value);
        u->ticks++;
    }
    if (why == NULL) { u->value[0] = end_s; }
    *event = *ends = *early = false;
    *last_s = u->value[0];
    return (why == NULL) ? OK : wrong(u, why);
}

/* -- values */

#define GET_AND_SET(name, type)                                                                                      \
    FMI3_Export status fmi3Get##name(void *instance, const uint32_t *reference, size_t n, type *value, size_t value_n) \
    {                                                                                                                \
        const unit *u = instance;                                                                                    \
        status how = OK;                                                                                             \
        for (size_t i = 0; (i < n) && (how == OK); i++) {                                                            \
            if ((n != value_n) || (reference[i] >= CS_UNIT_VALUES)) { how = wrong(u, "no such variable"); }          \
            else { value[i] = (type)u->value[reference[i]]; }                                                        \
        }                                                                                                            \
        return how;                                                                                                  \
    }                                                                                                                \
    FMI3_Export status fmi3Set##name(void *instance, const uint32_t *reference, size_t n, const type *value,         \
                                     size_t value_n)                                                                 \
    {                                                                                                                \
        unit *u = instance;                                                                                          \
        status how = OK;                                                                                             \
        for (size_t i = 0; (i < n) && (how == OK); i++) {                                                            \
            bool input = (n == value_n) && (reference[i] > 0u) && (reference[i] <= CS_UNIT_INPUTS);                  \
            if (!input) { how = wrong(u, "expected an input"); }                                                     \
            else if (!isfinite((double)value[i])) { how = wrong(u, "expected a finite number"); }                    \
            else { u->value[reference[i]] = (double)value[i]; }                                                      \
        }                                                                                                            \
        return how;                                                                                                  \
    }
GET_AND_SET(Float64, double)
GET_AND_SET(Int64, int64_t)
GET_AND_SET(Boolean, bool)

/* -- what this unit does not have: importers look for every name, and modelDescription.xml says what may be called */

#define ABSENT(name) FMI3_Export status fmi3##name(void *u) { return wrong(u, "fmi3" #name ": this unit has none"); }
#define NO_INSTANCE(name) FMI3_Export void *fmi3Instantiate##name(void) { return NULL; }
#define ABSENT_TYPE(name) ABSENT(Get##name) ABSENT(Set##name)
NO_INSTANCE(ModelExchange) NO_INSTANCE(ScheduledExecution)
ABSENT_TYPE(Float32) ABSENT_TYPE(Int8) ABSENT_TYPE(UInt8) ABSENT_TYPE(Int16) ABSENT_TYPE(UInt16) ABSENT_TYPE(Int32)
ABSENT_TYPE(UInt32) ABSENT_TYPE(UInt64) ABSENT_TYPE(String) ABSENT_TYPE(Binary) ABSENT_TYPE(Clock)
ABSENT_TYPE(IntervalDecimal) ABSENT_TYPE(IntervalFraction) ABSENT_TYPE(ShiftDecimal) ABSENT_TYPE(ShiftFraction)
ABSENT_TYPE(FMUState) ABSENT_TYPE(ContinuousStates)
ABSENT(FreeFMUState) ABSENT(SerializedFMUStateSize) ABSENT(SerializeFMUState) ABSENT(DeserializeFMUState)
ABSENT(GetNumberOfVariableDependencies) ABSENT(GetVariableDependencies) ABSENT(GetDirectionalDerivative)
ABSENT(GetAdjointDerivative) ABSENT(EnterConfigurationMode) ABSENT(ExitConfigurationMode) ABSENT(EnterEventMode)
ABSENT(EvaluateDiscreteStates) ABSENT(UpdateDiscreteStates) ABSENT(EnterStepMode) ABSENT(GetOutputDerivatives)
ABSENT(EnterContinuousTimeMode) ABSENT(CompletedIntegratorStep) ABSENT(SetTime) ABSENT(GetContinuousStateDerivatives)
ABSENT(GetEventIndicators) ABSENT(GetNominalsOfContinuousStates) ABSENT(GetNumberOfEventIndicators)
ABSENT(GetNumberOfContinuousStates) ABSENT(ActivateModelPartition)
