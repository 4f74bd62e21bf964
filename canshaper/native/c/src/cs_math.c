/* Sums and roots that are right to the last bit, and comparisons with the answers of Python's. */
#include "cs_internal.h"

cs_real cs_min(cs_real a, cs_real b) { return (b < a) ? b : a; }
cs_real cs_max(cs_real a, cs_real b) { return (b > a) ? b : a; }

/* Count ticks, but never beyond CS_MANY: a machine may rest for years. */
int32_t cs_later(int32_t ticks, int32_t passed)
{
    int64_t sum = (int64_t)ticks + passed;
    sum = (sum > CS_MANY) ? CS_MANY : sum;
    return (int32_t)((sum < -CS_MANY) ? -CS_MANY : sum);
}

/* Number of the period that a tick is in; ticks begin at -1. */
int64_t cs_periods(int64_t now, int32_t period) { return (now < 0) ? -1 : (now / period); }

/* Clip to [low, high]; below minimum in magnitude the result is zero. False: the velocity is no number. */
bool cs_within(cs_real velocity, cs_real low, cs_real high, cs_real minimum, cs_real *out)
{
    bool ok = isfinite(velocity) != 0;
    cs_real clipped = (velocity < low) ? low : ((velocity > high) ? high : velocity);
    *out = (ok && (CS_ABS(clipped) >= minimum)) ? clipped : CS_R(0);
    return ok;
}

/* Add without an error (Shewchuk 1997). */
void cs_sum_add(cs_sum *s, cs_real x)
{
    cs_real sum = x;
    int32_t kept = 0;
    for (int32_t i = 0; i < s->n; i++) {
        cs_real part = s->part[i];
        bool swap = CS_ABS(sum) < CS_ABS(part);
        cs_real large = swap ? part : sum;
        cs_real small = swap ? sum : part;
        sum = large + small;
        small -= sum - large;
        if (small != 0) {
            s->part[kept] = small;
            kept++;
        }
    }
    if ((sum != 0) && (kept < CS_PARTS)) {
        s->part[kept] = sum;
        kept++;
    }
    s->n = kept;
}

/* A sum, rounded once: half-way cases look at the sign of the part below. */
cs_real cs_sum_value(const cs_sum *s)
{
    int32_t n = s->n - 1;
    cs_real high = (n >= 0) ? s->part[n] : CS_R(0);
    cs_real low = 0;
    while ((n > 0) && (low == 0)) {
        cs_real before = high;
        n--;
        high = before + s->part[n];
        low = s->part[n] - (high - before);
    }
    if ((n > 0) && (((low < 0) && (s->part[n - 1] < 0)) || ((low > 0) && (s->part[n - 1] > 0)))) {
        cs_real next = high + (low * 2);
        if ((low * 2) == (next - high)) { high = next; }
    }
    return high;
}

/* a * a as high + low, without an error (Dekker 1971). */
static cs_real square(cs_real a, cs_real *low)
{
    cs_real t = a * CS_R(CS_SPLIT);
    cs_real ah = t - (t - a);
    cs_real al = a - ah;
    cs_real high = a * a;
    *low = (((ah * ah) - high) + (2 * ah * al)) + (al * al);
    return high;
}

/* Root of a^2 + b^2 as Python's math.hypot, which is not that of C: one correction by the exact remainder. */
cs_real cs_hypot(cs_real a, cs_real b)
{
    int exponent = 0;
    cs_real largest = CS_FUNCTION(frexp)(cs_max(CS_ABS(a), CS_ABS(b)), &exponent);
    cs_real x[3] = {CS_FUNCTION(ldexp)(a, -exponent), CS_FUNCTION(ldexp)(b, -exponent), 0};
    cs_real sum = 1;
    cs_real products = 0; /* what rounding has left out of the products, and of the sums */
    cs_real sums = 0;
    for (int32_t i = 0; i < 3; i++) { /* at last the root so far is taken off again */
        cs_real low;
        cs_real high = square(x[i], &low) * ((i == 2) ? -1 : 1);
        cs_real before = sum;
        sum = before + high;
        products += (i == 2) ? -low : low;
        sums += high - (sum - before);
        if (i == 1) { x[2] = CS_SQRT((sum - 1) + (products + sums)); }
    }
    if (largest > 0) { x[2] += ((sum - 1) + (products + sums)) / (2 * x[2]); }
    return CS_FUNCTION(ldexp)(x[2], exponent);
}
