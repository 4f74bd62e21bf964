/* Output limits: what was demanded within the tail, ramps, the grid of the frame, small strokes. */
#include "cs_internal.h"

#define LEFT CS_R(0.5) /* least steps that may be left over of a small stroke: one more would be too far by as much */

/* -- demands within the tail: the newest tail + 1 of them, in a ring of so many */

static cs_real extreme(const cs_axis *a, const cs_axis_config *c, int32_t n, bool largest)
{
    cs_real most = 0;
    int32_t at = a->demand_at;
    for (int32_t i = 0; i < n; i++) {
        most = largest ? cs_max(most, a->demands[at]) : cs_min(most, a->demands[at]);
        at = (at == 0) ? c->tail : (at - 1);
    }
    return most;
}

static cs_real put(cs_axis *a, const cs_axis_config *c, cs_real demand)
{
    a->demand_at = (a->demand_at >= c->tail) ? 0 : (a->demand_at + 1);
    cs_real leaving = a->demands[a->demand_at];
    a->demands[a->demand_at] = demand;
    return leaving;
}

static void count(cs_extremes *e, const cs_axis_config *c)
{
    e->low_n += (e->low_n <= c->tail) ? 1 : 0;
    e->high_n += (e->high_n <= c->tail) ? 1 : 0;
}

/* Take the newest demand; all are looked at again only where an extreme may have left with the oldest one. */
static void follow(cs_extremes *e, const cs_axis *a, const cs_axis_config *c, cs_real leaving)
{
    cs_real demand = a->demands[a->demand_at];
    cs_real oldest = a->demands[(a->demand_at >= c->tail) ? 0 : (a->demand_at + 1)];
    count(e, c);
    bool again = (demand < e->high) && (a->aged || ((leaving == e->high) && (oldest != e->high)));
    e->high = again ? extreme(a, c, e->high_n, true) : cs_max(e->high, demand);
    again = (demand > e->low) && (a->aged || ((leaving == e->low) && (oldest != e->low)));
    e->low = again ? extreme(a, c, e->low_n, false) : cs_min(e->low, demand);
}

/* Nothing was demanded within the tail; only a motion still counts it. */
void cs_demand_clear(cs_axis *a) { a->recent = (cs_extremes){0, 0, 0, 0}; }

/* The demands of the other direction do not count any more. */
void cs_demand_clear_against(cs_axis *a, cs_real held)
{
    cs_extremes *e = &a->recent;
    *e = (held > 0) ? (cs_extremes){0, e->high, 0, e->high_n} : (cs_extremes){e->low, 0, e->low_n, 0};
}

/* Take the demand of a tick; of an axis at rest only that of the motion. */
void cs_demand_add(cs_axis *a, const cs_axis_config *c, cs_real demand, bool driven)
{
    cs_real leaving = put(a, c, demand);
    if (driven) { follow(&a->recent, a, c, leaving); }
    if (c->largest_added != 0) { follow(&a->demanded, a, c, leaving); }
    a->aged = false;
}

/* Let ticks pass without a demand; the extremes follow with the next one. */
void cs_demand_age(cs_axis *a, const cs_axis_config *c, int32_t ticks)
{
    for (int32_t i = 0; (i < ticks) && (i <= c->tail); i++) {
        (void)put(a, c, 0);
        count(&a->recent, c);
    }
    a->aged = true;
}

/* Range that the operator allows now: never faster than he asks or asked within the tail. */
void cs_allowed_range(const cs_axis *a, const cs_axis_config *c, cs_real *low, cs_real *high)
{
    cs_real least = a->recent.low;
    cs_real most = a->recent.high;
    if (c->allow_faster) {
        least = (least < 0) ? CS_R(-1) : CS_R(0);
        most = (most > 0) ? CS_R(1) : CS_R(0);
    }
    *low = cs_max(c->allow_reverse ? cs_min(least, -most) : least, -c->maximum);
    *high = cs_min(c->allow_reverse ? cs_max(most, -least) : most, c->maximum);
}

/* -- ramp and grid */

