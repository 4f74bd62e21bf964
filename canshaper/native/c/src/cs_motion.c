/* Slew and near-far as one motion: the tip goes where a grapple on the path of the filters needs it. The formulas, and
   what they mean, stand in docs/decisions.md, two-axis motion. */
#include "cs_internal.h"

#define SLEW 0
#define NEAR_FAR 1
#define MOST_STEP CS_R(0.1)    /* of an added velocity between two ticks */
#define NOTHING CS_R(1e-6)
#define RADIUS_S CS_R(1.0)     /* in which a measured radius corrects the predicted one */
#define FADE_S CS_R(0.2)       /* in which the added part fades when an axis is unable to follow */
#define LEAST_PART CS_R(0.5)   /* of gravity that is left across the boom */
#define LEAST_RADIUS CS_R(0.5) /* of the grapple, m */

/* Path of the grapple: lead of the tip and its rate, speed and acceleration. */
typedef struct { cs_real lead, lead_rate, speed, acceleration; } grapple_path;

/* Both axes of a motion: what changes, numbers, sway model. */
typedef struct { cs_moving *a; const cs_moving_config *c; cs_axis *x; } member;

/* The path at a time from now, the applied velocity held until then. */
static grapple_path path_of(const member *m, cs_real after_s)
{
    const cs_moving_config *c = m->c;
    cs_real after = after_s - m->a->ahead_s;
    cs_real angle = m->x->angle;
    cs_real rate = m->x->rate + m->a->applied;
    cs_real change = -after * ((c->stiffness * angle) + (c->damping * rate));
    angle += after * (rate + (CS_R(0.5) * change));
    rate += change;
    cs_real pull = (c->stiffness * angle) + (c->damping * rate);
    cs_real full = c->full_speed;
    return (grapple_path){full * angle, full * rate, full * (m->a->applied - rate), full * pull};
}

/* Fastest velocity in a direction from which an axis still stops before farthest. */
static cs_real room(const member *m, cs_real sign)
{
    cs_real way = cs_max((m->c->farthest - (sign * m->a->way)) / m->c->full_speed, 0);
    cs_real step = m->c->fall_per_s * m->c->period_s;
    return CS_R(0.5) * (CS_SQRT((step * step) + ((8 * m->c->fall_per_s) * way)) - step);
}

/* Run to a position of the added part within the period; weight below 1: the part fades. */
static void add(const member *m, cs_real target, cs_real weight)
{
    cs_moving *a = m->a;
    cs_real way = m->c->period_s * m->c->full_speed;
    if (a->joins) { /* what was not added before is not made up for */
        a->joins = false;
        a->reached = target;
    }
    cs_real velocity = (weight * (target - a->reached)) / way;
    velocity = cs_max(cs_min(velocity, a->added + MOST_STEP), a->added - MOST_STEP);
    if (m->c->bounded && !a->commanded) { velocity = cs_min(cs_max(velocity, -room(m, -1)), room(m, 1)); }
    velocity = cs_max(cs_min(velocity, 1), -1);
    if (CS_ABS(velocity) >= NOTHING) { /* a velocity that fading leaves out is not added later */
        a->added = velocity;
        a->reached = (weight < 1) ? target : (a->reached + (velocity * way));
    } else { a->added = 0; } /* next to nothing, or no number */
}

/* Add nothing; over: no one commands, so that what comes next is made up for. */
static void rest(cs_motion *m, const cs_motion_config *c, bool over)
{
    m->has_radius = false;
    for (int32_t i = 0; i < ((c->near_far == CS_NONE) ? 1 : 2); i++) {
        m->moving[i].added = 0;
        m->moving[i].reached = 0;
        m->moving[i].joins = !over;
    }
}

