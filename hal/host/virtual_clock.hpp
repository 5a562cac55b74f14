/// Time that passes only when somebody waits for it: a run is as fast as the processor and always the same.
#pragma once

#include <algorithm>
#include <cstdint>

#include "hal/contract/clock.hpp"

namespace hal {

class VirtualClock final : public Clock {
  public:
    std::uint64_t now_us() override { return now_us_; }
    void wait_until(std::uint64_t time_us) override { now_us_ = std::max(now_us_, time_us); }
    /// Time spent on something, for example a stage that takes too long.
    void advance(std::uint64_t duration_us) { now_us_ += duration_us; }

  private:
    std::uint64_t now_us_ = 0;
};

}  // namespace hal
