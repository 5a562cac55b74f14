/// Time from the processor's SysTick timer; a CMSDK timer wakes it from sleep.
#pragma once

#include <cstdint>

#include "hal/common/mmio.hpp"
#include "hal/contract/clock.hpp"
#include "hal/mps2/registers.hpp"

namespace hal::mps2 {

/// SysTick counts all its 24 bits down at the processor clock and is extended to 64 bits at each look, so it
/// must be looked at once a turn, 0.67 s. Microseconds are derived from the count since start, never added
/// up: no drift.
template <RegisterBlock SystemControl, RegisterBlock Timer>
class SysTickClock final : public Clock {
  public:
    SysTickClock(SystemControl system, Timer timer) : system_(system), timer_(timer) {}

    void start() {
        using namespace scs_reg;
        timer_.write(timer_reg::kCtrl, 0);
        timer_.write(timer_reg::kIntclear, 1);
        system_.write(kSystCsr, 0);
        system_.write(kSystRvr, kMask);
        system_.write(kSystCvr, 0);  // any write clears it; the next clock loads the reload value
        system_.write(kSystCsr, kSystEnable | kSystProcessorClock);
        last_ = system_.read(kSystCvr) & kMask;
        ticks_ = 0;
    }

    /// Processor clocks since start.
    std::uint64_t now_ticks() {
        const std::uint32_t value = system_.read(scs_reg::kSystCvr) & kMask;
        ticks_ += (last_ - value) & kMask;
        last_ = value;
        return ticks_;
    }

    std::uint64_t now_us() override { return now_ticks() / kTicksPerUs; }

    /// Sleeps; interrupts are served meanwhile.
    void wait_until(std::uint64_t time_us) override {
        using namespace timer_reg;
        const std::uint64_t until = time_us * kTicksPerUs;
        for (std::uint64_t now = now_ticks(); now < until; now = now_ticks()) {
            const std::uint64_t rest = until - now;
            const auto sleep = static_cast<std::uint32_t>(rest < kLongestSleep ? rest : kLongestSleep);
            if (sleep < kShortestSleep) continue;
            system_.hold_interrupts();  // an alarm before the sleep must end it, not be over by then
            timer_.write(kReload, sleep);
            timer_.write(kValue, sleep);
            timer_.write(kCtrl, kCtrlEnable | kCtrlInterrupt);
            system_.wait_for_interrupt();
            timer_.write(kCtrl, 0);
            system_.release_interrupts();
        }
    }

    /// Some 10 us without a look at any device, so that polling does not take the bus from others.
    static void pause() {
        for (int i = 0; i < 10; ++i) asm volatile(".rept 25\n nop\n .endr");
    }

    /// The timer's interrupt: it did its work by ending the sleep.
    void on_alarm() {
        timer_.write(timer_reg::kCtrl, 0);
        timer_.write(timer_reg::kIntclear, 1);
    }

  private:
    static constexpr std::uint32_t kMask = 0x00FF'FFFF;
    static constexpr std::uint32_t kTicksPerUs = kClockHz / 1'000'000;
    static constexpr std::uint32_t kLongestSleep =
        kMask / 2;                                        ///< SysTick must be looked at before it turned over
    static constexpr std::uint32_t kShortestSleep = 100;  ///< below that, setting the alarm takes longer
    static_assert(kTicksPerUs * 1'000'000 == kClockHz);

    SystemControl system_;
    Timer timer_;
    std::uint32_t last_ = 0;
    std::uint64_t ticks_ = 0;
};

}  // namespace hal::mps2
