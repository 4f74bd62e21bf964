/* The crane in C as a unit: commands of the valves to pose, speeds and swing. cs_unit.h has its numbers. */
#define CS_CRANE_ALONE
#include "cs_crane.h" /* cs_plant.c by the name that is not compiled by itself */

#include "cs_fmu.h"

static const plant_valve valves[COORDINATES] = CS_UNIT_CRANE;
static const double still[4] = {0.0};
static const plant_grapple grapple = CS_UNIT_GRAPPLE;
const size_t cs_unit_size = sizeof(crane_state);

const char *cs_unit_begin(void *state)
{
    crane_begin(state, valves, still, CS_UNIT_STEP_S, CS_UNIT_STEPS);
    return NULL;
}

const char *cs_unit_tick(void *state, int64_t tick, double *value)
{
    crane_state *s = state;
    double *out = &value[1 + CS_UNIT_INPUTS];
    (void)tick;
    for (int32_t i = 0; i < COORDINATES; i++) { set_command(&s->a[i], fmin(fmax(value[1 + i], -1.0), 1.0)); }
    bool over = crane_tick(s, &grapple);
    for (int32_t i = 0; i < COORDINATES; i++) { *out++ = s->a[i].position; }
    for (int32_t i = 0; i < 2; i++) { *out++ = s->x[i]; }
    for (int32_t i = 0; i < COORDINATES; i++) { *out++ = s->a[i].speed; }
    for (int32_t i = 2; i < 4; i++) { *out++ = s->x[i]; }
    return over ? "the grapple swung above the horizontal, where this crane is none" : NULL;
}
