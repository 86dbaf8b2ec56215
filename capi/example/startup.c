/* Vector table and start of a Cortex-M4F program. */
#include <stdint.h>

extern uint32_t stack_top, data_start, data_end, bss_start, bss_end;
extern const uint32_t data_source;
int main(void);

static void stop(void) {
    for (;;) {
    }
}

void reset(void) {
    /* CPACR: full access to the floating-point unit. */
    *(volatile uint32_t *)0xE000ED88u |= 0xFu << 20;
    __asm__ volatile("dsb\nisb" ::: "memory");
    const uint32_t *from = &data_source;
    for (uint32_t *to = &data_start; to < &data_end;) {
        *to++ = *from++;
    }
    for (uint32_t *to = &bss_start; to < &bss_end;) {
        *to++ = 0;
    }
    main();
    stop();
}

__attribute__((section(".vectors"), used)) static const uintptr_t vectors[16] = {
    (uintptr_t)&stack_top, (uintptr_t)reset, (uintptr_t)stop, (uintptr_t)stop,
    (uintptr_t)stop,       (uintptr_t)stop,  (uintptr_t)stop,
};
