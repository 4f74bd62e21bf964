/* Fields of frames; messages that are received, their sequence and age; joysticks, and a measured radius. */
#include "cs_internal.h"

/* -- fields */

/* The bytes in which a field of up to 24 bits stands, and how far its lowest bit is from that of them all. */
typedef struct { int32_t first, n; uint32_t shift, mask; } place;

static place place_of(const cs_field *f)
{
    int32_t before = f->motorola ? (7 - (f->start % 8)) : (f->start % 8); /* bits of the first byte */
    int32_t n = (before + f->length + 7) / 8;
    int32_t shift = f->motorola ? ((8 * n) - before - f->length) : before;
    return (place){f->start / 8, n, (uint32_t)shift, (1u << (uint32_t)f->length) - 1u};
}

/* Raw value of a field; 0 where there is none. */
int32_t cs_field_read(const cs_field *f, const uint8_t *data)
{
    const place p = place_of(f);
    uint32_t all = 0;
    for (int32_t i = 0; i < p.n; i++) { all = (all << 8u) | data[p.first + (f->motorola ? i : ((p.n - 1) - i))]; }
    int32_t value = (int32_t)((all >> p.shift) & p.mask);
    int32_t half = (int32_t)((p.mask / 2u) + 1u);
    return (f->is_signed && (value >= half)) ? (value - (2 * half)) : value;
}

void cs_field_write(const cs_field *f, uint8_t *data, int32_t value)
{
    const place p = place_of(f);
    uint32_t all = ((uint32_t)value & p.mask) << p.shift;
    uint32_t mask = p.mask << p.shift;
    for (int32_t i = 0; i < p.n; i++) {
        int32_t at = p.first + (f->motorola ? ((p.n - 1) - i) : i);
        data[at] = (uint8_t)(((data[at] & ~mask) | all) & 0xFFu);
        all >>= 8u;
        mask >>= 8u;
    }
}

/* -- messages */

bool cs_fresh(int64_t since_ns, int64_t now_ns, int64_t timeout_ns)
{
    uint64_t age_ns = (uint64_t)now_ns - (uint64_t)since_ns; /* no time overflows */
    return (since_ns != CS_NEVER) && ((since_ns >= now_ns) || (age_ns <= (uint64_t)timeout_ns));
}

void cs_message_init(cs_message *m) { *m = (cs_message){CS_NEVER, CS_NEVER, CS_NEVER, CS_NONE, 0, true, false}; }

bool cs_message_is(const cs_message_config *c, int32_t bus, uint32_t id, bool extended, int32_t length)
{
    return (c->bus == bus) && (c->id == id) && (c->extended == extended) && (c->length == length);
}

/* Begin the count of good frames again. */
static void requalify(cs_message *m)
{
    m->good = 0;
    m->qualified = false;
}

/* Whether the counter of a frame follows the last one; after silence any other one does. */
static bool in_sequence(cs_message *m, const cs_message_config *c, const uint8_t *data)
{
    int32_t count = cs_field_read(&c->counter, data);
    int32_t step = (m->last == CS_NONE) ? 1 : (((count - m->last) + c->counts) % c->counts);
    bool jump = (step > c->max_step) && !m->resynced;
    bool ok = (step != 0) && !jump; /* repeated: no news */
    m->last = count;
    if (jump) { requalify(m); }
    if (ok) { m->resynced = false; }
    return ok;
}

/* Take a frame of the right length; whether it may be used. */
static bool accepts(cs_message *m, const cs_message_config *c, const uint8_t *data, int64_t now_ns)
{
    if (!cs_fresh(m->last_frame_ns, now_ns, c->timeout_ns)) {
        m->resynced = true;
        requalify(m);
    }
    bool ok = true;
    if (c->counts > 0) { ok = in_sequence(m, c, data); }
    if (ok && !m->qualified) {
        m->good++;
        m->qualified = m->good >= c->qualify;
    }
    ok = ok && m->qualified;
    m->last_frame_ns = now_ns;
    if (ok) { m->received_ns = now_ns; }
    else { m->refused_ns = now_ns; }
    return ok;
}

