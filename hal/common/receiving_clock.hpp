/// A board's clock that looks after the serial line while it waits.
#pragma once

#include <cstdint>

#include "hal/contract/clock.hpp"

namespace hal {

/// Between two cycles the loop waits for the period, for up to 0.1 s, in which a sender at 1 Mbaud fills a
/// UART's 64 bytes 150 times over. So the serial line is emptied every `look_us`, which must be less than its
/// buffer lasts. `Timer` is the board's clock, `Beat` its BeatInput; both concrete, so that the calls are
/// direct.
template <class Timer, class Beat>
class ReceivingClock final : public Clock {
  public:
    ReceivingClock(Timer& timer, Beat& beat, std::uint32_t look_us)
        : timer_(timer), beat_(beat), look_us_(look_us) {}

    std::uint64_t now_us() override { return timer_.now_us(); }
    void wait_until(std::uint64_t time_us) override {
        for (std::uint64_t now = timer_.now_us(); now < time_us; now = timer_.now_us()) {
            beat_.poll();
            timer_.wait_until(time_us - now < look_us_ ? time_us : now + look_us_);
        }
    }

  private:
    Timer& timer_;
    Beat& beat_;
    std::uint32_t look_us_;
};

}  // namespace hal
