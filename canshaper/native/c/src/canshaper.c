/* The controller: frames in, frames out, without a bus and without a clock. */
#include <string.h>

#include "cs_internal.h"

/* A late tick weighs five, a punctual one takes one away; at the limit it is an overrun, to 0. */
#define LATE_WEIGHT 5
#define LATE_LIMIT 50
/* So long another sender has to be silent before a trip for it can be reset. */
#define FOREIGN_NS 1000000000

void cs_init(cs_controller *s, const cs_config *c)
{
    (void)memset(s, 0, sizeof(*s));
    for (int32_t i = 0; i < c->joysticks_n; i++) { cs_joystick_init(&s->joystick[i], &c->joystick[i]); }
    for (int32_t i = 0; i < c->valves_n; i++) { (void)memcpy(s->valve[i].data, c->valve[i].start, CS_BYTES); }
    for (int32_t i = 0; i < c->axes_n; i++) { cs_axis_init(&s->axis[i], &c->axis[i]); }
    for (int32_t i = 0; i < c->motions_n; i++) {
        cs_message_init(&s->motion[i].message);
        s->motion[i].weight = 1;
        s->motion[i].measured_ns = CS_NEVER;
    }
    s->last = -1;
    s->able = cs_arithmetic();
}

/* A frame with the id of a valve came from someone else: its axes trip. */
static void foreign_sender(cs_controller *s, const cs_config *c, int32_t valve, int64_t now_ns)
{
    for (int32_t i = 0; i < c->axes_n; i++) {
        if (c->axis[i].valve == valve) {
            if (s->axis[i].trip == CS_NONE) { s->axis[i].trip = CS_SECOND_SENDER; }
            s->axis[i].foreign_ns = now_ns;
        }
    }
}

void cs_receive(cs_controller *s, const cs_config *c, int32_t bus, uint32_t id, bool extended, const uint8_t *data,
                int32_t length, int64_t arrived_ns)
{
    for (int32_t i = 0; i < c->joysticks_n; i++) {
        if (cs_message_is(&c->joystick[i].message, bus, id, extended, length)) {
            cs_joystick_receive(&s->joystick[i], &c->joystick[i], data, arrived_ns);
        }
    }
    for (int32_t i = 0; i < c->motions_n; i++) {
        if (c->motion[i].measured && cs_message_is(&c->motion[i].message, bus, id, extended, length)) {
            cs_radius_receive(&s->motion[i], &c->motion[i], data, arrived_ns);
        }
    }
    for (int32_t i = 0; i < c->valves_n; i++) {
        const cs_valve_config *v = &c->valve[i];
        if ((v->bus == bus) && (v->id == id) && (v->extended == extended)) { foreign_sender(s, c, i, arrived_ns); }
    }
}

static void trip_in_motion(cs_axis *a, int32_t reason)
{
    if (cs_moves(a->state)) { a->trip = reason; }
}

void cs_send_failed(cs_controller *s, const cs_config *c, int32_t valve)
{
    for (int32_t i = 0; i < c->axes_n; i++) {
        if (c->axis[i].valve == valve) { trip_in_motion(&s->axis[i], CS_SEND_FAILED); }
    }
}

/* Whether the loop stood still for too long since the last tick, or no one knows for how long: the clock stood, went
   back, or disagrees with missed. Late by a tick or more is missed, so both ends of the gap move by less than one. */
static bool stood_still(const cs_controller *s, const cs_config *c, int64_t now_ns, uint64_t missed)
{
    uint64_t gap_ns = (uint64_t)now_ns - (uint64_t)s->now_ns; /* back is very far ahead */
    uint64_t tick_ns = (uint64_t)c->tick_ns;
    bool counted = (gap_ns > (missed * tick_ns)) && (gap_ns < ((missed + 2u) * tick_ns));
    return (s->last >= 0) && !(counted && (gap_ns <= (uint64_t)c->longest_gap_ns));
}

/* Trip axes that move; the others lose their input until it comes again. */
static void stalled(cs_controller *s, const cs_config *c)
{
    for (int32_t i = 0; i < c->axes_n; i++) {
        s->axis[i].invalid = true;
        trip_in_motion(&s->axis[i], CS_LOOP_STALLED);
    }
}

static int64_t earlier(int64_t a_ns, int64_t b_ns) { return (b_ns < a_ns) ? b_ns : a_ns; }

static void date(cs_message *m, int64_t now_ns, bool stood)
{
    m->received_ns = stood ? CS_NEVER : earlier(m->received_ns, now_ns);
    m->refused_ns = earlier(m->refused_ns, now_ns);
    if (stood) { m->last_frame_ns = CS_NEVER; } /* the age between two frames is by their own times */
}

