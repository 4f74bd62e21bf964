/* The output stage of an axis: from the reference of its filter to the steps of its valve frame.

   1. Range: what the operator allows; the run-on ends where it has gone as far as it may. 2. Small strokes. 3. What a
   motion adds, in a range of its own. 4. Ramp. 5. Grid. Two ramps run side by side: with what is added, and without
   it, where the output goes at once when the motion loses the right to add. */
#include "cs_internal.h"

#define MOST_CARRY CS_R(0.1)
#define NOTHING CS_R(1e-6)

/* How much faster than asked: the own part, or all of it less what may be added. */
static cs_real beyond(const cs_axis *a, const cs_axis_config *c, cs_real held)
{
    cs_real own_asked = cs_max((a->out.own_ramp > 0) ? held : -held, 0);
    cs_real asked = cs_max((a->out.setpoint > 0) ? held : -held, 0);
    cs_real own = CS_ABS(a->out.own_ramp) - own_asked;
    cs_real most = cs_max(own, (CS_ABS(a->out.setpoint) - asked) - c->largest_added);
    return (most > NOTHING) ? most : CS_R(0);
}

/* The joystick is deflected to the other side than last. */
static void reverse(cs_axis *a, cs_real held)
{
    if ((held * a->side) < 0) {
        a->side = -a->side;
        a->crossed = 0;
    }
}

/* End what runs on beyond the joystick where it reaches a limit: after a reversal a time, and always a way, with what
   will be left of it once the axis has fallen. Returns whether the way is at its end. */
static bool end_run_on(cs_axis *a, const cs_axis_config *c, cs_real held)
{
    reverse(a, held);
    if (a->crossed >= c->reversal) { cs_demand_clear_against(a, a->side); }
    a->crossed = cs_later(a->crossed, 1);
    cs_real more = beyond(a, c, held);
    bool over = (a->ran + (((CS_R(0.5) * more) * more) / c->fall_per_s)) > c->run_on;
    if (over) { cs_demand_clear(a); }
    return over;
}

/* Range of the own velocity and the added one together. Against a held joystick: no further than the own velocity;
   where it was commanded within the tail: no faster; where no one commanded: no faster than what may be added. */
static void range_with_added(const cs_axis *a, const cs_axis_config *c, cs_real held, cs_real own, bool no_run_on,
                             cs_real *low_out, cs_real *high_out)
{
    cs_real largest = (a->out.path != 0) ? c->largest_added : CS_R(0);
    cs_real low = a->demanded.low;
    cs_real high = a->demanded.high;
    if (no_run_on) {
        low = (held < 0) ? held : cs_max(low, -largest);
        high = (held > 0) ? held : cs_min(high, largest);
    }
    if (held > 0) { low = 0; }
    else if (held < 0) { high = 0; }
    else {
        low = (low == 0) ? -largest : low;
        high = (high == 0) ? largest : high;
    }
    *low_out = cs_max(cs_min(own, low), -c->maximum);
    *high_out = cs_min(cs_max(own, high), c->maximum);
}

/* Correct a velocity by what rounding has left out before, a step at most; rest stays rest. */
static cs_real with_carry(const cs_axis *a, const cs_axis_config *c, cs_real total, cs_real low, cs_real high)
{
    cs_real step = 1 / CS_R(c->steps);
    cs_real target;
    cs_real carried;
    (void)cs_within(total, low, high, cs_max(c->minimum, CS_R(0.5) * step), &target);
    (void)cs_within(a->out.carry, -step, step, 0, &carried);
    if (target != 0) { (void)cs_within(target + carried, low, high, 0, &target); }
    return target;
}

/* Both ramps, where something is added, or was. False: what is added is no velocity. */
static bool both_ramps(cs_axis *a, const cs_axis_config *c, cs_real held, cs_real own, bool no_run_on, cs_real *low,
                       cs_real *high, cs_real *total)
{
    bool ok = CS_ABS(a->out.path) <= 1;
    cs_real target = own;
    range_with_added(a, c, held, own, no_run_on, low, high);
    if (ok && (a->out.path != 0)) {
        ok = cs_within(own + a->out.path, *low, *high, 0, total);
        target = with_carry(a, c, *total, *low, *high);
    }
    if (ok) {
        a->out.own_ramp = cs_rate_limited(own, a->out.own_ramp, c);
        a->out.ramp = cs_rate_limited(target, a->out.ramp, c);
        if ((a->out.dropped_at * a->out.ramp) < 0) { a->out.ramp = 0; } /* the way to the other side begins at rest */
        a->out.dropped_at = 0;
    }
    return ok;
}

