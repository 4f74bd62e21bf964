/* ./selftest: exit code 0 where this build computes as the desk has. */
#include <stdio.h>

#include "cs_selftest.h"

int main(void)
{
    cs_real largest;
    int32_t first = cs_selftest(&cs_tables, &largest);
    if (!cs_arithmetic()) { (void)puts("canshaper selftest: FAILED, another arithmetic: see README.md"); }
    else if (first == CS_NONE) {
        (void)printf("canshaper selftest: %ld ticks equal, largest difference of a state %g\n", (long)cs_golden_n,
                     (double)largest);
    } else { (void)printf("canshaper selftest: FAILED, tick %ld differs\n", (long)first); }
    return (first == CS_NONE) ? 0 : 1;
}
