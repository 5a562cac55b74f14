#include <cstdint>

#include "hal/zcu102/ttc_clock.hpp"
#include "tests/hal/register_fake.hpp"

#include <CppUTest/TestHarness.h>

namespace {

/// Timer 1 of a TTC, register offsets from the register reference. Time is in reference clocks; a look takes
/// some.
struct FakeTtc {
    std::uint32_t width_mask = 0xFFFF'FFFF;
    std::uint64_t clocks = 12345;
    std::uint64_t started_at = 0;
    std::uint32_t clock_control = 0, counter_control = 1, interval = 0;
    std::uint64_t clocks_a_look = 37;

    std::uint32_t read(std::uint32_t offset) {
        clocks += clocks_a_look;
        switch (offset) {
            case 0x18: {
                const std::uint32_t prescale = (clock_control & 1) != 0 ? (clock_control >> 1 & 15) + 1 : 0;
                const std::uint64_t count = (clocks - started_at) >> prescale;
                return static_cast<std::uint32_t>(count % (std::uint64_t{interval} + 1));
            }
            case 0x24:
                return interval;
            default:
                return 0;
        }
    }
    void write(std::uint32_t offset, std::uint32_t value) {
        switch (offset) {
            case 0x00:
                clock_control = value;
                break;
            case 0x0C:
                counter_control = value;
                if ((value & 0x10) != 0) started_at = clocks;
                break;
            case 0x24:
                interval = value & width_mask;
                break;
            default:
                break;
        }
    }
};

}  // namespace

TEST_GROUP(Zcu102TtcClock) {
    FakeTtc device;
};

TEST(Zcu102TtcClock, programmed) {
    hal::zcu102::TtcClock<RegistersOf<FakeTtc>> clock({&device}, {});
    clock.start();
    CHECK_EQUAL((3U << 1 | 1U), device.clock_control);  // prescaler on, 2^(3 + 1)
    CHECK_EQUAL(0U, device.counter_control & 1);        // running
    CHECK_EQUAL(2U, device.counter_control & 2);        // interval mode
}

/// An hour of periods: the time of each is right to a count of the timer and the looks around it, at both
/// counter widths and at a clock that is no round number of microseconds.
TEST(Zcu102TtcClock, no_drift_over_an_hour) {
    for (const std::uint32_t mask : {0xFFFF'FFFFU, 0xFFFFU}) {
        for (const std::uint32_t hz : {100'000'000U, 133'000'000U}) {
            device = {};
            device.width_mask = mask;
            device.clocks_a_look = hz / 1'000'000 * 977;  // 977 us: nobody looks at round times
            hal::zcu102::TtcClock<RegistersOf<FakeTtc>> clock({&device}, {.reference_hz = hz});
            clock.start();
            const std::uint64_t start = device.clocks;
            std::uint32_t frames = 0;
            for (std::uint64_t next_us = 100'000; next_us <= 3'600'000'000; next_us += 100'000) {
                clock.wait_until(next_us);
                ++frames;
                const std::uint64_t elapsed_us = (device.clocks - start) * 1000 / (hz / 1000);
                CHECK_TRUE(elapsed_us + 330 >= next_us && elapsed_us <= next_us + 977 * 2 + 330);
            }
            CHECK_EQUAL(36'000U, frames);
        }
    }
}

TEST(Zcu102TtcClock, never_goes_back) {
    device.width_mask = 0xFFFF;
    device.clocks_a_look = 2'147'000'000;  // just below a turn of 65536 x 32768 clocks
    hal::zcu102::TtcClock<RegistersOf<FakeTtc>> clock({&device}, {});
    clock.start();
    std::uint64_t last = clock.now_us();
    for (int i = 0; i < 1000; ++i) {
        const std::uint64_t now = clock.now_us();
        CHECK_TRUE(now - last >= 21'469'600 && now - last <= 21'470'400);
        last = now;
    }
}
