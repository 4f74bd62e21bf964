/* The sway model, the filters, and the transfer to and from bypass without a jump. */
#include "cs_internal.h"

#define OFFSET_NOTHING CS_R(1e-6) /* far below the resolution of any frame */

bool cs_moves(int32_t state) { return (state == CS_ACTIVE) || (state == CS_BYPASS_ON) || (state == CS_STOPPING); }

/* Swing a tick further, in which the velocity was held: increments, so that rest stays rest. */
void cs_sway_step(cs_real *angle, cs_real *rate, const cs_axis_config *c, cs_real velocity)
{
    cs_real before = *angle;
    cs_real swing = *rate + velocity;
    *angle = (before + (c->f11 * before)) + (c->f12 * swing);
    *rate += (c->f21 * before) + (c->f22 * swing);
}

/* Exact sum of the rounded products of taps and commands, rounded once, as math.fsum. From tick to tick only the command
   that a run of equal taps begins with, and the one that it has left, change it. */
static cs_real fir(cs_axis *a, const cs_axis_config *c, cs_real command)
{
    int32_t n = c->taps_n + 1; /* with the command that has left the last run */
    cs_real begins = command;
    a->newest = (a->newest == 0) ? c->taps_n : (a->newest - 1);
    a->history[a->newest] = command;
    for (int32_t i = 0; i < c->runs_n; i++) {
        int32_t at = a->newest + c->runs[i].end;
        cs_real left = a->history[(at < n) ? at : (at - n)];
        if (begins != left) {
            cs_sum_add(&a->sum, c->runs[i].tap * begins);
            cs_sum_add(&a->sum, -c->runs[i].tap * left);
        }
        begins = left;
    }
    return cs_sum_value(&a->sum);
}

/* A FIR; the model is driven by what was sent, its twin by what the FIR asked for: the difference is what limits made. */
static cs_real robust(cs_axis *a, const cs_axis_config *c, cs_real command)
{
    cs_sway_step(&a->twin_angle, &a->twin_rate, c, a->unlimited);
    if ((a->angle == 0) && (a->rate == 0)) { /* never moved, or started again after a fault */
        a->twin_angle = 0;
        a->twin_rate = 0;
    }
    a->unlimited = fir(a, c, command);
    return (a->unlimited - (c->k1 * (a->angle - a->twin_angle))) - (c->k2 * (a->rate - a->twin_rate));
}

/* Limited rate and limited change of it; reachable: fastest slope from which the command can still be met. */
static cs_real s_curve(cs_axis *a, const cs_axis_config *c, cs_real command)
{
    cs_real left = command - a->value;
    cs_real steps = CS_ABS(left) / (c->change * c->tick_s);
    cs_real reachable = (c->change * CS_R(0.5)) * (CS_SQRT(1 + (8 * steps)) - 1);
    cs_real reference = CS_FUNCTION(copysign)(cs_min(c->rate, reachable), left);
    a->slope += cs_min(cs_max(reference - a->slope, -c->change), c->change);
    cs_real step = a->slope * c->tick_s;
    if (((step * left) > 0) && (CS_ABS(step) >= CS_ABS(left)) && (CS_ABS(a->slope) <= c->change)) {
        step = left; /* arrived */
        a->slope = 0;
    }
    a->value += step;
    return a->value;
}

cs_real cs_filter_step(cs_axis *a, const cs_axis_config *c, cs_real command)
{
    cs_real out = command;
    switch (c->kind) {
    case CS_FIR: out = fir(a, c, command); break;
    case CS_ROBUST: out = robust(a, c, command); break;
    case CS_S_CURVE: out = s_curve(a, c, command); break;
    case CS_FIRST_ORDER:
        a->value += c->share * (command - a->value);
        out = a->value;
        break;
    case CS_GFF: /* share is 1 without a third pole */
        a->value += c->share * (command - a->value);
        out = (a->value - (c->k1 * a->angle)) - (c->k2 * (a->rate + a->value));
        break;
    default: break; /* CS_OFF */
    }
    return out;
}

/* What filter or bypass asks for, before limits, without a step where one follows the other. */
cs_real cs_reference(cs_axis *a, const cs_axis_config *c, cs_real demand, cs_real added)
{
    /* a filter that is cut off damps nothing */
    cs_real command = (CS_ABS(demand) > c->maximum) ? CS_FUNCTION(copysign)(c->maximum, demand) : demand;
    cs_real out = cs_filter_step(a, c, command);
    if (a->bypassed) { out = command; }
    if (a->joins) {
        a->joins = false;
        a->offset = (a->out.ramp - out) - added;
    } else if (a->offset != 0) {
        a->offset *= c->fade;
        if (CS_ABS(a->offset) < OFFSET_NOTHING) { a->offset = 0; }
    } else { /* nothing to join */ }
    return out + a->offset;
}

/* A stop goes on with what drove the axis before; from rest there is nothing to join to. */
void cs_transfer_entered(cs_axis *a, int32_t old)
{
    if (a->state != CS_STOPPING) {
        bool bypassed = a->state == CS_BYPASS_ON;
        a->joins = cs_moves(old) && (bypassed != a->bypassed);
        a->bypassed = bypassed;
    }
}
