/* The inner state as a row of numbers, for tests only. */
#include "cs_selftest.h"

#define CS_N(x) ((cs_real)(x))

int32_t cs_inspect_size(void) { return (int32_t)sizeof(cs_controller); }

int32_t cs_inspect_axis(const cs_controller *s, int32_t axis, cs_real *out)
{
    const cs_axis *a = &s->axis[axis];
    const cs_real row[] = {
        CS_N(a->state), CS_N(a->reason), CS_N(a->stopping), CS_N(a->was_enabled), CS_N(a->was_reset),
        a->angle, a->rate, a->twin_angle, a->twin_rate, a->unlimited, a->value, a->slope, a->offset,
        CS_N(a->joins), CS_N(a->bypassed), CS_N(a->out.steps), a->out.setpoint, a->out.path, a->out.applied,
        CS_N(a->commanded), a->command, a->out.ramp, a->out.own_ramp, a->out.carry, a->out.dropped_at, a->ran, a->side,
        a->due, a->left, CS_N(a->no_run_on), CS_N(a->crossed), CS_N(a->added_left), CS_N(a->rested),
        CS_N(a->asked), CS_N(a->unattended), a->recent.low, a->recent.high, a->demanded.low,
        a->demanded.high, a->added};
    const int32_t n = (int32_t)(sizeof(row) / sizeof(row[0]));
    for (int32_t i = 0; i < n; i++) { out[i] = row[i]; }
    return n;
}

int32_t cs_inspect_motion(const cs_controller *s, int32_t motion, cs_real *out)
{
    const cs_motion *m = &s->motion[motion];
    int32_t n = 0;
    out[n++] = m->weight;
    out[n++] = m->has_radius ? m->radius_m : -1;
    for (int32_t i = 0; i < 2; i++) {
        out[n++] = m->moving[i].added;
        out[n++] = m->moving[i].reached;
        out[n++] = m->moving[i].way;
        out[n++] = m->moving[i].ahead_s;
        out[n++] = CS_N(m->moving[i].joins);
    }
    return n;
}
