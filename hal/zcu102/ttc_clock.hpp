/// Time from a triple timer counter (TTC).
#pragma once

#include <cstdint>

#include "hal/common/mmio.hpp"
#include "hal/contract/clock.hpp"
#include "hal/zcu102/registers.hpp"

namespace hal::zcu102 {

struct TtcConfig {
    std::uint32_t reference_hz = kReferenceHz;  ///< LPD_LSBUS_CLK
    /// The reference clock is divided by 2^prescaler_log2. 4: a count is 0.16 us and the board's 32 bits turn
    /// over in 11 minutes.
    std::uint32_t prescaler_log2 = 4;
    /// Of a counter with 16 bits, as the emulator's. 15: a count is 0.25 ms, and a turn 16 s, longer than a
    /// busy PC lets an emulated processor wait. With less than 14 the emulator's timer, under -icount, stops
    /// time for good at a turn: it rounds what is left to 0 ns.
    std::uint32_t narrow_prescaler_log2 = 15;

    [[nodiscard]] constexpr bool valid() const {
        return reference_hz >= 1'000'000 && prescaler_log2 >= 1 && prescaler_log2 <= 16 &&
               narrow_prescaler_log2 >= 1 && narrow_prescaler_log2 <= 16;
    }
};
static_assert(TtcConfig{}.valid());

/// The clock the timers run on. The emulator knows no clock block, which then reads as zero, and runs its
/// timers at 133 MHz.
inline std::uint32_t timer_reference_hz() {
    return Mmio<kCrlApb>::read(crl_reg::kLpdLsbusCtrl) == 0 ? 133'000'000 : kReferenceHz;
}

/// The counter runs freely and is extended to 64 bits at each look, so it must be looked at once a turn; the
/// period is waited for by looking. Microseconds are derived from the count since start, never added up: no
/// drift.
template <RegisterBlock Registers>
class TtcClock final : public Clock {
  public:
    TtcClock(Registers registers, const TtcConfig& config) : registers_(registers), config_(config) {}

    /// Sets timer 1 going. The counter's width is what the interval register keeps: 32 bits in the Zynq
    /// UltraScale+, 16 in its emulator.
    void start() {
        using namespace ttc_reg;
        registers_.write(kInterruptEnable, 0);
        registers_.write(kIntervalCounter, 0xFFFF'FFFF);
        mask_ = registers_.read(kIntervalCounter);
        shift_ = mask_ == 0xFFFF ? config_.narrow_prescaler_log2 : config_.prescaler_log2;
        registers_.write(kClockControl, kClockPsEn | (shift_ - 1) << kClockPsValShift);
        registers_.write(kCounterControl, kCounterInt | kCounterRst | kCounterWaveDisable);
        last_ = registers_.read(kCounterValue) & mask_;
        count_ = 0;
    }

    std::uint64_t now_us() override {
        const std::uint32_t value = registers_.read(ttc_reg::kCounterValue) & mask_;
        count_ += (value - last_) & mask_;
        last_ = value;
        // counts * 2^prescaler / reference_hz, in an order that cannot overflow in 5000 years.
        const std::uint64_t whole_s = (count_ << shift_) / config_.reference_hz;
        const std::uint64_t rest = (count_ << shift_) % config_.reference_hz;
        return whole_s * 1'000'000 + rest * 1'000'000 / config_.reference_hz;
    }

    void wait_until(std::uint64_t time_us) override {
        while (now_us() < time_us) pause();
    }

    /// A few microseconds without a look at any device: polling at full speed takes the bus from others, and
    /// an emulator that is kept busy with it does not get to move the bytes that are waited for. Less than a
    /// byte at 1 Mbaud.
    static void pause() {
        for (int i = 0; i < 50; ++i) asm volatile(".rept 60\n nop\n .endr");
    }

  private:
    Registers registers_;
    TtcConfig config_;
    std::uint32_t mask_ = 0xFFFF;
    std::uint32_t shift_ = 1;  ///< prescaler in use, log2
    std::uint32_t last_ = 0;
    std::uint64_t count_ = 0;
};

}  // namespace hal::zcu102
