/// The PC's monotonic clock, if need be faster or slower.
#pragma once

#include <chrono>
#include <cstdint>

#include "hal/contract/clock.hpp"

namespace hal {

class RealClock final : public Clock {
  public:
    /// `speed` seconds pass in one second of the PC; > 0.
    explicit RealClock(double speed = 1) : speed_(speed) {}

    std::uint64_t now_us() override;
    void wait_until(std::uint64_t time_us) override;

  private:
    double speed_;
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace hal
