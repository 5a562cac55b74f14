#include "hal/host/virtual_clock.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(VirtualClock){};

TEST(VirtualClock, MovesOnlyWhenWaitedForAndNeverBack) {
    hal::VirtualClock clock;
    UNSIGNED_LONGS_EQUAL(0, clock.now_us());
    clock.wait_until(100'000);
    UNSIGNED_LONGS_EQUAL(100'000, clock.now_us());
    clock.wait_until(50'000);
    UNSIGNED_LONGS_EQUAL(100'000, clock.now_us());
    clock.advance(7);
    UNSIGNED_LONGS_EQUAL(100'007, clock.now_us());
}
