/// A PC is not reset when its loop stops; that the loop kicked is counted instead.
#pragma once

#include <cstdint>

#include "hal/contract/watchdog.hpp"

namespace hal {

class CountingWatchdog final : public Watchdog {
  public:
    void start() override { started_ = true; }
    void kick() override { ++kicks_; }

    [[nodiscard]] bool started() const { return started_; }
    [[nodiscard]] std::uint32_t kicks() const { return kicks_; }

  private:
    bool started_ = false;
    std::uint32_t kicks_ = 0;
};

}  // namespace hal
