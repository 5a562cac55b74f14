/// The processor's own registers, and sleep.
#pragma once

#include "hal/common/mmio.hpp"
#include "hal/mps2/registers.hpp"

namespace hal::mps2 {

struct SystemControl : Mmio<kSystemControl> {
    static void hold_interrupts() { asm volatile("cpsid i" ::: "memory"); }
    static void release_interrupts() { asm volatile("cpsie i\n isb" ::: "memory"); }
    /// Sleeps until any interrupt is pending, held or not.
    static void wait_for_interrupt() { asm volatile("dsb\n wfi" ::: "memory"); }
    static void enable_irq(std::uint32_t irq) {
        write(scs_reg::kNvicIser0 + 4 * (irq / 32), 1U << (irq % 32));
    }
};

}  // namespace hal::mps2
