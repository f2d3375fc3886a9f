/* Starts the program on a Cortex-M, and speaks to a debugger, or QEMU, by semihosting. */
#include <stdint.h>
#include <string.h>

#include "start.h"

#define SYS_WRITE0 0x04
#define SYS_EXIT 0x18
#define STOPPED_RUN_TIME_ERROR 0x20023
#define STOPPED_APPLICATION_EXIT 0x20026

extern uint32_t stack_top, data_begin, data_end, data_kept, bss_begin, bss_end;

static void semihost(uint32_t operation, uintptr_t argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register uintptr_t r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
}

void say(const char *text) { semihost(SYS_WRITE0, (uintptr_t)text); }

static void leave(int status)
{
    for (;;)
        semihost(SYS_EXIT, status == 0 ? STOPPED_APPLICATION_EXIT : STOPPED_RUN_TIME_ERROR);
}

static void reset(void)
{
    memcpy(&data_begin, &data_kept, (size_t)((uintptr_t)&data_end - (uintptr_t)&data_begin));
    memset(&bss_begin, 0, (size_t)((uintptr_t)&bss_end - (uintptr_t)&bss_begin));
    leave(run());
}

static void fault(void)
{
    say("fault\n");
    leave(1);
}

__attribute__((section(".vectors"), used)) static const void *const VECTORS[] = {&stack_top, (const void *)reset, (const void *)fault,
                                                                                (const void *)fault};
