/// Everything the firmware knows about the hardware it runs on.
#pragma once

#include "hal/contract/beat_source.hpp"
#include "hal/contract/can_port.hpp"
#include "hal/contract/clock.hpp"
#include "hal/contract/console.hpp"
#include "hal/contract/watchdog.hpp"

namespace hal {

struct Board {
    BeatSource& beat;
    CanPort& can;
    Clock& clock;
    Watchdog& watchdog;
    Console& console;
};

}  // namespace hal
