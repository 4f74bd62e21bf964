/* Interface between cs_fmu.c, which has FMI 3.0, and a unit of co-simulation: the controller, or the plant. */
#ifndef CS_FMU_H
#define CS_FMU_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Written for one machine: CS_UNIT_TOKEN, CS_UNIT_TICK_NS, CS_UNIT_INPUTS, and CS_UNIT_VALUES with CS_UNIT_START. A
   value reference is a place in the values: first the time, then the inputs, then the outputs. */
#include "cs_unit.h"

extern const size_t cs_unit_size; /* bytes of its state, all 0 before it begins */

/* Begin. Returns why it cannot, or NULL. */
const char *cs_unit_begin(void *state);

/* Run a tick, the first one is 0: inputs to outputs. Returns why it cannot, or NULL. */
const char *cs_unit_tick(void *state, int64_t tick, double *value);

#endif
