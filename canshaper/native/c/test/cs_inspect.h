#ifndef CS_INSPECT_H
#define CS_INSPECT_H

#include "canshaper.h"

#define CS_N(x) ((cs_real)(x))
#define CS_ROW 40 /* numbers of an axis */

int32_t cs_inspect_size(void);
int32_t cs_inspect_axis(const cs_controller *s, int32_t axis, cs_real *out);
int32_t cs_inspect_motion(const cs_controller *s, int32_t motion, cs_real *out);

#endif
