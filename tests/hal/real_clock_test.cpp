#include <chrono>

#include "hal/host/real_clock.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(RealClock){};

TEST(RealClock, WaitsAtLeastUntilTheTimeAskedFor) {
    hal::RealClock clock;
    const auto before = std::chrono::steady_clock::now();
    const auto until = clock.now_us() + 20'000;
    clock.wait_until(until);
    CHECK(clock.now_us() >= until);
    CHECK(std::chrono::steady_clock::now() - before >= std::chrono::milliseconds(19));
    clock.wait_until(0);
}

TEST(RealClock, RunsAtAnotherSpeed) {
    hal::RealClock fast(100);
    const auto before = std::chrono::steady_clock::now();
    fast.wait_until(fast.now_us() + 2'000'000);
    const auto took = std::chrono::steady_clock::now() - before;
    CHECK(took >= std::chrono::milliseconds(19));
    CHECK(took < std::chrono::milliseconds(1500));
}
