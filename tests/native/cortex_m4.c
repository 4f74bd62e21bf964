/* Where a Cortex-M4F begins: its stack, then the floating point unit on and the C library's start; and how many
   instructions a tick takes there, with the frames that came before it. */
#include <stdio.h>

#include "cs_selftest.h"

#define COUNTER ((volatile uint32_t *)0xE000E010u) /* SysTick, down from 24 bits with 25 MHz */
#define BITS 0xFFFFFFu
#define INSTRUCTIONS 40u /* in a count: -icount shift=0 is one each ns */

extern void _start(void);
static uint64_t sum;
static uint32_t spent, ticks, worst[2]; /* none was missed; some were */

static void reset(void)
{
    *(volatile unsigned int *)0xE000ED88u |= 0xFu << 20; /* CPACR: coprocessors 10 and 11 */
    __asm volatile("dsb\n\tisb");
    COUNTER[1] = BITS;
    COUNTER[0] = 5u;
    _start();
}

__attribute__((section(".vectors"), used)) static void (*const vectors[])(void) = {(void (*)(void))0x20400000u, reset};

void __real_cs_receive(cs_controller *s, const cs_config *c, int32_t bus, uint32_t id, bool extended,
                       const uint8_t *data, int32_t length, int64_t arrived_ns);
void __wrap_cs_receive(cs_controller *s, const cs_config *c, int32_t bus, uint32_t id, bool extended,
                       const uint8_t *data, int32_t length, int64_t arrived_ns)
{
    uint32_t begin = COUNTER[2];
    __real_cs_receive(s, c, bus, id, extended, data, length, arrived_ns);
    spent += (begin - COUNTER[2]) & BITS;
}

int32_t __real_cs_tick(cs_controller *s, const cs_config *c, int64_t now_ns, int32_t missed, cs_frame *out);
int32_t __wrap_cs_tick(cs_controller *s, const cs_config *c, int64_t now_ns, int32_t missed, cs_frame *out)
{
    uint32_t begin = COUNTER[2], *most = &worst[missed > 0];
    int32_t n = __real_cs_tick(s, c, now_ns, missed, out);
    spent += (begin - COUNTER[2]) & BITS;
    *most = (spent > *most) ? spent : *most;
    sum += spent;
    ticks++;
    spent = 0;
    return n;
}

int32_t __real_cs_selftest(const cs_config *c, cs_real *largest);
int32_t __wrap_cs_selftest(const cs_config *c, cs_real *largest)
{
    int32_t first = __real_cs_selftest(c, largest);
    (void)printf("state %u bytes, instructions a tick: mean %u, worst %u, after missed ticks %u\n",
                 (unsigned)sizeof(cs_controller), (unsigned)((sum * INSTRUCTIONS) / ((ticks > 0u) ? ticks : 1u)),
                 (unsigned)(worst[0] * INSTRUCTIONS), (unsigned)(worst[1] * INSTRUCTIONS));
    return first;
}