/* A frame that came after now counts as one of now: it ages from here. After a standstill none counts any more. */
static void date_all(cs_controller *s, const cs_config *c, int64_t now_ns, bool stood)
{
    for (int32_t i = 0; i < c->axes_n; i++) { s->axis[i].foreign_ns = earlier(s->axis[i].foreign_ns, now_ns); }
    for (int32_t i = 0; i < c->joysticks_n; i++) {
        cs_joystick *j = &s->joystick[i];
        date(&j->message, now_ns, stood);
        for (int32_t k = 0; k < c->joystick[i].numbers_n; k++) { j->changed_ns[k] = earlier(j->changed_ns[k], now_ns); }
    }
    for (int32_t i = 0; i < c->motions_n; i++) {
        cs_motion *m = &s->motion[i];
        date(&m->message, now_ns, stood);
        m->measured_ns = stood ? CS_NEVER : earlier(m->measured_ns, now_ns);
    }
}

/* Count late ticks against punctual ones; whether too many were late. */
static bool overrun(cs_controller *s, bool late)
{
    int32_t most = ((s->late + LATE_WEIGHT) > LATE_LIMIT) ? LATE_LIMIT : (s->late + LATE_WEIGHT);
    int32_t least = (s->late > 0) ? (s->late - 1) : 0;
    s->late = late ? most : least;
    s->overrun = (s->overrun || (s->late == LATE_LIMIT)) && (s->late > 0);
    return s->overrun;
}

/* The input of an axis, with what objects to it. */
static cs_input input_of(cs_controller *s, const cs_config *c, int32_t axis, int64_t now_ns, bool late)
{
    const cs_axis_config *ac = &c->axis[axis];
    cs_axis *a = &s->axis[axis];
    const cs_joystick *j = &s->joystick[ac->joystick];
    cs_input in = cs_joystick_command(j, &c->joystick[ac->joystick], ac, now_ns, a->releases);
    a->releases = j->releases;
    if (a->foreign_ns != CS_NEVER) {
        if (!cs_fresh(a->foreign_ns, now_ns, FOREIGN_NS)) { a->foreign_ns = CS_NEVER; }
        else if (a->trip == CS_NONE) { a->trip = CS_SECOND_SENDER; }
        else { /* an earlier cause */ }
    }
    in.trip = s->able ? a->trip : CS_OUTPUT_INVALID;
    a->trip = CS_NONE;
    if (a->invalid) {
        a->invalid = false;
        if (in.enabled || !cs_moves(a->state)) { /* a release is more than a fault */
            in.fault = CS_JOYSTICK_TIMEOUT;
            in.enabled = true;
            in.bypass = false;
        }
    }
    /* late ticks spoil a filter; in bypass there is none, and the driver keeps the axis */
    if (late && (a->state != CS_BYPASS_ON) && in.enabled && (in.fault == CS_NONE)) {
        in.fault = CS_LOOP_OVERRUN;
        in.bypass = false;
    }
    return in;
}

/* Run an axis that is due; whether it has given a frame. */
static bool run(cs_controller *s, const cs_config *c, int32_t axis, int64_t now_ns, bool late, cs_frame *out)
{
    const cs_axis_config *ac = &c->axis[axis];
    const cs_valve_config *vc = &c->valve[ac->valve];
    cs_axis *a = &s->axis[axis];
    cs_valve *v = &s->valve[ac->valve];
    cs_input in = input_of(s, c, axis, now_ns, late);
    int32_t old = a->state;
    cs_axis_act(a, ac, &in);
    cs_field_write(&ac->setpoint, v->data, ac->zero + (ac->sign * a->out.steps));
    if (ac->sends) { /* the last axis of its valve's message */
        if (vc->counts > 0) {
            v->count = (v->count + 1) % vc->counts;
            cs_field_write(&vc->counter, v->data, v->count);
        }
        *out = (cs_frame){vc->id, vc->bus, vc->length, vc->extended, {0}};
        (void)memcpy(out->data, v->data, CS_BYTES);
    }
    cs_axis_advance(a, ac);
    if ((a->state == CS_TRIPPED) && (old != CS_TRIPPED)) { cs_motion_tripped(s, c, axis); }
    return ac->sends;
}

int32_t cs_tick(cs_controller *s, const cs_config *c, int64_t now_ns, int32_t missed, cs_frame *out)
{
    int64_t last = s->last;
    int64_t more = (missed > 0) ? missed : 0;
    int64_t now = last + 1 + more;
    int32_t frames = 0;
    bool stood = stood_still(s, c, now_ns, (uint64_t)more);
    if (stood) { stalled(s, c); }
    date_all(s, c, now_ns, stood);
    s->last = now;
    s->now_ns = now_ns;
    bool late = overrun(s, missed > 0);
    for (int32_t i = 0; (i < c->axes_n) && (missed > 0); i++) {
        int32_t period = c->axis[i].period_ticks;
        int64_t passed = cs_periods(now, period) - cs_periods(last, period);
        if (passed > 1) { cs_axis_hold(&s->axis[i], &c->axis[i], (int32_t)(passed - 1)); }
    }
    for (int32_t i = 0; i < c->motions_n; i++) { cs_motion_step(s, c, i, now_ns, last, now); }
    for (int32_t i = 0; i < c->axes_n; i++) {
        int32_t period = c->axis[i].period_ticks;
        if (cs_periods(now, period) != cs_periods(last, period)) {
            if (run(s, c, i, now_ns, late, &out[frames])) { frames++; }
        }
    }
    return frames;
}
