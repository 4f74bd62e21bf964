/* Replays the golden drive; no part of the controller. */
#include <math.h>
#include <string.h>

#include "cs_selftest.h"

#define AGE_NS 1000 /* of a frame when it is read */
#define ROUNDING ((cs_real)1e-9)
#define MOST_ROW 64

static bool same_library(void)
{
    bool same = true;
    for (int32_t i = 0; i < cs_golden_atan2_n; i++) {
        const cs_real *one = cs_golden_atan2[i];
        volatile cs_real angle = (sizeof(cs_real) == sizeof(float)) ? (cs_real)atan2f((float)one[0], (float)one[1])
                                                                    : (cs_real)atan2((double)one[0], (double)one[1]);
        same = same && (angle == one[2]);
    }
    return same;
}

static bool equal_rows(const cs_real *row, const cs_real *golden, int32_t n, cs_real most, cs_real *largest)
{
    bool equal = true;
    for (int32_t i = 0; i < n; i++) {
        cs_real error = (row[i] == golden[i]) ? (cs_real)0 : (cs_real)fabs((double)(row[i] - golden[i]));
        if (error > *largest) { *largest = error; }
        equal = equal && (error <= most);
    }
    return equal;
}

int32_t cs_selftest(const cs_config *c, cs_real *largest)
{
    static cs_controller crane;
    const cs_frame *in = cs_golden_in;
    const cs_frame *golden = cs_golden_out;
    const cs_real *rows = cs_golden_rows;
    const cs_real most = same_library() ? (cs_real)0 : ROUNDING;
    int32_t first = cs_arithmetic() ? CS_NONE : 0;
    *largest = 0;
    cs_init(&crane, c);
    for (int32_t k = 0; (k < cs_golden_n) && (first == CS_NONE); k++) {
        const cs_golden_tick *t = &cs_golden_ticks[k];
        cs_frame out[CS_VALVES];
        cs_real row[MOST_ROW];
        if (t->failed != CS_NONE) { cs_send_failed(&crane, c, t->failed); }
        for (int32_t i = 0; i < t->in_n; i++) {
            cs_receive(&crane, c, in->bus, in->id, in->extended, in->data, in->length, t->now_ns - AGE_NS);
            in++;
        }
        bool equal = cs_tick(&crane, c, t->now_ns, t->missed, out) == t->out_n;
        for (int32_t i = 0; (i < t->out_n) && equal; i++) {
            equal = (out[i].bus == golden->bus) && (out[i].id == golden->id) && (out[i].length == golden->length) &&
                    (memcmp(out[i].data, golden->data, (size_t)golden->length) == 0);
            golden++;
        }
        if ((k % cs_golden_every) == 0) {
            for (int32_t i = 0; i < (c->axes_n + c->motions_n); i++) {
                int32_t n = (i < c->axes_n) ? cs_inspect_axis(&crane, i, row)
                                            : cs_inspect_motion(&crane, i - c->axes_n, row);
                equal = equal_rows(row, rows, n, most, largest) && equal;
                rows += n;
            }
        }
        if (!equal) { first = k; }
    }
    return first;
}
