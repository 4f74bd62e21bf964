/* A number into the frame that its sender would send, for simulations: no target of an export needs it. */
#ifndef CS_NUMBER_H
#define CS_NUMBER_H

#include "cs_internal.h"

/* The raw value nearest to a value; what the field does not hold is the end of it. */
static inline void cs_number_write(const cs_number_config *c, uint8_t *data, double value)
{
    int32_t codes = (int32_t)1 << c->field.length, least = c->field.is_signed ? -(codes / 2) : 0;
    double raw = rint(((value * (double)c->full) - (double)c->offset) / (double)c->scale);
    cs_field_write(&c->field, data, (int32_t)fmin(fmax(raw, (double)least), (double)(least + codes - 1)));
}

#endif
