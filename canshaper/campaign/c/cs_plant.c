/* The simulated crane of sim/canshaper_sim around the controller: joysticks, valves, a tip that is moved directly, a
   grapple.

   The same operations in the same order as strokes.py, hand.py, valve.py, actuator.py, tip_boom.py and grapple.py, so
   that a drive is equal to the last bit. What is not here (pump, cushions, carrier, wind, contact, log, joints, ropes)
   native.py does not bring here. With CS_CRANE_ALONE it is the crane by itself. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#ifdef CS_CRANE_ALONE
enum { SLEW, NEAR_FAR, LIFT, COORDINATES };
#else
#include "cs_internal.h"
#include "cs_measure.h"
#include "cs_number.h"
#endif

#define PENDING 256 /* changes of a command within the longest dead time, 0.2 s, of ticks of 1 ms */
#define SAME_TIME_S 1e-9
#define PI 0x1.921fb54442d18p+1

/* As `_VALVE` of native.py has them; axis CS_NONE: no valve moves this coordinate. */
typedef struct {
    double dead_time, deadband, negative_more, hysteresis, negative_gain, flow_limit, rate, lag, full_speed, start, low,
        high, nominal;
    int32_t axis, zero, step, full;
} plant_valve;
typedef struct { double l1, l2, m1, m2, c5, c6, g; } plant_grapple;

typedef struct {
    const plant_valve *p;
    double command, played, spool, target, requested, flow_speed, time, due[PENDING], flow[PENDING];
    uint32_t head, end;
    double position, speed, start_acc, middle_acc, end_acc, middle_position, middle_speed;
} actuator;
typedef struct { double radius, radius_rate, radius_acc, slew_rate, slew_acc, height_acc; } tip_motion;

static double flow_of(const plant_valve *p, double command)
{
    double deadband = p->deadband;
    if (command < 0.0) { deadband = fmax(0.0, deadband + p->negative_more); }
    double opening = (fabs(command) - deadband) / (1.0 - deadband);
    if (opening <= 0.0) { return 0.0; }
    double most = p->flow_limit;
    if (command < 0.0) {
        opening *= p->negative_gain;
        most *= fmax(1.0, p->negative_gain);
    }
    return copysign(fmin(opening, most), command);
}

static void move_to(actuator *a, double flow)
{
    a->target = flow;
    if (isinf(a->p->rate)) { a->spool = flow; }
}

static void set_command(actuator *a, double command)
{
    if (command == a->command) { return; }
    a->command = command;
    double half = 0.5 * a->p->hysteresis;
    a->played = fmin(fmax(a->played, command - half), command + half);
    double flow = flow_of(a->p, a->played);
    if (flow == a->requested) { return; }
    a->requested = flow;
    if (a->p->dead_time > 0.0) {
        a->due[a->end % PENDING] = a->time + a->p->dead_time;
        a->flow[a->end % PENDING] = flow;
        a->end++;
    } else { move_to(a, flow); }
}

static void follow(actuator *a, double step_s)
{
    double lag = a->p->lag;
    double gap = a->target - a->spool;
    if (gap == 0.0) {
        a->flow_speed = a->spool + ((a->flow_speed - a->spool) * exp(-step_s / lag));
        return;
    }
    double ramp = copysign(a->p->rate, gap);
    double arrival = gap / ramp;
    double late = ramp * lag;
    double offset = (a->flow_speed - a->spool) + late;
    if (arrival > step_s) {
        a->spool += ramp * step_s;
        a->flow_speed = (a->spool - late) + (offset * exp(-step_s / lag));
        return;
    }
    a->spool = a->target;
    double at_arrival = (a->target - late) + (offset * exp(-arrival / lag));
    a->flow_speed = a->target + ((at_arrival - a->target) * exp((arrival - step_s) / lag));
}

