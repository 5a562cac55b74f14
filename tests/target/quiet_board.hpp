/// Parts of a board for images that look at something else.
#pragma once

#include "hal/contract/can_port.hpp"
#include "hal/contract/watchdog.hpp"

namespace target {

struct QuietCan final : hal::CanPort {
    bool send(const can::Frame&) override { return true; }
    bool receive(can::Frame&) override { return false; }
    void begin_cycle() override {}
    hal::CanState state() override { return hal::CanState::active; }
    hal::CanCounters counters() override { return {}; }
};

struct QuietWatchdog final : hal::Watchdog {
    void start() override {}
    void kick() override {}
};

}  // namespace target
