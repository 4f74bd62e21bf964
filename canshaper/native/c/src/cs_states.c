/* The state machine of an axis: a table, and the lines that follow it. The first row of the state whose conditions all
   hold gives the next state and the reason. */
#include <stddef.h>

#include "cs_internal.h"

/* Conditions that may hold in a tick. */
enum {
    TRIP = 0x001, RELEASED = 0x002, FAULT = 0x004, CENTRED = 0x008, DEFLECTED = 0x010, PRESSED = 0x020, SHAPED = 0x040,
    UNSHAPED = 0x080, ADDED = 0x100, NOT_ADDED = 0x200, AT_REST = 0x400, STOP_OVER = 0x800
};

/* In place of a reason: the cause that the input names, if it is one of these; any other one is a mistake, and trips. */
enum { ANY = -1, STOPS = -2, STOPS_IN_BYPASS = -3, WAITS = -4, TRIPS = -5, TRIPS_AT_REST = -6 };

typedef struct { int32_t state; uint32_t when; int32_t new_state, why; } row;

static const row table[] = {
    {CS_NEUTRAL_WAIT, TRIP, CS_TRIPPED, TRIPS_AT_REST},
    {CS_NEUTRAL_WAIT, DEFLECTED, CS_NEUTRAL_WAIT, CS_JOYSTICK_NOT_NEUTRAL},
    {CS_NEUTRAL_WAIT, RELEASED, CS_NEUTRAL_WAIT, CS_ENABLE_OFF},
    {CS_NEUTRAL_WAIT, FAULT, CS_NEUTRAL_WAIT, ANY},
    {CS_NEUTRAL_WAIT, CENTRED, CS_READY, CS_JOYSTICK_NEUTRAL},
    {CS_READY, TRIP, CS_TRIPPED, TRIPS_AT_REST},
    {CS_READY, RELEASED, CS_NEUTRAL_WAIT, CS_ENABLE_OFF},
    {CS_READY, FAULT, CS_NEUTRAL_WAIT, WAITS},
    {CS_READY, DEFLECTED | SHAPED, CS_ACTIVE, CS_JOYSTICK_MOVED},
    {CS_READY, DEFLECTED | UNSHAPED, CS_BYPASS_ON, CS_BYPASS_REQUESTED},
    {CS_READY, CENTRED | ADDED, CS_ACTIVE, CS_COMPENSATING},
    {CS_ACTIVE, TRIP, CS_TRIPPED, TRIPS},
    {CS_ACTIVE, RELEASED, CS_TRIPPED, CS_ENABLE_LOST},
    {CS_ACTIVE, FAULT, CS_STOPPING, STOPS},
    {CS_ACTIVE, CENTRED | AT_REST | NOT_ADDED, CS_READY, CS_AT_REST},
    {CS_ACTIVE, UNSHAPED, CS_BYPASS_ON, CS_BYPASS_REQUESTED},
    {CS_BYPASS_ON, TRIP, CS_TRIPPED, TRIPS},
    {CS_BYPASS_ON, RELEASED, CS_TRIPPED, CS_ENABLE_LOST},
    {CS_BYPASS_ON, FAULT, CS_STOPPING, STOPS_IN_BYPASS},
    {CS_BYPASS_ON, CENTRED | AT_REST | NOT_ADDED, CS_READY, CS_AT_REST},
    {CS_BYPASS_ON, SHAPED, CS_ACTIVE, CS_BYPASS_RELEASED},
    {CS_STOPPING, TRIP, CS_TRIPPED, TRIPS},
    {CS_STOPPING, RELEASED, CS_TRIPPED, CS_ENABLE_LOST},
    {CS_STOPPING, AT_REST, CS_NEUTRAL_WAIT, CS_STOP_DONE},
    {CS_STOPPING, STOP_OVER, CS_NEUTRAL_WAIT, CS_STOP_DONE},
    {CS_TRIPPED, PRESSED | CENTRED, CS_NEUTRAL_WAIT, CS_RESET},
};
#define ROWS ((int32_t)(sizeof(table) / sizeof(table[0])))

/* Whether a row accepts a cause: the number of a reason is its reaction. */
static bool accepted(int32_t why, int32_t cause)
{
    bool stops = (cause >= CS_JOYSTICK_TIMEOUT) && (cause < CS_ENABLE_LOST);
    bool trips = cause >= CS_ENABLE_LOST;
    bool yes = true;
    switch (why) {
    case STOPS: yes = stops; break;
    case STOPS_IN_BYPASS: yes = stops && (cause != CS_LOOP_OVERRUN); break; /* late ticks spoil a filter only */
    case WAITS: yes = stops || (cause == CS_ENABLE_OFF) || (cause == CS_EMERGENCY_STOP_LOST); break;
    case TRIPS: yes = trips; break;
    case TRIPS_AT_REST: yes = trips && (cause != CS_ENABLE_LOST); break; /* enable is lost in motion only */
    default: break; /* ANY */
    }
    return yes;
}

static void take(cs_axis *a, const row *r, int32_t cause)
{
    bool named = r->why >= 0;
    a->state = (named || accepted(r->why, cause)) ? r->new_state : CS_TRIPPED;
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
    const row *found = NULL;
    for (int32_t i = 0; (i < ROWS) && (found == NULL); i++) {
        if ((table[i].state == a->state) && ((table[i].when & holding) == table[i].when)) { found = &table[i]; }
    }
    if (found != NULL) { take(a, found, (in->trip == CS_NONE) ? in->fault : in->trip); }
}