/* Find the output of a tick of a moving axis. False: reference or added velocity are none. */
bool cs_output_drive(cs_axis *a, const cs_axis_config *c, cs_real demand, cs_real reference, cs_real path)
{
    cs_output *out = &a->out;
    bool no_run_on = a->no_run_on > 0;
    if (no_run_on) {
        a->no_run_on--;
        cs_demand_clear(a);
    }
    no_run_on = end_run_on(a, c, demand) || no_run_on;
    cs_demand_add(a, c, demand, true);
    a->commanded = (a->recent.low != 0) || (a->recent.high != 0);
    cs_real low;
    cs_real high;
    cs_real own;
    cs_allowed_range(a, c, &low, &high);
    bool ok = cs_within(reference, low, high, c->minimum, &own);
    if (ok && c->spreads) { own = cs_small_stroke(a, c, demand, own, low, high); }
    cs_real total = own;
    out->path = path;
    if ((path != 0) || (out->own_ramp != out->ramp) || (out->dropped_at != 0)) {
        if (ok) { ok = both_ramps(a, c, demand, own, no_run_on, &low, &high, &total); }
    } else {
        out->ramp = cs_rate_limited(own, out->ramp, c);
        out->own_ramp = out->ramp;
    }
    if (ok) { /* the range may have become smaller, with the ramp on its way back into it */
        cs_on_grid(out, c, cs_min(low, out->ramp), cs_max(high, out->ramp));
        out->applied = out->setpoint - path;
        if (path != 0) { (void)cs_within((out->carry + total) - out->setpoint, -MOST_CARRY, MOST_CARRY, 0, &out->carry); }
        cs_real more = beyond(a, c, demand);
        a->ran = ((more != 0) || (demand == 0)) ? (a->ran + (more * c->tick_s)) : CS_R(0);
    }
    return ok;
}

/* A joystick that is held against a stop ends its run-on by the fall, or after the time of a reversal. */
void cs_output_stop_against(cs_axis *a, const cs_axis_config *c, cs_real held)
{
    reverse(a, held);
    if ((c->reversal == 0) && ((held * a->out.ramp) < 0)) {
        cs_demand_clear(a);
        a->commanded = false;
    }
}

/* Neutral at once, and nothing runs on. */
void cs_output_rest(cs_axis *a, const cs_axis_config *c)
{
    if (a->commanded) {
        cs_demand_clear(a);
        a->commanded = false;
    }
    if (c->largest_added != 0) { cs_demand_add(a, c, 0, false); }
    a->due = 0;
    a->left = c->small_most;
    a->out = (cs_output){0, 0, 0, 0, 0, 0, 0, 0};
    a->no_run_on = cs_later(a->no_run_on, -1);
}

/* Count missed ticks, in which demand and output were held. */
void cs_output_hold(cs_axis *a, const cs_axis_config *c, cs_real demand, int32_t ticks)
{
    cs_demand_age(a, c, ticks);
    a->no_run_on = cs_later(a->no_run_on, -ticks);
    a->crossed = cs_later(a->crossed, ticks);
    a->ran += (beyond(a, c, 0) * CS_R(ticks)) * c->tick_s;
    a->due += CS_R(ticks) * (demand - a->out.applied);
    a->left -= CS_R(ticks) * CS_ABS(demand);
}

/* Back to the own ramp at once, but never faster and not to the other side. */
void cs_output_drop_added(cs_axis *a)
{
    a->out.dropped_at = a->out.ramp;
    (void)cs_within(a->out.own_ramp, cs_min(0, a->out.ramp), cs_max(0, a->out.ramp), 0, &a->out.ramp);
    a->out.carry = 0;
}