/* Value of a number; why it is no measurement, or CS_NONE. */
static int32_t number_read(const cs_number_config *c, const uint8_t *data, cs_real *value)
{
    int32_t code = cs_field_read(&c->field, data);
    int32_t why = CS_NONE;
    for (int32_t i = 0; i < c->codes_n; i++) {
        if (code == c->codes[i].code) { why = c->codes[i].reason; }
    }
    *value = ((CS_R(code) * c->scale) + c->offset) / c->full;
    if ((why == CS_NONE) && !((c->low <= *value) && (*value <= c->high))) { why = CS_JOYSTICK_OUT_OF_RANGE; }
    return why;
}

/* Take a frame with the measured radius. */
void cs_radius_receive(cs_motion *m, const cs_motion_config *c, const uint8_t *data, int64_t now_ns)
{
    cs_real value;
    int32_t why = number_read(&c->radius, data, &value);
    if (accepts(&m->message, &c->message, data, now_ns) && (why == CS_NONE)) {
        m->value = value;
        m->measured_ns = now_ns;
    }
}

/* -- joysticks */

void cs_joystick_init(cs_joystick *j, const cs_joystick_config *c)
{
    cs_message_init(&j->message);
    for (int32_t i = 0; i < c->numbers_n; i++) { j->why[i] = CS_JOYSTICK_TIMEOUT; } /* no frame says that */
}

static void take_numbers(cs_joystick *j, const cs_joystick_config *c, const uint8_t *data, int64_t now_ns)
{
    for (int32_t i = 0; i < c->numbers_n; i++) {
        cs_real value;
        int32_t why = number_read(&c->number[i], data, &value);
        value = (why == CS_NONE) ? cs_max(cs_min(value, 1), -1) : CS_R(0); /* full scale may be rounded */
        if ((why != j->why[i]) || (value != j->value[i])) { j->changed_ns[i] = now_ns; }
        j->why[i] = why;
        j->value[i] = value;
    }
}

/* Take a frame. Any frame can show a released enable, only an accepted one ends it. */
void cs_joystick_receive(cs_joystick *j, const cs_joystick_config *c, const uint8_t *data, int64_t now_ns)
{
    bool accepted = accepts(&j->message, &c->message, data, now_ns);
    int32_t enable = cs_field_read(&c->enable, data);
    if (enable == 0) {
        j->releases++;
        j->released = true;
        if (!accepted) { j->doubted = j->releases; }
    }
    if (accepted) {
        j->released = enable == 0;
        j->enable = enable;
        j->reset = cs_field_read(&c->reset, data);
        j->off = cs_field_read(&c->off, data);
        take_numbers(j, c, data, now_ns);
    }
}

/* Input of the axis that one of its numbers drives. A release since the last tick of the axis counts when it is read,
   however short it was. */
cs_input cs_joystick_command(const cs_joystick *j, const cs_joystick_config *c, const cs_axis_config *axis,
                             int64_t now_ns, int64_t releases)
{
    cs_input in = {0, j->why[axis->number], CS_NONE, true, false, j->reset == 1};
    bool more = j->releases > releases;
    bool released = j->released || more;
    if (!cs_fresh(j->message.received_ns, now_ns, c->message.timeout_ns)) {
        /* seen released is more than lost; a switch that is held was not pressed */
        bool untrusted = cs_fresh(j->message.refused_ns, now_ns, c->message.timeout_ns);
        in.fault = untrusted ? CS_JOYSTICK_UNTRUSTED : CS_JOYSTICK_TIMEOUT;
        in.enabled = !(more || (j->released && untrusted));
        in.reset = true;
    } else {
        bool moved = CS_ABS(j->value[axis->number]) > axis->neutral_band;
        bool frozen = moved && !cs_fresh(j->changed_ns[axis->number], now_ns, c->frozen_ns);
        bool doubted = (j->enable != 0) && (j->released || (j->doubted > releases));
        if (released) { in.fault = doubted ? CS_JOYSTICK_UNTRUSTED : in.fault; } /* that moves nothing, and is no press */
        else if (in.fault != CS_NONE) { /* no measurement */ }
        else if (j->enable != 1) { in.fault = CS_SWITCH_INVALID; }
        else if (frozen) { in.fault = CS_JOYSTICK_FROZEN; }
        else { in.bypass = j->off == 1; }
        in.command = (in.fault == CS_NONE) ? j->value[axis->number] : CS_R(0);
        in.enabled = !released;
    }
    return in;
}
