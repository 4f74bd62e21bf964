/* Whether a build computes as the tables were made for: a few answers that another one misses. */
#include <float.h>

#include "cs_internal.h"

/* Not known before it runs, so that the compiler computes nothing of it itself. */
static cs_real hidden(cs_real x)
{
    volatile cs_real v = x;
    return v;
}

bool cs_arithmetic(void)
{
    cs_real unit = CS_FUNCTION(ldexp)(1, -CS_DIGITS); /* half of the last digit of 1 */
    cs_real half = 1 + CS_FUNCTION(ldexp)(1, -((CS_DIGITS + 1) / 2));
    cs_real a = hidden(half);
    cs_real one = hidden(1);
    cs_real none = hidden(CS_INFINITY) - hidden(CS_INFINITY);
    bool small = (hidden(CS_LEAST) / 2) != 0; /* a small one is not rounded to 0 */
    bool digits = (FLT_EVAL_METHOD == 0) && (FLT_RADIX == 2) && (((one + unit) + unit) == one);
    bool contracted = ((a * a) - hidden(half * half)) != 0; /* the product would keep its digits */
    bool even = (CS_FUNCTION(rint)(hidden(CS_R(2.5))) == 2) && (CS_FUNCTION(rint)(hidden(CS_R(-1.5))) == -2);
    bool roots = (CS_SQRT(hidden(2)) == CS_R(0x1.6a09e667f3bcdp+0)) && (cs_hypot(hidden(3), hidden(4)) == 5);
    return digits && small && !contracted && even && roots && (isfinite(none) == 0) && !(none == none);
}
