/* canshaper: anti-sway between joystick and valve frames, for a controller without Python.

   One object of cs_controller holds all that changes, the constant cs_tables all that does not: canshaper has written
   it next to these files. No function keeps a pointer, and two machines in one program are two objects.

       static cs_controller crane;
       cs_frame frames[CS_VALVES];

       cs_init(&crane, &cs_tables);
       for (;;) {                                                         every cs_tables.tick_ns, exactly
           for each frame that was received since the last tick:
               cs_receive(&crane, &cs_tables, bus, id, extended, data, length, arrived_ns);
           count = cs_tick(&crane, &cs_tables, now_ns, missed, frames);
           send frames[0] to frames[count - 1] at once, or never: cs_send_failed for each that did not leave
       }

   Times are of one monotonic clock, in ns. arrived_ns is when a frame came, not when it was read: one that has waited
   is old. missed counts the ticks that were left out since the last call; the valves held their output meanwhile. After
   a gap longer than cs_tables.longest_gap_ns, frames that waited must not look fresh, and a valve may have closed: then
   cs_tick takes no input until it comes again, and trips axes that move. It does so too where now_ns stands, goes back,
   or disagrees with missed by a tick. No function may interrupt another one on the same object.

   The bounds of time are constant: no recursion, no heap, and every loop ends after a number of turns that the tables
   give. Floating point has to be that of IEEE 754, rounded to nearest and never contracted (-ffp-contract=off, no
   -ffast-math): cs_arithmetic says whether it is.

   What it is not: a guard over its own frames, a watchdog, an emergency stop. Those are the machine's. */
#ifndef CANSHAPER_H
#define CANSHAPER_H

#include <stdbool.h>
#include <stdint.h>

#include "cs_sizes.h" /* CS_AXES and so on: the sizes that the tables need */

#ifdef CS_FLOAT
typedef float cs_real; /* the README of the export says what differs */
#else
typedef double cs_real;
#endif

#define CS_NONE (-1)
#define CS_NEVER INT64_MIN
#define CS_BYTES 8  /* of a frame: classical CAN */
#define CS_PARTS 24 /* of a sum: each has digits of its own, so that so many hold every sum of numbers up to 2^140 */

/* States of an axis, and the reasons for them that the program names: numbers of docs/states.md. From 32 on a reason
   stops an axis through its filter, from 64 on it makes it neutral at once, latched. */
enum { CS_NEUTRAL_WAIT, CS_READY, CS_ACTIVE, CS_BYPASS_ON, CS_STOPPING, CS_TRIPPED };
enum {
    CS_START = 0, CS_JOYSTICK_NEUTRAL = 1, CS_JOYSTICK_MOVED = 2, CS_AT_REST = 3, CS_BYPASS_REQUESTED = 4,
    CS_BYPASS_RELEASED = 5, CS_STOP_DONE = 6, CS_RESET = 7, CS_COMPENSATING = 8, CS_JOYSTICK_NOT_NEUTRAL = 16,
    CS_ENABLE_OFF = 17, CS_JOYSTICK_TIMEOUT = 32, CS_JOYSTICK_OUT_OF_RANGE = 35, CS_SWITCH_INVALID = 37,
    CS_JOYSTICK_FROZEN = 39, CS_JOYSTICK_UNTRUSTED = 40, CS_LOOP_OVERRUN = 41, CS_ENABLE_LOST = 64,
    CS_OUTPUT_INVALID = 65, CS_SEND_FAILED = 66, CS_LOOP_STALLED = 67, CS_SECOND_SENDER = 70
};
/* Filters. CS_FIR: ZV, ZVD, EI, two-mode. CS_ROBUST: a FIR with feedback of what limits made. */
enum { CS_OFF, CS_FIR, CS_ROBUST, CS_GFF, CS_FIRST_ORDER, CS_S_CURVE };

/* ---- constant tables: velocities are parts of full speed, ticks of an axis those of its valve */

/* Where a number stands in a frame, as a DBC file counts: start is the lowest bit, in Motorola order the highest one.
   No field: length 0. */
typedef struct { int32_t start, length; bool motorola, is_signed; } cs_field;
typedef struct { int32_t code, reason; } cs_code; /* a code that is no measurement */

/* A message that is received. counts: values of its alive counter, 0 for none. */
typedef struct {
    int32_t bus, length; uint32_t id; bool extended;
    cs_field counter; int32_t counts, max_step, qualify; int64_t timeout_ns;
} cs_message_config;

/* A number in a message: code * scale + offset, of a joystick as a part of full. */
typedef struct {
    cs_field field; cs_real scale, offset, full, low, high; const cs_code *codes; int32_t codes_n;
} cs_number_config;

typedef struct {
    cs_message_config message; cs_field enable, reset, off; int64_t frozen_ns;
    cs_number_config number[CS_NUMBERS]; int32_t numbers_n;
} cs_joystick_config;

typedef struct {
    int32_t bus, length; uint32_t id; bool extended; uint8_t start[CS_BYTES]; cs_field counter; int32_t counts;
} cs_valve_config;

/* Equal taps of a FIR, one after the other; end: how many taps stand before the next ones. */
typedef struct { int32_t end; cs_real tap; } cs_run;

