/* Measures of a drive; cs_plant.c drives. */
#ifndef CS_MEASURE_H
#define CS_MEASURE_H

#include "canshaper.h"

enum { SLEW, NEAR_FAR, LIFT, COORDINATES };
/* Columns of what is measured, each of all ticks. */
enum {
    JOYSTICK, SENT = COORDINATES, SPEED = 2 * COORDINATES, TIP_X = 3 * COORDINATES, TIP_Y, SWING, FASTEST, COLUMNS
};
enum { STILL, RESIDUAL, PEAK, RUN_ON_S, RUN_ON_M, TRAVEL_ERROR, DIP, SWUNG_OVER, MEASURES };

/* axis: that of each coordinate, or CS_NONE. */
typedef struct { int32_t axis[COORDINATES]; int64_t tick_ms; double dwell_s, still_deg; } drive_look;

/* Measure n ticks of columns. NAN: there is nothing to measure it by. */
void cs_measure(const drive_look *d, double *const *out, int32_t n, double *measures);

#endif
