/* Measures of a drive: the same operations in the same order as strokes.py and stroke_metrics.py of canshaper/report,
   so that they are equal to the last bit. */
#include "cs_internal.h"
#include "cs_measure.h"

static double time_of(const drive_look *d, int32_t k) { return (double)(k * d->tick_ms) / 1000.0; }
static int32_t side(double joystick) { return (fabs(joystick) <= 0.02) ? 0 : ((joystick > 0.0) ? 1 : -1); }
static void largest(double *most, double value) { *most = (isnan(*most) || (value > *most)) ? value : *most; }

/* Seconds from the first tick of a rest until a value stays below, or to its end. */
static double until_below(const drive_look *d, const double *value, int32_t first, int32_t end, double level)
{
    int32_t above = end - 1;
    while ((above >= first) && !(value[above] >= level)) { above--; }
    if (above < first) { return 0.0; }
    double at = time_of(d, above);
    if (above < (end - 1)) {
        double share = (level - value[above]) / (value[above + 1] - value[above]);
        at += share * (time_of(d, above + 1) - at);
    }
    return at - time_of(d, first);
}

/* A rest of all joysticks, with the measures of it. */
static void measure_rest(const drive_look *d, double *const *out, int32_t first, int32_t end, double *measures,
                         bool *on)
{
    double still = until_below(d, out[SWING], first, end, d->still_deg);
    double until = time_of(d, end - 1), from = time_of(d, first);
    bool swings_on = (((until - from) - still) < 1.0) && (still > 0.0);
    if (swings_on && !*on) { measures[STILL] = still; }
    else if (swings_on == *on) { largest(&measures[STILL], still); }
    *on = *on || swings_on;
    largest(&measures[RUN_ON_S], until_below(d, out[FASTEST], first, end, 0.05));
    int32_t dwelt = first;
    while ((dwelt < end) && (time_of(d, dwelt) < ((from + d->dwell_s) - 1e-6))) { dwelt++; }
    bool shows = (dwelt < end) && ((until - time_of(d, dwelt)) >= (1.0 - 1e-6));
    for (int32_t k = first; k < end; k++) {
        if (shows && (k >= dwelt)) { largest(&measures[RESIDUAL], out[SWING][k]); }
        largest(&measures[RUN_ON_M], cs_hypot(out[TIP_X][first] - out[TIP_X][k], out[TIP_Y][first] - out[TIP_Y][k]));
    }
}

/* How far the output fell back while a joystick was held: of a stroke until its longest plateau ends. */
static double dip_of(const drive_look *d, const double *joystick, const double *sent, int32_t press, int32_t end)
{
    double most = 0.0, longest = -1.0, sent_most = -HUGE_VAL, held_most = 0.0, dip = 0.0;
    int32_t first = press, last = press;
    for (int32_t k = press; k < end; k++) { most = fmax(most, fabs(joystick[k])); }
    for (int32_t k = press, begin = press; k < end; k++) {
        if (fabs(joystick[k]) < (0.95 * most)) { begin = k + 1; }
        else if (((k + 1) == end) || (fabs(joystick[k + 1]) < (0.95 * most))) {
            double length = time_of(d, k) - time_of(d, begin);
            if (length > longest) {
                longest = length;
                first = begin;
                last = k;
            }
        } else { /* it goes on */ }
    }
    for (int32_t k = press; k <= last; k++) {
        double one = (double)side(joystick[press]) * sent[k], held = fabs(joystick[k]);
        sent_most = fmax(sent_most, one);
        held_most = fmax(held_most, held);
        if (k >= first) { dip = fmax(dip, (sent_most - one) - (held_most - held)); }
    }
    return dip;
}

static bool deflected(double *const *out, int32_t k)
{
    return (side(out[JOYSTICK][k]) != 0) || (side(out[JOYSTICK + 1][k]) != 0) || (side(out[JOYSTICK + 2][k]) != 0);
}

void cs_measure(const drive_look *d, double *const *out, int32_t n, double *measures)
{
    bool on = false, moved = false;
    for (int32_t i = 0; i < MEASURES; i++) { measures[i] = (i < DIP) ? (double)NAN : 0.0; }
    for (int32_t i = 0; i < COORDINATES; i++) {
        const double *joystick = out[JOYSTICK + i];
        if (d->axis[i] == CS_NONE) { continue; }
        double most = cs_tables.axis[d->axis[i]].maximum;
        cs_sum asked = {.n = 0}, way = {.n = 0};
        for (int32_t k = 0; k < n; k++) {
            cs_sum_add(&asked, fmin(fmax(joystick[k], -most), most));
            cs_sum_add(&way, out[SPEED + i][k]);
        }
        double error = fabs(cs_sum_value(&way) - cs_sum_value(&asked));
        largest(&measures[TRAVEL_ERROR], error * ((double)d->tick_ms / 1000.0));
        for (int32_t k = 0, end; k < n; k = end) {
            for (end = k + 1; (end < n) && (side(joystick[end]) == side(joystick[k])); end++) { }
            if (side(joystick[k]) != 0) { largest(&measures[DIP], dip_of(d, joystick, out[SENT + i], k, end)); }
        }
    }
    for (int32_t k = 0, end; k < n; k = end) {
        bool held = deflected(out, k);
        for (end = k + 1; (end < n) && (deflected(out, end) == held); end++) { }
        if (!held && moved && ((end - k) > 1)) { measure_rest(d, out, k, end, measures, &on); }
        moved = moved || held;
    }
    for (int32_t k = 0; k < n; k++) { largest(&measures[PEAK], out[SWING][k]); }
    measures[DIP] *= 100.0;
}
