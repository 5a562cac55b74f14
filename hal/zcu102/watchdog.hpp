/// The system watchdog of the low-power domain (SWDT), which resets the system through the platform
/// management unit.
#pragma once

#include <cstdint>

#include "hal/common/mmio.hpp"
#include "hal/contract/watchdog.hpp"
#include "hal/zcu102/registers.hpp"

namespace hal::zcu102 {

struct WatchdogConfig {
    std::uint32_t reference_hz = kReferenceHz;  ///< LPD_LSBUS_CLK
    /// Kick to reset. Below two periods a single slow cycle would reset; above five the car drives blind for
    /// too long.
    std::uint32_t timeout_ms = 300;

    static constexpr std::uint32_t kClksel = 2;  ///< of the prescalers 8, 64, 512, 4096
    static constexpr std::uint32_t kPrescaler = 512;

    /// CRV, the top 12 of the counter's 24 bits; the others start as ones. Rounded up: never earlier than
    /// asked for.
    [[nodiscard]] constexpr std::uint32_t counter_restart() const {
        const std::uint64_t counts = std::uint64_t{timeout_ms} * (reference_hz / 1000) / kPrescaler;
        return static_cast<std::uint32_t>(counts >> 12);
    }
    [[nodiscard]] constexpr std::uint32_t actual_ms() const {
        return static_cast<std::uint32_t>(std::uint64_t{(counter_restart() + 1) << 12} * kPrescaler /
                                          (reference_hz / 1000));
    }
    [[nodiscard]] constexpr bool valid() const {
        return timeout_ms >= 200 && counter_restart() < 4096 && actual_ms() >= timeout_ms &&
               actual_ms() <= 500;
    }
};
static_assert(WatchdogConfig{}.valid());

template <RegisterBlock Swdt, RegisterBlock Pmu>
class SystemWatchdog final : public Watchdog {
  public:
    SystemWatchdog(Swdt swdt, Pmu pmu, const WatchdogConfig& config = {})
        : swdt_(swdt), pmu_(pmu), config_(config) {}

    void start() override {
        using namespace swdt_reg;
        swdt_.write(kMode, kModeKey);  // off while it is set up
        swdt_.write(kControl,
                    kControlKey | config_.counter_restart() << kControlCrvShift | WatchdogConfig::kClksel);
        swdt_.write(kRestart, kRestartKey);
        // Its output is an error signal to the PMU, which turns it into a system reset when told to.
        pmu_.write(pmu_reg::kErrorStatus1, pmu_reg::kErrorLpdSwdt);
        pmu_.write(pmu_reg::kErrorSrstEn1, pmu_reg::kErrorLpdSwdt);
        pmu_.write(pmu_reg::kErrorEn1, pmu_.read(pmu_reg::kErrorEn1) | pmu_reg::kErrorLpdSwdt);
        swdt_.write(kMode, kModeKey | kModeRsten | kModeWden);
    }

    void kick() override { swdt_.write(swdt_reg::kRestart, swdt_reg::kRestartKey); }

  private:
    Swdt swdt_;
    Pmu pmu_;
    WatchdogConfig config_;
};

}  // namespace hal::zcu102