typedef struct {
    /* in: a number of a joystick; out: steps in the frame of a valve, which leaves with the axis that sends */
    int32_t joystick, number, valve, period_ticks; bool sends; cs_field setpoint; int32_t zero, sign;
    /* sway model; filter: runs of taps of a FIR, share, rate and change of rate of the others */
    int32_t kind; bool sways; cs_real f11, f12, f21, f22, k1, k2, share, rate, change, tick_s, fade;
    const cs_run *runs; int32_t runs_n, taps_n;
    /* limits: docs/deployment.md; the curve stands in place of the dead band */
    cs_real neutral_band, maximum, minimum, rise, fall, fall_per_s, deadband, run_on, small_least, small_most;
    const cs_real *curve_command, *curve_speed; int32_t curve_n;
    int32_t steps, tail, reversal, stop_ticks; bool allow_faster, allow_reverse, spreads;
    /* what a motion may add while no one commands the axis; 0: there is none */
    cs_real largest_added; int32_t added_ticks;
} cs_axis_config;

typedef struct {
    cs_real full_speed, period_s, stiffness, damping, lag_s, farthest, fall_per_s; bool bounded;
} cs_moving_config;

/* Slew and near-far as one motion. near_far CS_NONE: slew alone. circle_m: radius, where it is not measured. */
typedef struct {
    int32_t slew, near_far; bool measured; cs_real path_m, circle_m, tick_s;
    cs_moving_config moving[2]; cs_message_config message; cs_number_config radius;
} cs_motion_config;

typedef struct {
    int64_t tick_ns, longest_gap_ns; int32_t joysticks_n, valves_n, axes_n, motions_n;
    const cs_joystick_config *joystick; const cs_valve_config *valve; const cs_axis_config *axis;
    const cs_motion_config *motion;
} cs_config;
extern const cs_config cs_tables;

/* A row of the state machine. when: conditions of cs_states.c. why: the reason; CS_NONE: the cause that the input names,
   if its bit is in causes; any other one is a mistake, and trips. */
typedef struct { int32_t state; uint32_t when; int32_t new_state, why; uint32_t causes[3]; } cs_row;
extern const cs_row cs_rows[];
extern const int32_t cs_rows_n;

/* ---- what changes */

typedef struct { uint32_t id; int32_t bus, length; bool extended; uint8_t data[CS_BYTES]; } cs_frame;
typedef struct {
    int64_t last_frame_ns, refused_ns, received_ns; int32_t last, good; bool resynced, qualified;
} cs_message;
typedef struct {
    cs_message message; int64_t releases, doubted; bool released; int32_t enable, reset, off;
    cs_real value[CS_NUMBERS]; int32_t why[CS_NUMBERS]; int64_t changed_ns[CS_NUMBERS]; /* why: CS_NONE or a fault */
} cs_joystick;
typedef struct { uint8_t data[CS_BYTES]; int32_t count; } cs_valve;
typedef struct { cs_real command; int32_t fault, trip; bool enabled, bypass, reset; } cs_input;
/* A sum without an error, as parts that do not overlap, the smallest first. */
typedef struct { cs_real part[CS_PARTS]; int32_t n; } cs_sum;
/* Smallest and largest of the demands within the tail, 0 included, and how many of them count. */
typedef struct { cs_real low, high; int32_t low_n, high_n; } cs_extremes;
/* Steps in the frame, the velocity of them, the part that is added, the rest; both ramps, what rounding left out. */
typedef struct {
    int32_t steps; cs_real setpoint, path, applied, ramp, own_ramp, carry, dropped_at;
} cs_output;

typedef struct {
    int32_t state, reason, stopping; bool was_enabled, was_reset;
    /* sway model and its twin; what the filter remembers; transfer to and from bypass */
    cs_real angle, rate, twin_angle, twin_rate, unlimited, value, slope, offset, history[CS_TAPS + 1];
    cs_sum sum; int32_t newest; bool joins, bypassed;
    /* commanded: the operator demanded motion within the tail */
    cs_output out; cs_real command, ran, side, due, left; bool commanded, asked, unattended, aged;
    int32_t no_run_on, crossed, added_left, rested, demand_at; cs_real demands[CS_WINDOW];
    cs_extremes recent, demanded;
    /* noted since the last tick; added: what a motion asks for */
    int32_t trip; bool invalid; int64_t foreign_ns, releases; cs_real added;
} cs_axis;

typedef struct {
    cs_real applied, sent, ahead_s, added, way, reached; bool commanded, unattended, able, joins;
} cs_moving;
typedef struct {
    cs_moving moving[2]; cs_real weight, radius_m, value; bool has_radius; int64_t measured_ns; cs_message message;
} cs_motion;
typedef struct {
    cs_joystick joystick[CS_JOYSTICKS]; cs_valve valve[CS_VALVES]; cs_axis axis[CS_AXES]; cs_motion motion[CS_MOTIONS];
    int64_t last, now_ns; int32_t late; bool overrun, able; /* able: begun, by a build that computes right */
} cs_controller;

/* ---- functions */

/* Begin with every axis in NEUTRAL_WAIT. */
void cs_init(cs_controller *s, const cs_config *c);

/* Take a data frame of classical CAN that was received; one that no table names has no effect. */
void cs_receive(cs_controller *s, const cs_config *c, int32_t bus, uint32_t id, bool extended, const uint8_t *data,
                int32_t length, int64_t arrived_ns);

/* Run every axis that is due; out gets the frames to send now, CS_VALVES at most. Returns how many there are. */
int32_t cs_tick(cs_controller *s, const cs_config *c, int64_t now_ns, int32_t missed, cs_frame *out);

/* A frame of a valve did not leave: its axes trip, if they move. */
void cs_send_failed(cs_controller *s, const cs_config *c, int32_t valve);

/* Whether this build computes as the tables were made for; otherwise, and without cs_init, every axis stays tripped. */
bool cs_arithmetic(void);

#endif
