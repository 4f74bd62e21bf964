/* Where a Cortex-M4F begins: its stack, then the floating point unit on and the C library's start. */
extern void _start(void);

static void reset(void)
{
    *(volatile unsigned int *)0xE000ED88u |= 0xFu << 20; /* CPACR: coprocessors 10 and 11 */
    __asm volatile("dsb\n\tisb");
    _start();
}

__attribute__((section(".vectors"), used)) static void (*const vectors[])(void) = {(void (*)(void))0x20400000u, reset};
