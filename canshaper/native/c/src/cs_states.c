/* The state machine of an axis: a table, and the lines that follow it. The first row of the state whose conditions all
   hold gives the next state and the reason. */
#include <stddef.h>

#include "cs_internal.h"

/* Conditions that may hold in a tick. */
enum {
    TRIP = 0x001, RELEASED = 0x002, FAULT = 0x004, CENTRED = 0x008, DEFLECTED = 0x010, PRESSED = 0x020, SHAPED = 0x040,
    UNSHAPED = 0x080, ADDED = 0x100, NOT_ADDED = 0x200, AT_REST = 0x400, STOP_OVER = 0x800
};

/* Whether a row accepts a cause. */
static bool accepted(const cs_row *r, int32_t cause)
{
    return ((r->causes[cause / 32] >> ((uint32_t)cause % 32u)) & 1u) != 0u;
}

static void take(cs_axis *a, const cs_row *r, int32_t cause)
{
    bool named = r->why != CS_NONE;
    a->state = (named || accepted(r, cause)) ? r->new_state : CS_TRIPPED;
    a->reason = named ? r->why : cause;
    if (a->state == CS_STOPPING) { a->stopping = 0; }
}

/* Conditions of the joystick; and what of its switches is remembered, since only a press counts. */
static uint32_t of_joystick(cs_axis *a, const cs_axis_config *c, const cs_input *in)
{
    uint32_t holding = FAULT;
    if (in->fault == CS_NONE) {
        bool pressed = (in->reset && !a->was_reset) || (in->enabled && !a->was_enabled);
        holding = (CS_ABS(in->command) <= c->neutral_band) ? CENTRED : DEFLECTED;
        if (pressed && (in->trip == CS_NONE)) { holding |= PRESSED; }
        a->was_reset = in->reset;
        a->was_enabled = in->enabled;
    } else { /* what is held while its messages fail is not pressed when they come back */
        bool unknown = (in->fault == CS_JOYSTICK_TIMEOUT) || (in->fault == CS_JOYSTICK_UNTRUSTED);
        a->was_reset = a->was_reset || in->reset;
        a->was_enabled = in->enabled || unknown;
    }
    return holding;
}

void cs_states_step(cs_axis *a, const cs_axis_config *c, const cs_input *in, bool at_rest, bool added)
{
    uint32_t holding = of_joystick(a, c, in) | (added ? ADDED : NOT_ADDED) | (in->bypass ? UNSHAPED : SHAPED);
    if (in->trip != CS_NONE) { holding |= TRIP; }
    if (!in->enabled) { holding |= RELEASED; }
    if (at_rest) { holding |= AT_REST; }
    if (a->state == CS_STOPPING) {
        a->stopping = cs_later(a->stopping, 1);
        if (a->stopping >= c->stop_ticks) { holding |= STOP_OVER; }
    }
    const cs_row *taken = NULL;
    for (int32_t i = 0; (i < cs_rows_n) && (taken == NULL); i++) {
        const cs_row *r = &cs_rows[i];
        if ((r->state == a->state) && ((r->when & holding) == r->when)) { taken = r; }
    }
    if (taken != NULL) { take(a, taken, (in->trip == CS_NONE) ? in->fault : in->trip); }
}
