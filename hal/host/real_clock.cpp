#include "hal/host/real_clock.hpp"

#include <thread>

namespace hal {

std::uint64_t RealClock::now_us() {
    const std::chrono::duration<double, std::micro> passed = std::chrono::steady_clock::now() - start_;
    return static_cast<std::uint64_t>(passed.count() * speed_);
}

void RealClock::wait_until(std::uint64_t time_us) {
    const std::chrono::duration<double, std::micro> wanted(static_cast<double>(time_us) / speed_);
    // Rounded up, so that now_us() is not a hair before time_us afterwards.
    std::this_thread::sleep_until(start_ + std::chrono::ceil<std::chrono::steady_clock::duration>(wanted));
}

}  // namespace hal