static void pass(actuator *a, double step_s)
{
    double rest = step_s;
    while (a->head != a->end) {
        double wait = a->due[a->head % PENDING] - a->time;
        double flow = a->flow[a->head % PENDING];
        if (wait > (rest + SAME_TIME_S)) { break; }
        a->head++;
        if (wait > SAME_TIME_S) {
            wait = fmin(wait, rest);
            follow(a, wait);
            a->time += wait;
            rest -= wait;
        }
        move_to(a, flow);
    }
    if (rest > 0.0) {
        follow(a, rest);
        a->time += rest;
    }
}

static void advance(actuator *a, double h, double decay)
{
    const plant_valve *p = a->p;
    double start = a->position, start_speed = a->speed, half = 0.5 * h;
    double start_rate = (a->spool - a->flow_speed) / p->lag, middle;
    if ((a->spool == a->target) && (a->head == a->end)) {
        middle = a->spool + ((a->flow_speed - a->spool) * decay);
        a->flow_speed = a->spool + ((middle - a->spool) * decay);
        a->time = (a->time + half) + half;
    } else {
        pass(a, half);
        middle = a->flow_speed;
        pass(a, half);
    }
    double speed = a->flow_speed, end_rate = (a->spool - speed) / p->lag;
    a->start_acc = p->full_speed * start_rate;
    middle *= p->full_speed;
    speed *= p->full_speed;
    double end = start + ((h / 6.0) * ((start_speed + (4.0 * middle)) + speed));
    a->end_acc = p->full_speed * end_rate;
    if ((p->low <= end) && (end <= p->high)) {
        a->middle_acc = 0.25 * ((((6.0 * (speed - start_speed)) / h) - a->start_acc) - a->end_acc);
    } else {
        end = (end < p->low) ? p->low : p->high;
        speed = 0.0;
        middle = 0.25 * (((6.0 * (end - start)) / h) - start_speed);
        a->end_acc = 0.0;
        double travel = (6.0 * (((end - start) / h) - start_speed)) / h;
        double change = (6.0 * (speed - start_speed)) / h;
        a->middle_acc = 0.5 * ((change - a->end_acc) - travel);
        a->start_acc = travel - (2.0 * a->middle_acc);
    }
    a->middle_position = start + ((h / 24.0) * (((5.0 * start_speed) + (8.0 * middle)) - speed));
    a->middle_speed = middle;
    a->position = end;
    a->speed = speed;
}

static void accelerations(const plant_grapple *q, const double *x, const tip_motion *t, double *out)
{
    double s5 = sin(x[0]), c5 = cos(x[0]), s6 = sin(x[1]), c6 = cos(x[1]), r5 = x[2], r6 = x[3];
    double l1 = q->l1, l2 = q->l2, m1 = q->m1, m2 = q->m2, l3 = l1 + l2 * c6;
    double w = t->slew_rate, wa = t->slew_acc, w2 = w * w;
    double radial = t->radius_acc - t->radius * w2;
    double tangential = t->radius * wa + 2.0 * t->radius_rate * w;
    double weight = t->height_acc + q->g;
    double inertia5 = m1 * l1 * l1 + m2 * l3 * l3;
    double coupling = m2 * l2 * l3;
    double torque5 = (m1 * l1 + m2 * l3) * (c5 * tangential + s5 * weight) - inertia5 * s5 * c5 * w2
        - coupling * (2.0 * s6 * r5 * r6 + c5 * (s6 * wa + 2.0 * c6 * w * r6)) + q->c5 * r5;
    double specific6 = s6 * (c5 * weight - s5 * tangential) - c6 * radial + s5 * (l1 * c6 + l2) * wa
        + s6 * (l1 - l3 * c5 * c5) * w2 + l3 * r5 * (s6 * r5 + 2.0 * c6 * c5 * w) + q->c6 / (m2 * l2) * r6;
    out[0] = -torque5 / inertia5;
    out[1] = -specific6 / l2;
}

