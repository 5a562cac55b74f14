/// Time since start, and the 0.1 s period.
#pragma once

#include <cstdint>

namespace hal {

class Clock {
  public:
    /// Microseconds since start; monotonic.
    virtual std::uint64_t now_us() = 0;
    /// Waits until `time_us`; returns at once if it has passed.
    virtual void wait_until(std::uint64_t time_us) = 0;

  protected:
    ~Clock() = default;
};

}  // namespace hal