/* Move towards a velocity by a rise or a fall at most; what a fall to zero leaves of a tick may rise. */
cs_real cs_rate_limited(cs_real target, cs_real last, const cs_axis_config *c)
{
    cs_real to = (last < 0) ? -target : target;
    cs_real from = (last < 0) ? -last : last;
    cs_real out;
    if (to >= from) { out = cs_min(to, from + c->rise); }
    else if ((to >= 0) || (from > c->fall)) { out = cs_max(to, from - c->fall); }
    else { out = cs_max(to, -c->rise * (1 - (from / c->fall))); }
    return (last < 0) ? -out : out;
}

/* On the line through the two points around a value that lies within the curve. */
static cs_real between(cs_real value, const cs_real *xs, const cs_real *ys, int32_t n)
{
    int32_t k = 1;
    while ((k < (n - 1)) && (xs[k] <= value)) { k++; }
    return ys[k - 1] + (((value - xs[k - 1]) * (ys[k] - ys[k - 1])) / (xs[k] - xs[k - 1]));
}

/* By the curve of a measured valve; beyond what it gives its ends. */
static cs_real by_curve(cs_real value, const cs_real *xs, const cs_real *ys, int32_t n)
{
    cs_real out;
    if (value >= xs[n - 1]) { out = ys[n - 1]; }
    else if (value <= xs[0]) { out = ys[0]; }
    else { out = between(value, xs, ys, n); }
    return out;
}

/* Command for a velocity: the dead band is jumped over. */
static cs_real command_of(const cs_axis_config *c, cs_real velocity)
{
    cs_real out = velocity;
    if (velocity != 0) {
        if (c->curve_n > 0) { out = by_curve(velocity, c->curve_speed, c->curve_command, c->curve_n); }
        else { out = ((1 - c->deadband) * velocity) + ((velocity > 0) ? c->deadband : -c->deadband); }
    }
    return out;
}

/* Velocity that a command gives. */
cs_real cs_velocity(const cs_axis_config *c, cs_real command)
{
    cs_real out = 0; /* within the dead band */
    if (c->curve_n > 0) { out = by_curve(command, c->curve_command, c->curve_speed, c->curve_n); }
    else if (CS_ABS(command) > c->deadband) {
        out = (command - ((command > 0) ? c->deadband : -c->deadband)) / (1 - c->deadband);
    } else { /* as it is */ }
    return out;
}

/* Round the ramp to steps of the frame, half-way to the even one, but never out of the range. */
void cs_on_grid(cs_output *out, const cs_axis_config *c, cs_real low, cs_real high)
{
    int32_t steps = (int32_t)CS_FUNCTION(rint)(command_of(c, out->ramp) * CS_R(c->steps));
    cs_real setpoint = cs_velocity(c, CS_R(steps) / CS_R(c->steps));
    while ((steps != 0) && !((low <= setpoint) && (setpoint <= high))) {
        steps += (steps > 0) ? -1 : 1;
        setpoint = cs_velocity(c, CS_R(steps) / CS_R(c->steps));
    }
    out->steps = (setpoint == 0) ? 0 : steps;
    out->setpoint = (setpoint == 0) ? CS_R(0) : setpoint; /* never -0 */
}

/* -- small strokes: one movement from a tap, which the filter would spread into twitches */

static cs_real forth(const cs_axis_config *c, cs_real target, cs_real due, cs_real most)
{
    bool far = due > (LEFT * c->small_least);
    return far ? cs_max(cs_min(c->small_least, most), cs_min(target, due)) : CS_R(0);
}

cs_real cs_small_stroke(cs_axis *a, const cs_axis_config *c, cs_real command, cs_real target, cs_real low, cs_real high)
{
    cs_real out = target;
    if (command != 0) {
        cs_real clipped = cs_min(cs_max(command, -c->maximum), c->maximum);
        a->due += clipped - a->out.applied;
        a->left -= CS_ABS(clipped);
    } else if ((low == 0) && (high == 0)) {
        a->due = 0;
        a->left = c->small_most;
    } else { /* not of a large stroke, nor where after a reversal there is travel both ways */
        a->due -= a->out.applied;
        if ((a->left >= 0) && (high == 0)) { out = -forth(c, -target, -a->due, -low); }
        if ((a->left >= 0) && (low == 0)) { out = forth(c, target, a->due, high); }
    }
    return out;
}
