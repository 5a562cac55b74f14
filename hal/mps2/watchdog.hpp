/// The CMSDK watchdog: counts down twice, interrupts (NMI) after the first time, resets after the second.
#pragma once

#include <cstdint>

#include "hal/common/mmio.hpp"
#include "hal/contract/watchdog.hpp"
#include "hal/mps2/registers.hpp"

namespace hal::mps2 {

struct WatchdogConfig {
    /// Kick to NMI, where the cause is recorded; the reset follows after the same time again. Below two
    /// periods a single slow cycle would reset; much longer and the car drives blind.
    std::uint32_t timeout_ms = 200;

    [[nodiscard]] constexpr std::uint32_t load() const { return timeout_ms * (kClockHz / 1000); }
    [[nodiscard]] constexpr bool valid() const { return timeout_ms >= 200 && timeout_ms <= 500; }
};
static_assert(WatchdogConfig{}.valid());

template <RegisterBlock Registers>
class CmsdkWatchdog final : public Watchdog {
  public:
    explicit CmsdkWatchdog(Registers registers, const WatchdogConfig& config = {})
        : registers_(registers), config_(config) {}

    void start() override {
        using namespace watchdog_reg;
        registers_.write(kLock, kUnlock);
        registers_.write(kLoad, config_.load());
        registers_.write(kIntclr, 1);
        registers_.write(kControl, kControlInten | kControlResen);
        registers_.write(kLock, 0);
    }

    /// Clearing the interrupt reloads the counter.
    void kick() override {
        using namespace watchdog_reg;
        registers_.write(kLock, kUnlock);
        registers_.write(kIntclr, 1);
        registers_.write(kLock, 0);
    }

  private:
    Registers registers_;
    WatchdogConfig config_;
};

}  // namespace hal::mps2