/* Read the state of an axis. */
static void update(const member *m, int32_t period, cs_real tick_s, int64_t last, int64_t now)
{
    cs_moving *a = m->a;
    int64_t passed = cs_periods(now, period) - cs_periods(last, period);
    if (passed > 1) { a->reached += (a->added * m->c->full_speed) * (CS_R(passed - 1) * m->c->period_s); } /* it was held */
    a->ahead_s = (passed > 0) ? CS_R(0) : (CS_R(period - (now % period)) * tick_s);
    a->applied = m->x->out.applied;
    a->sent = m->x->out.setpoint;
    a->commanded = m->x->commanded;
    a->able = (m->x->state == CS_READY) || (m->x->state == CS_ACTIVE);
    a->unattended = m->x->unattended;
}

/* Radius of the grapple: carried on by the model of near-far, corrected by the one of the tip. */
static void carry_radius(cs_motion *m, const member *near_far, cs_real elapsed_s, bool has_tip)
{
    cs_real full = near_far->c->full_speed;
    cs_real error = m->value - ((full * near_far->x->angle) + near_far->a->reached); /* radius by the tip, at first */
    if (m->has_radius) {
        m->radius_m -= (full * near_far->x->rate) * elapsed_s;
        error -= m->radius_m;
        if (has_tip) { m->radius_m += error * cs_min(1, elapsed_s / RADIUS_S); }
    } else if (has_tip) {
        m->has_radius = true;
        m->radius_m = error;
    } else { /* not known yet */ }
}

/* Where the tip has to be: its angle ahead of the grapple, and how far out of the place that the filters give. */
static void tip(const member *slew, const member *near_far, const grapple_path *turn, cs_real after_s, cs_real radius_m,
                cs_real *psi, cs_real *way_m)
{
    cs_real across = slew->c->stiffness;
    cs_real along = near_far->c->stiffness;
    grapple_path out = {0, 0, 0, 0}; /* at rest it has no speed, whatever its model has left */
    if (near_far->a->commanded) { out = path_of(near_far, after_s); }
    cs_real radius = cs_max(radius_m + (after_s * out.speed), LEAST_RADIUS);
    /* Coriolis and centripetal acceleration, and their rates for the dampers */
    cs_real turning = ((2 * out.speed) * turn->speed) / radius;
    cs_real turning_rate = ((2 * ((out.acceleration * turn->speed) + (out.speed * turn->acceleration))) / radius) -
                           ((turning * out.speed) / radius);
    cs_real inwards = (radius * turn->speed) * turn->speed;
    cs_real inwards_rate = ((out.speed * turn->speed) * turn->speed) +
                           ((2 * radius) * ((turn->speed * turn->acceleration) - ((across * turn->lead) * turn->lead_rate)));
    cs_real pull_t = radius * (((across * turn->lead) + turning) - (slew->c->lag_s * turning_rate));
    cs_real pull_r = ((along * out.lead) - inwards) + (near_far->c->lag_s * inwards_rate);
    cs_real left = radius * across;
    cs_real bottom = cs_max(left + pull_r, LEAST_PART * left);
    cs_real cosine = bottom / cs_hypot(pull_t, bottom);
    cs_real sine = (pull_t / bottom) * cosine;
    *psi = CS_FUNCTION(atan2)(pull_t, bottom);
    *way_m = (((radius * cosine) + (((pull_r * cosine) + (pull_t * sine)) / along)) - radius) - out.lead;
}

/* Without a radius the grapple stays on its circle, of whatever radius. */
static void add_alone(const member *slew, const member *near_far, cs_real weight)
{
    grapple_path turn = path_of(slew, slew->c->period_s);
    cs_real bottom = cs_max(1 - ((turn.speed * turn.speed) / slew->c->stiffness), LEAST_PART);
    if (slew->a->ahead_s == 0) { add(slew, CS_FUNCTION(atan2)(turn.lead, bottom) - turn.lead, weight); }
    if (near_far->c != slew->c) { add(near_far, near_far->a->reached, 0); }
}

