/* The golden drive: frames in, frames out, inner states. cs_golden.c has the numbers. */
#ifndef CS_SELFTEST_H
#define CS_SELFTEST_H

#include "canshaper.h"

/* The inner state as a row of numbers, in the order of canshaper/native/drive.py. Returns how many there are. */
int32_t cs_inspect_size(void); /* bytes of cs_controller */
int32_t cs_inspect_axis(const cs_controller *s, int32_t axis, cs_real *out);
int32_t cs_inspect_motion(const cs_controller *s, int32_t motion, cs_real *out);

/* A tick: how many frames came before it and leave with it; failed: a valve whose frame did not leave, or CS_NONE. */
typedef struct { int64_t now_ns; int32_t missed, in_n, out_n, failed; } cs_golden_tick;

extern const cs_golden_tick cs_golden_ticks[];
extern const cs_frame cs_golden_in[], cs_golden_out[];
extern const cs_real cs_golden_rows[]; /* of all axes, then of all motions, after every so many ticks */
extern const int32_t cs_golden_n, cs_golden_every, cs_golden_atan2_n;
extern const cs_real cs_golden_atan2[][3]; /* y, x, and what the library of the desk gave */

/* Replay the golden drive. Returns CS_NONE, or the number of the first tick that gives something else. Where atan2 of
   the target's library differs in its last bit, a state may differ from the golden one by rounding (largest). */
int32_t cs_selftest(const cs_config *c, cs_real *largest);

#endif
