// Keys, fields and offsets are written out from the register reference: SWDT MODE, CONTROL, RESTART;
// PMU_GLOBAL ERROR_SRST_EN_1 and ERROR_EN_1, whose bit 12 is the low-power domain's watchdog.
#include <cstdint>

#include "hal/zcu102/watchdog.hpp"
#include "tests/hal/register_fake.hpp"

#include <CppUTest/TestHarness.h>

namespace {

/// Takes writes only with their keys, and counts down.
struct FakeSwdt {
    std::uint32_t mode = 0, control = 0;
    std::uint64_t counter = 0xFFF;
    bool reset_output = false;

    std::uint32_t read(std::uint32_t offset) const { return offset == 0x0C ? (reset_output ? 1U : 0U) : 0U; }
    void write(std::uint32_t offset, std::uint32_t value) {
        if (offset == 0x00 && (value >> 12 & 0xFFF) == 0xABC) mode = value & 0xFFF;
        if (offset == 0x04 && (value >> 14 & 0xFFF) == 0x248) control = value & 0x3FFF;
        if (offset == 0x08 && value == 0x1999) counter = std::uint64_t{control >> 2} << 12 | 0xFFF;
    }
    /// `us` microseconds at 100 MHz.
    void pass(std::uint64_t us) {
        if ((mode & 1) == 0) return;
        const std::uint64_t prescalers[] = {8, 64, 512, 4096};
        const std::uint64_t counts = us * 100 / prescalers[control & 3];
        if (counts > counter) {
            reset_output = (mode & 2) != 0;
        } else {
            counter -= counts;
        }
    }
};

struct FakePmu {
    std::uint32_t reset_enabled = 0, error_enabled = 0x40, status = 0x1000;
    std::uint32_t read(std::uint32_t offset) const { return offset == 0x5A0 ? error_enabled : 0; }
    void write(std::uint32_t offset, std::uint32_t value) {
        if (offset == 0x530) status &= ~value;
        if (offset == 0x56C) reset_enabled |= value;
        if (offset == 0x5A0) error_enabled = value;
    }
};

}  // namespace

TEST_GROUP(Zcu102Watchdog) {
    FakeSwdt swdt;
    FakePmu pmu;
    hal::zcu102::SystemWatchdog<RegistersOf<FakeSwdt>, RegistersOf<FakePmu>> watchdog{{&swdt}, {&pmu}};
};

TEST(Zcu102Watchdog, off_until_started) {
    swdt.pass(10'000'000);
    CHECK_FALSE(swdt.reset_output);
}

TEST(Zcu102Watchdog, resets_when_the_loop_stops) {
    watchdog.start();
    CHECK_EQUAL(0x1000U, pmu.reset_enabled);
    CHECK_EQUAL(0x1040U, pmu.error_enabled);  // what others enabled stays
    CHECK_EQUAL(0U, pmu.status);
    swdt.pass(299'000);
    CHECK_FALSE(swdt.reset_output);
    swdt.pass(21'000);
    CHECK_TRUE(swdt.reset_output);
}

TEST(Zcu102Watchdog, kicks_keep_it_quiet) {
    watchdog.start();
    for (int i = 0; i < 1000; ++i) {
        swdt.pass(100'000);
        watchdog.kick();
    }
    CHECK_FALSE(swdt.reset_output);
    swdt.pass(320'000);
    CHECK_TRUE(swdt.reset_output);
}