static void add_both(const member *slew, const member *near_far, cs_real radius_m, cs_real path_m, cs_real weight)
{
    cs_real psi;
    cs_real way_m;
    if (slew->a->ahead_s == 0) {
        grapple_path turn = path_of(slew, slew->c->period_s);
        tip(slew, near_far, &turn, slew->c->period_s, radius_m, &psi, &way_m);
        add(slew, psi - turn.lead, weight);
    }
    if (near_far->a->ahead_s == 0) {
        grapple_path turn = path_of(slew, near_far->c->period_s);
        tip(slew, near_far, &turn, near_far->c->period_s, radius_m, &psi, &way_m);
        add(near_far, cs_min(cs_max(way_m, -path_m), path_m), weight);
    }
}

/* Give both axes what they add in this tick. A motion without near-far has slew in its place too. */
void cs_motion_step(cs_controller *s, const cs_config *c, int32_t motion, int64_t now_ns, int64_t last, int64_t now)
{
    const cs_motion_config *mc = &c->motion[motion];
    cs_motion *m = &s->motion[motion];
    int32_t second = (mc->near_far == CS_NONE) ? SLEW : NEAR_FAR;
    int32_t of[2] = {mc->slew, (second == SLEW) ? mc->slew : mc->near_far};
    const member slew = {&m->moving[SLEW], &mc->moving[SLEW], &s->axis[of[SLEW]]};
    const member near_far = {&m->moving[second], &mc->moving[second], &s->axis[of[NEAR_FAR]]};
    cs_real elapsed_s = CS_R(now - last) * mc->tick_s;
    update(&slew, c->axis[of[SLEW]].period_ticks, mc->tick_s, last, now);
    if (second == NEAR_FAR) { update(&near_far, c->axis[of[NEAR_FAR]].period_ticks, mc->tick_s, last, now); }
    bool able = slew.a->able && near_far.a->able;
    bool unattended = slew.a->unattended && near_far.a->unattended;
    if ((m->weight < 1) || !able) {
        cs_real fade = (able ? elapsed_s : -elapsed_s) / FADE_S;
        m->weight = cs_min(cs_max(m->weight + fade, 0), 1);
    }
    if (second == NEAR_FAR) { /* how far it was moved since its operator left it */
        cs_real moved = near_far.a->sent * (near_far.c->full_speed * elapsed_s);
        near_far.a->way = (near_far.a->commanded || unattended) ? CS_R(0) : (near_far.a->way + moved);
    }
    bool commanded = slew.a->commanded || near_far.a->commanded;
    if (!commanded || (m->weight == 0)) { rest(m, mc, !commanded); }
    else {
        bool carried = (second == NEAR_FAR) && (mc->circle_m == 0);
        bool has_tip = mc->measured && cs_fresh(m->measured_ns, now_ns, mc->message.timeout_ns);
        if (carried) { carry_radius(m, &near_far, elapsed_s, has_tip); }
        if ((second == SLEW) || (carried && !m->has_radius)) { add_alone(&slew, &near_far, m->weight); }
        else { add_both(&slew, &near_far, carried ? m->radius_m : mc->circle_m, mc->path_m, m->weight); }
    }
    for (int32_t i = 0; i <= second; i++) {
        s->axis[of[i]].added = m->moving[i].added;
        if (unattended) { s->axis[of[i]].added_left = c->axis[of[i]].added_ticks; }
    }
}

/* An axis has tripped: what a motion of it adds ends at once. */
void cs_motion_tripped(cs_controller *s, const cs_config *c, int32_t axis)
{
    for (int32_t k = 0; k < c->motions_n; k++) {
        const int32_t of[2] = {c->motion[k].slew, c->motion[k].near_far};
        if ((of[0] == axis) || (of[1] == axis)) {
            s->motion[k].weight = 0;
            rest(&s->motion[k], &c->motion[k], false);
            for (int32_t i = 0; (i < 2) && (of[i] != CS_NONE); i++) {
                s->axis[of[i]].added = 0;
                cs_output_drop_added(&s->axis[of[i]]);
            }
        }
    }
}