/* One step of Runge and Kutta; the tip at its start, middle and end. */
static void swing(const plant_grapple *q, double *x, double h, const tip_motion *t)
{
    double half = 0.5 * h, sixth = h / 6.0, a[2], b[2], c[2], d[2];
    accelerations(q, x, &t[0], a);
    double xb[4] = {x[0] + half * x[2], x[1] + half * x[3], x[2] + half * a[0], x[3] + half * a[1]};
    accelerations(q, xb, &t[1], b);
    double xc[4] = {x[0] + half * xb[2], x[1] + half * xb[3], x[2] + half * b[0], x[3] + half * b[1]};
    accelerations(q, xc, &t[1], c);
    double xd[4] = {x[0] + h * xc[2], x[1] + h * xc[3], x[2] + h * c[0], x[3] + h * c[1]};
    accelerations(q, xd, &t[2], d);
    for (int i = 0; i < 2; i++) {
        double rate = x[i + 2];
        x[i] += sixth * (rate + 2.0 * (xb[i + 2] + xc[i + 2]) + xd[i + 2]);
        x[i + 2] = rate + sixth * (a[i] + 2.0 * (b[i] + c[i]) + d[i]);
    }
}

typedef struct {
    actuator a[COORDINATES];
    double decay[COORDINATES], x[4], step_s;
    int32_t steps; /* of a tick */
} crane_state;

static void crane_begin(crane_state *s, const plant_valve *valve, const double *sway, double step_s, int32_t steps)
{
    memset(s, 0, sizeof(*s));
    memcpy(s->x, sway, sizeof(s->x));
    s->step_s = step_s;
    s->steps = steps;
    for (int32_t i = 0; i < COORDINATES; i++) {
        s->a[i].p = &valve[i];
        s->a[i].position = valve[i].start;
        s->decay[i] = exp(-(0.5 * step_s) / valve[i].lag);
    }
}

/* One tick with the commands that the valves have. Returns whether the grapple is above the horizontal. */
static bool crane_tick(crane_state *s, const plant_grapple *q)
{
    actuator *a = s->a;
    for (int32_t n = 0; n < s->steps; n++) {
        tip_motion t[3];
        t[0] = (tip_motion){a[NEAR_FAR].position, a[NEAR_FAR].speed, 0.0, a[SLEW].speed, 0.0, 0.0};
        for (int32_t i = 0; i < COORDINATES; i++) { advance(&a[i], s->step_s, s->decay[i]); }
        t[0].radius_acc = a[NEAR_FAR].start_acc;
        t[0].slew_acc = a[SLEW].start_acc;
        t[0].height_acc = a[LIFT].start_acc;
        t[1] = (tip_motion){a[NEAR_FAR].middle_position, a[NEAR_FAR].middle_speed, a[NEAR_FAR].middle_acc,
                            a[SLEW].middle_speed, a[SLEW].middle_acc, a[LIFT].middle_acc};
        t[2] = (tip_motion){a[NEAR_FAR].position, a[NEAR_FAR].speed, a[NEAR_FAR].end_acc,
                            a[SLEW].speed, a[SLEW].end_acc, a[LIFT].end_acc};
        swing(q, s->x, s->step_s, t);
    }
    return (fabs(s->x[0]) > (PI / 2.0)) || (fabs(s->x[1]) > (PI / 2.0));
}

#ifndef CS_CRANE_ALONE
typedef struct { double time_s; plant_grapple grapple; } plant_load;
typedef struct { double start, past, duration, ramp, level, axis; } plant_stroke; /* in order of axis, then time */
typedef struct { int64_t cycle_ms; uint8_t neutral[CS_BYTES]; } plant_joystick;
typedef struct { int32_t joystick; uint8_t data[CS_BYTES]; } plant_frame;
typedef struct { int32_t number; uint8_t changed[CS_BYTES]; } plant_arrival; /* of the frame that was made as such */
typedef struct {
    plant_valve valve[COORDINATES];
    plant_joystick joystick[CS_JOYSTICKS];
    double sway[4], step_s, dwell_s, still_deg;
    int64_t tick_ms;
    int32_t steps, ticks, loads_n, strokes_n, radius; /* radius: the crane sends it */
} plant_drive;

