/* What the files of canshaper share; no part of the interface. */
#ifndef CS_INTERNAL_H
#define CS_INTERNAL_H

#include <math.h>

#include "canshaper.h"

#define CS_R(x) ((cs_real)(x))
#ifdef CS_FLOAT
#define CS_FUNCTION(name) name##f
#define CS_INFINITY HUGE_VALF
#define CS_DIGITS 24
#define CS_LEAST FLT_MIN
#define CS_SPLIT 4097 /* 2^12 + 1 */
#else
#define CS_FUNCTION(name) name
#define CS_INFINITY HUGE_VAL
#define CS_DIGITS 53
#define CS_LEAST DBL_MIN
#define CS_SPLIT 134217729 /* 2^27 + 1 */
#endif
#define CS_ABS(x) (CS_FUNCTION(fabs)(x))
#define CS_SQRT(x) (CS_FUNCTION(sqrt)(x))
#define CS_MANY 1000000000 /* ticks: a counter goes no further */

/* cs_math.c */
cs_real cs_min(cs_real a, cs_real b);
cs_real cs_max(cs_real a, cs_real b);
int32_t cs_later(int32_t ticks, int32_t passed);
int64_t cs_periods(int64_t now, int32_t period);
bool cs_within(cs_real velocity, cs_real low, cs_real high, cs_real minimum, cs_real *out);
void cs_sum_add(cs_sum *s, cs_real x);
cs_real cs_sum_value(const cs_sum *s);
cs_real cs_hypot(cs_real a, cs_real b);

/* cs_filter.c */
bool cs_moves(int32_t state);
void cs_sway_step(cs_real *angle, cs_real *rate, const cs_axis_config *c, cs_real velocity);
cs_real cs_filter_step(cs_axis *a, const cs_axis_config *c, cs_real command);
cs_real cs_reference(cs_axis *a, const cs_axis_config *c, cs_real demand, cs_real added);
void cs_transfer_entered(cs_axis *a, int32_t old);

/* cs_limits.c */
void cs_demand_clear(cs_axis *a);
void cs_demand_clear_against(cs_axis *a, cs_real held);
void cs_demand_add(cs_axis *a, const cs_axis_config *c, cs_real demand, bool driven);
void cs_demand_age(cs_axis *a, const cs_axis_config *c, int32_t ticks);
void cs_allowed_range(const cs_axis *a, const cs_axis_config *c, cs_real *low, cs_real *high);
cs_real cs_rate_limited(cs_real target, cs_real last, const cs_axis_config *c);
cs_real cs_velocity(const cs_axis_config *c, cs_real command);
void cs_on_grid(cs_output *out, const cs_axis_config *c, cs_real low, cs_real high);
cs_real cs_small_stroke(cs_axis *a, const cs_axis_config *c, cs_real command, cs_real target, cs_real low, cs_real high);

/* cs_output.c */
bool cs_output_drive(cs_axis *a, const cs_axis_config *c, cs_real demand, cs_real reference, cs_real path);
void cs_output_stop_against(cs_axis *a, const cs_axis_config *c, cs_real held);
void cs_output_rest(cs_axis *a, const cs_axis_config *c);
void cs_output_hold(cs_axis *a, const cs_axis_config *c, cs_real demand, int32_t ticks);
void cs_output_drop_added(cs_axis *a);

/* cs_states.c, cs_axis.c */
void cs_states_step(cs_axis *a, const cs_axis_config *c, const cs_input *in, bool at_rest, bool added);
void cs_axis_init(cs_axis *a, const cs_axis_config *c);
void cs_axis_act(cs_axis *a, const cs_axis_config *c, const cs_input *in);
void cs_axis_advance(cs_axis *a, const cs_axis_config *c);
void cs_axis_hold(cs_axis *a, const cs_axis_config *c, int32_t ticks);

/* cs_input.c */
int32_t cs_field_read(const cs_field *f, const uint8_t *data);
void cs_field_write(const cs_field *f, uint8_t *data, int32_t value);
bool cs_fresh(int64_t since_ns, int64_t now_ns, int64_t timeout_ns);
void cs_message_init(cs_message *m);
bool cs_message_is(const cs_message_config *c, int32_t bus, uint32_t id, bool extended, int32_t length);
void cs_radius_receive(cs_motion *m, const cs_motion_config *c, const uint8_t *data, int64_t now_ns);
void cs_joystick_init(cs_joystick *j, const cs_joystick_config *c);
void cs_joystick_receive(cs_joystick *j, const cs_joystick_config *c, const uint8_t *data, int64_t now_ns);
cs_input cs_joystick_command(const cs_joystick *j, const cs_joystick_config *c, const cs_axis_config *axis,
                             int64_t now_ns, int64_t releases);

/* cs_motion.c */
void cs_motion_step(cs_controller *s, const cs_config *c, int32_t motion, int64_t now_ns, int64_t last, int64_t now);
void cs_motion_tripped(cs_controller *s, const cs_config *c, int32_t axis);

#endif
