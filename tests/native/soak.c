/* A random drive of any tables, without Python: builds of other compilers and processors have to give the same.

   ./soak TICKS SEED prints hashes of all valve frames and of the inner states, with how many frames moved a valve and
   which states were seen. Frames are good, wrong or hostile: any length and bits, strange ids, times out of order. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cs_number.h"
#include "cs_selftest.h"

#define BYTES 64 /* of a frame of CAN FD */
#define STATES_EVERY 16

static uint64_t seed;
static uint64_t frames_hash = 0xcbf29ce484222325u, states_hash = 0xcbf29ce484222325u;

static uint32_t any(void)
{
    seed ^= seed << 13;
    seed ^= seed >> 7;
    seed ^= seed << 17;
    return (uint32_t)(seed >> 32);
}
static bool one_in(uint32_t n) { return (any() % n) == 0u; }

static void hash(uint64_t *h, const void *data, size_t n)
{
    for (size_t i = 0; i < n; i++) { *h = (*h ^ ((const uint8_t *)data)[i]) * 0x100000001b3u; }
}

/* Motion of a hand at a joystick, and state of its sender. */
typedef struct {
    cs_real wanted[CS_NUMBERS], held[CS_NUMBERS];
    int32_t count, silent, resting, enable, reset, off;
} hand;

static void move(hand *h, int32_t numbers)
{
    h->resting = one_in(250) ? (int32_t)(20 + (any() % 130)) : (h->resting - 1);
    for (int32_t i = 0; i < numbers; i++) {
        if (h->resting > 0) { h->wanted[i] = one_in(50) ? CS_R(0.3) : CS_R(0); }
        else if (one_in(33)) {
            const cs_real some = (CS_R(any() % 2001) - 1000) / 1000;
            const cs_real choice[6] = {0, 0, 1, -1, some, some / 10};
            h->wanted[i] = choice[any() % 6];
        }
        h->held[i] += cs_max(cs_min(h->wanted[i] - h->held[i], CS_R(0.2)), CS_R(-0.2));
    }
    if (one_in(300)) { h->enable = (int32_t)(any() % 4); }
    else if (one_in(10)) { h->enable = 1; }
    h->off ^= one_in(300) ? 1 : 0;
    h->reset ^= one_in(100) ? 1 : 0;
    if (one_in(1000)) { h->count += (int32_t)(any() % 9); }
}

static void receive(cs_controller *s, const cs_message_config *m, uint8_t *data, int64_t now)
{
    if (one_in(500)) {
        for (int32_t i = 0; i < BYTES; i++) { data[i] = (uint8_t)any(); }
    }
    const int32_t length = one_in(500) ? (int32_t)(any() % (BYTES + 1)) : m->length;
    const int64_t strange[4] = {CS_NEVER, INT64_MAX, CS_NEVER + 1, now - 1000000000};
    const int64_t at = one_in(20000) ? strange[any() % 4] : (now - 1000);
    cs_receive(s, &cs_tables, m->bus, m->id, m->extended, data, length, at);
}

static void receive_all(cs_controller *s, hand *hands, cs_real *radius_m, int64_t now)
{
    for (int32_t i = 0; i < cs_tables.joysticks_n; i++) {
        const cs_joystick_config *c = &cs_tables.joystick[i];
        hand *h = &hands[i];
        uint8_t data[BYTES] = {0};
        h->count++;
        if (one_in(1000)) { h->silent = (int32_t)(1 + (any() % 15)); }
        if (h->silent-- > 0) { continue; }
        h->silent = 0;
        move(h, c->numbers_n);
        cs_field_write(&c->enable, data, h->enable);
        cs_field_write(&c->reset, data, h->reset);
        cs_field_write(&c->off, data, h->off);
        cs_field_write(&c->message.counter, data, h->count);
        for (int32_t k = 0; k < c->numbers_n; k++) { cs_number_write(&c->number[k], data, h->held[k]); }
        receive(s, &c->message, data, now);
    }
    for (int32_t i = 0; i < cs_tables.motions_n; i++) {
        const cs_motion_config *c = &cs_tables.motion[i];
        uint8_t data[BYTES] = {0};
        *radius_m += (CS_R(any() % 2001) - 1000) / 100000;
        *radius_m = cs_max(cs_min(*radius_m, c->radius.high), c->radius.low);
        cs_number_write(&c->radius, data, *radius_m);
        if (c->measured && !one_in(33)) { receive(s, &c->message, data, now); }
    }
    if (one_in(2000)) {
        const cs_valve_config *v = &cs_tables.valve[any() % (uint32_t)cs_tables.valves_n];
        uint8_t data[BYTES] = {0};
        const uint32_t id = v->id ^ (one_in(2) ? 1u << 11 : 0u);
        cs_receive(s, &cs_tables, v->bus, id, v->extended, data, (int32_t)(any() % (BYTES + 1)), now);
    }
}

int main(int argc, char **argv)
{
    static cs_controller crane;
    static hand hands[CS_JOYSTICKS];
    const int32_t missed_by[8] = {1, 1, 2, 2, 5, -1, 3000, INT32_MAX};
    const int64_t ticks = (argc > 2) ? atoll(argv[1]) : 0;
    cs_real radius_m = 6;
    int64_t now = 1000000000, moved = 0;
    uint32_t states = 0;
    seed = (argc > 2) ? (uint64_t)atoll(argv[2]) : 1u;
    for (int32_t i = 0; i < 20; i++) { (void)any(); }
    cs_init(&crane, &cs_tables);
    for (int64_t k = 0; k < ticks; k++) {
        cs_frame out[CS_VALVES];
        cs_real row[64];
        const int32_t missed = one_in(300) ? missed_by[any() % (one_in(100) ? 8u : 5u)] : 0;
        now += cs_tables.tick_ns * ((missed > 0) ? ((missed % 10) + 1) : 1);
        if (one_in(5000)) { now += cs_tables.tick_ns * ((int64_t)(any() % 200u) - 100); }
        const int64_t strange[4] = {CS_NEVER, INT64_MAX, 0, -now};
        const int64_t at = one_in(20000) ? strange[any() % 4u] : now;
        if (one_in(3000)) { cs_send_failed(&crane, &cs_tables, (int32_t)(any() % 8u) - 2); }
        receive_all(&crane, hands, &radius_m, now);
        const int32_t n = cs_tick(&crane, &cs_tables, at, missed, out);
        for (int32_t i = 0; i < n; i++) { hash(&frames_hash, out[i].data, CS_BYTES); }
        for (int32_t i = 0; i < cs_tables.axes_n; i++) {
            moved += (crane.axis[i].out.steps != 0) ? 1 : 0;
            states |= 1u << (uint32_t)crane.axis[i].state;
        }
        for (int32_t i = 0; ((k % STATES_EVERY) == 0) && (i < (cs_tables.axes_n + cs_tables.motions_n)); i++) {
            const int32_t of = i - cs_tables.axes_n;
            const int32_t wide = (of < 0) ? cs_inspect_axis(&crane, i, row) : cs_inspect_motion(&crane, of, row);
            hash(&states_hash, row, (size_t)wide * sizeof(row[0]));
        }
    }
    (void)printf("frames %016llx states %016llx moved %lld seen %x\n", (unsigned long long)frames_hash,
                 (unsigned long long)states_hash, (long long)moved, (unsigned)states);
    return cs_arithmetic() ? 0 : 1;
}