static double command_in(const plant_valve *p, const cs_frame *out, int32_t frames, double held)
{
    const cs_axis_config *axis = &cs_tables.axis[p->axis];
    const cs_valve_config *valve = &cs_tables.valve[axis->valve];
    for (int32_t i = 0; i < frames; i++) {
        if ((out[i].id == valve->id) && (out[i].bus == valve->bus) && (out[i].extended == valve->extended)) {
            int32_t steps = p->step * (cs_field_read(&axis->setpoint, out[i].data) - p->zero);
            held = (abs(steps) <= p->full) ? ((double)steps / (double)p->full) : 0.0;
        }
    }
    return held;
}

/* Strokes of an axis that are not over, and the state of a joystick's sender. */
typedef struct { const plant_stroke *next, *end; } plant_hand;
typedef struct { int64_t due_ms; int32_t sent; } plant_sender;

/* Joystick value of an axis, at a time that is not before the last one. */
static double joystick_at(plant_hand *h, double time_s)
{
    double value = 0.0;
    while ((h->next < h->end) && (time_s > h->next->past)) { h->next++; }
    for (const plant_stroke *one = h->next; (one < h->end) && (time_s >= one->start); one++) {
        double press = time_s - one->start, release = press - one->duration;
        if ((time_s > one->past) || (release >= one->ramp)) { continue; }
        if (release > 0.0) { value += one->level * (1.0 - (release / one->ramp)); }
        else if (press < one->ramp) { value += (one->level * press) / one->ramp; }
        else { value += one->level; }
    }
    return fmin(fmax(value, -1.0), 1.0);
}

/* Make the joystick frames that are due since the last tick; returns how many there are now. */
static int32_t make_frames(const plant_drive *d, plant_hand *hands, plant_sender *senders, int64_t now_ms,
                           plant_frame *made, int32_t n)
{
    for (;;) {
        int32_t i = 0; /* whose frame is the next one */
        for (int32_t k = 1; k < cs_tables.joysticks_n; k++) { i = (senders[k].due_ms < senders[i].due_ms) ? k : i; }
        const cs_joystick_config *j = &cs_tables.joystick[i];
        double at_s = (double)senders[i].due_ms / 1000.0;
        uint8_t *data = made[n].data;
        if (senders[i].due_ms > now_ms) { return n; }
        senders[i].due_ms += d->joystick[i].cycle_ms;
        made[n++].joystick = i;
        memcpy(data, d->joystick[i].neutral, CS_BYTES);
        for (int32_t k = 0; k < cs_tables.axes_n; k++) {
            const cs_axis_config *axis = &cs_tables.axis[k];
            if (axis->joystick == i) { cs_number_write(&j->number[axis->number], data, joystick_at(&hands[k], at_s)); }
        }
        senders[i].sent = (j->message.counts > 0) ? ((senders[i].sent + 1) % j->message.counts) : 0;
        cs_field_write(&j->message.counter, data, senders[i].sent);
    }
}

static void arrive(cs_controller *s, const cs_message_config *m, const uint8_t *data, int64_t now)
{
    cs_receive(s, &cs_tables, m->bus, m->id, m->extended, data, m->length, now);
}

/* The crane measures the radius of its tip and sends it, as the controller receives it. */
static void send_radius(cs_controller *s, double radius, int64_t now)
{
    for (int32_t i = 0; i < cs_tables.motions_n; i++) {
        const cs_motion_config *m = &cs_tables.motion[i];
        uint8_t data[CS_BYTES] = {0};
        cs_number_write(&m->radius, data, radius);
        arrive(s, &m->message, data, now);
    }
}

/* Drive and measure. made: room for the joystick frames of the drive. counts: how many of arrivals come before each
   tick; NULL: all that were made. work: COLUMNS of d->ticks each. A grapple above the horizontal ends the drive. */
