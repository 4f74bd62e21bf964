/* The controller as a unit: values to joystick frames, valve frames to values. The controller is that of the export. */
#include "cs_fmu.h"
#include "cs_internal.h"
#include "cs_number.h"

const size_t cs_unit_size = sizeof(cs_controller);

const char *cs_unit_begin(void *state)
{
    cs_init(state, &cs_tables);
    return cs_arithmetic() ? NULL : "expected IEEE 754 arithmetic without contraction: compile with -ffp-contract=off";
}

static void send(cs_controller *s, const cs_message_config *c, uint8_t *data, int64_t tick, int64_t now_ns)
{
    if (c->counts > 0) { cs_field_write(&c->counter, data, tick % c->counts); }
    cs_receive(s, &cs_tables, c->bus, c->id, c->extended, data, c->length, now_ns);
}

const char *cs_unit_tick(void *state, int64_t tick, double *value)
{
    cs_controller *s = state;
    cs_frame frames[CS_VALVES];
    const double *in = &value[1];
    int64_t now_ns = tick * cs_tables.tick_ns;
    for (int32_t i = 0; i < cs_tables.joysticks_n; i++) {
        const cs_joystick_config *c = &cs_tables.joystick[i];
        uint8_t data[CS_BYTES] = {0};
        cs_field_write(&c->enable, data, *in++ != 0.0);
        cs_field_write(&c->reset, data, *in++ != 0.0);
        cs_field_write(&c->off, data, *in++ != 0.0);
        for (int32_t k = 0; k < c->numbers_n; k++) { cs_number_write(&c->number[k], data, *in++); }
        send(s, &c->message, data, tick, now_ns);
    }
    for (int32_t i = 0; i < cs_tables.motions_n; i++) {
        const cs_motion_config *c = &cs_tables.motion[i];
        uint8_t data[CS_BYTES] = {0};
        double radius = c->measured ? *in++ : 0.0;
        if (radius > 0.0) { /* otherwise no one measures it */
            cs_number_write(&c->radius, data, radius);
            send(s, &c->message, data, tick, now_ns);
        }
    }
    (void)cs_tick(s, &cs_tables, now_ns, 0, frames);
    double *out = &value[1 + CS_UNIT_INPUTS];
    for (int32_t i = 0; i < cs_tables.axes_n; i++) {
        *out++ = (double)s->axis[i].out.steps / (double)cs_tables.axis[i].steps;
        *out++ = (double)s->axis[i].state;
        *out++ = (double)s->axis[i].reason;
    }
    return NULL;
}
