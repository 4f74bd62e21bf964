/* One axis: its state machine, its filter and its output stage, tick by tick. */
#include "cs_internal.h"

#define MOST_HELD 2000     /* missed ticks that filter and model go through at most */
#define UNATTENDED_TICKS 3 /* beyond the tail until an axis counts as unattended */

void cs_axis_init(cs_axis *a, const cs_axis_config *c)
{
    a->state = CS_NEUTRAL_WAIT;
    a->reason = CS_START;
    a->was_enabled = true; /* a switch that is on at the start was not pressed */
    a->was_reset = true;
    a->side = 1;
    a->left = c->small_most;
    a->added_left = c->added_ticks;
    a->demanded.low_n = c->tail + 1;
    a->demanded.high_n = c->tail + 1;
    a->trip = CS_NONE;
    a->foreign_ns = CS_NEVER;
}

/* Count the time in which a motion moves the axis, and say whether it may do so now. */
static bool may_add(cs_axis *a, const cs_axis_config *c, int32_t ticks)
{
    if (a->commanded) { a->added_left = c->added_ticks; }
    else if (a->out.steps != 0) { a->added_left = cs_later(a->added_left, -ticks); }
    else { /* an axis that stands uses up no time */ }
    return a->asked && (a->added_left > 0);
}

static void entered(cs_axis *a, const cs_axis_config *c, int32_t old)
{
    cs_transfer_entered(a, old);
    bool cut = cs_moves(old) && !cs_moves(a->state) && a->commanded;
    if (a->state != CS_ACTIVE) { a->left = -CS_INFINITY; } /* the filter no longer shapes the stroke */
    if (cut || ((a->state == CS_ACTIVE) && (old == CS_BYPASS_ON))) { a->no_run_on = c->tail; }
}

/* Trip for a filter that gave no number; the model starts again, it may be spoilt too. */
static void fail(cs_axis *a, const cs_axis_config *c)
{
    if (a->state != CS_TRIPPED) {
        a->state = CS_TRIPPED;
        a->reason = CS_OUTPUT_INVALID;
    }
    a->offset = 0;
    if (a->commanded) { a->no_run_on = c->tail; }
    cs_output_rest(a, c);
    a->command = 0;
    a->angle = 0;
    a->rate = 0;
}

/* Take the input of a tick, and find the output; the valve frame can leave then. */
void cs_axis_act(cs_axis *a, const cs_axis_config *c, const cs_input *in)
{
    int32_t old = a->state;
    cs_real size = CS_ABS(in->command);
    bool adds = false; /* whether the motion may add */
    a->asked = false;
    if (c->largest_added != 0) {
        a->rested = (size > c->neutral_band) ? 0 : cs_later(a->rested, 1);
        a->unattended = a->rested > (c->tail + UNATTENDED_TICKS);
        a->asked = !in->bypass && (a->added != 0);
        adds = may_add(a, c, 1);
    }
    cs_states_step(a, c, in, (a->out.steps == 0) && !a->commanded, adds);
    if (a->state != old) { entered(a, c, old); }
    bool ok = true;
    cs_real demand = 0;
    if ((a->state == CS_ACTIVE) || (a->state == CS_BYPASS_ON)) {
        ok = size < CS_INFINITY; /* it would stay in the memory of the filter */
        demand = (ok && (size > c->neutral_band)) ? in->command : CS_R(0);
    } else if ((a->state == CS_STOPPING) && (size > c->neutral_band)) { cs_output_stop_against(a, c, in->command); }
    else { /* nothing is demanded */ }
    if (ok) {
        cs_real path = (adds && (a->state == CS_ACTIVE)) ? a->added : CS_R(0);
        a->command = demand;
        cs_real reference = cs_reference(a, c, demand, path);
        if (cs_moves(a->state)) { ok = cs_output_drive(a, c, demand, reference, path); }
        else {
            cs_output_rest(a, c);
            a->offset = 0;
        }
    }
    if (!ok) { fail(a, c); }
}

/* Let the sway model swing with the output of cs_axis_act. */
void cs_axis_advance(cs_axis *a, const cs_axis_config *c)
{
    if (c->sways) { cs_sway_step(&a->angle, &a->rate, c, a->out.applied); }
}

/* Count missed ticks, in which the valve kept the last output. They lengthen nothing; only the ramp
   does not catch up. */
void cs_axis_hold(cs_axis *a, const cs_axis_config *c, int32_t ticks)
{
    cs_real demand;
    (void)cs_within(a->command, -c->maximum, c->maximum, 0, &demand);
    a->stopping = cs_later(a->stopping, ticks);
    cs_output_hold(a, c, demand, ticks);
    a->rested = cs_later(a->rested, ticks);
    a->unattended = a->rested > (c->tail + UNATTENDED_TICKS);
    (void)may_add(a, c, ticks);
    for (int32_t i = 0; (i < ticks) && (i < MOST_HELD); i++) {
        (void)cs_filter_step(a, c, demand);
        cs_axis_advance(a, c);
    }
}