void cs_drive(const plant_drive *d, const plant_grapple *empty, const plant_load *load, const plant_stroke *strokes,
              plant_frame *made, const int32_t *counts, const plant_arrival *arrivals, double *work,
              double *measures)
{
    cs_controller s;
    cs_frame frames[CS_VALVES];
    crane_state crane;
    actuator *a = crane.a;
    const double *x = crane.x;
    double held[COORDINATES] = {0.0};
    double *out[COLUMNS];
    const plant_grapple *q = empty;
    plant_hand hands[CS_AXES] = {{NULL, NULL}};
    plant_sender senders[CS_JOYSTICKS] = {{0, 0}};
    int32_t next = 0, n = 0, made_n = 0;
    bool over = false;
    cs_init(&s, &cs_tables);
    crane_begin(&crane, d->valve, d->sway, d->step_s, d->steps);
    for (int32_t i = 0; i < d->strokes_n; i++) {
        plant_hand *h = &hands[(int32_t)strokes[i].axis];
        h->next = (h->next == NULL) ? &strokes[i] : h->next;
        h->end = &strokes[i + 1];
    }
    for (int32_t i = 0; i < COLUMNS; i++) { out[i] = &work[i * d->ticks]; }
    for (int32_t k = 0; (k < d->ticks) && !over; k++, n++) {
        int64_t ms = k * d->tick_ms, now = ms * 1000000;
        while ((next < d->loads_n) && ((double)ms >= (1000.0 * load[next].time_s))) { q = &load[next++].grapple; }
        if ((k > 0) && d->radius) { send_radius(&s, a[NEAR_FAR].position, now); }
        int32_t first = made_n;
        made_n = make_frames(d, hands, senders, ms, made, made_n);
        for (int32_t j = 0, in_n = (counts == NULL) ? (made_n - first) : counts[k]; j < in_n; j++) {
            const plant_arrival in = (counts == NULL) ? (plant_arrival){first + j, {0}} : *arrivals++;
            plant_frame frame = made[in.number];
            for (int32_t i = 0; i < CS_BYTES; i++) { frame.data[i] ^= in.changed[i]; }
            arrive(&s, &cs_tables.joystick[frame.joystick].message, frame.data, now);
        }
        int32_t sent = cs_tick(&s, &cs_tables, now, 0, frames);
        for (int32_t i = 0; i < COORDINATES; i++) {
            if (d->valve[i].axis != CS_NONE) { held[i] = command_in(&d->valve[i], frames, sent, held[i]); }
            set_command(&a[i], held[i]);
        }
        over = crane_tick(&crane, q);
        out[FASTEST][k] = 0.0;
        for (int32_t i = 0; i < COORDINATES; i++) {
            int32_t axis = d->valve[i].axis;
            out[JOYSTICK + i][k] = (axis == CS_NONE) ? 0.0 : joystick_at(&hands[axis], (double)ms / 1000.0);
            out[SENT + i][k] = (axis == CS_NONE) ? 0.0 : cs_velocity(&cs_tables.axis[axis], held[i]);
            out[SPEED + i][k] = (axis == CS_NONE) ? 0.0 : (a[i].speed / d->valve[i].nominal);
            out[FASTEST][k] = fmax(out[FASTEST][k], fabs(out[SPEED + i][k]));
        }
        out[TIP_X][k] = a[NEAR_FAR].position * cos(a[SLEW].position);
        out[TIP_Y][k] = a[NEAR_FAR].position * sin(a[SLEW].position);
        out[SWING][k] = cs_hypot(x[0] * (180.0 / PI), x[1] * (180.0 / PI));
    }
    const drive_look look = {{d->valve[SLEW].axis, d->valve[NEAR_FAR].axis, d->valve[LIFT].axis},
                             d->tick_ms, d->dwell_s, d->still_deg};
    cs_measure(&look, out, n, measures);
    measures[SWUNG_OVER] = over ? 1.0 : 0.0;
}

/* What the crane needs of the mathematics library, to be held against Python's. */
void cs_functions(double x, double *out)
{
    out[0] = sin(x);
    out[1] = cos(x);
    out[2] = exp(-fabs(x));
}
#endif
