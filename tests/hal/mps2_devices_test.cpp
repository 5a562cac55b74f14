// The CMSDK devices and SysTick; offsets and bits written out from the manuals (DDI 0479, Armv7-M).
#include <cstdint>
#include <deque>
#include <string>

#include "hal/mps2/systick_clock.hpp"
#include "hal/mps2/uart.hpp"
#include "hal/mps2/watchdog.hpp"
#include "tests/hal/register_fake.hpp"

#include <CppUTest/TestHarness.h>

namespace {

/// A single byte each way. `line` is what the other end sends; the next byte comes when the last was read.
struct FakeUart {
    std::uint32_t control = 0, divider = 0;
    std::deque<std::uint8_t> line;
    bool overrun = false;
    bool stuck = false;
    std::string sent;

    [[nodiscard]] bool interrupt() const { return (control & 0x0A) == 0x0A && !line.empty(); }
    std::uint32_t read(std::uint32_t offset) {
        if (offset == 0x04) return (stuck ? 1U : 0U) | (line.empty() ? 0U : 2U) | (overrun ? 8U : 0U);
        if (offset == 0x00 && !line.empty()) {
            const std::uint8_t byte = line.front();
            line.pop_front();
            return byte;
        }
        return 0;
    }
    void write(std::uint32_t offset, std::uint32_t value) {
        if (offset == 0x00) sent += static_cast<char>(value);
        if (offset == 0x04 && (value & 8) != 0) overrun = false;
        if (offset == 0x08) control = value;
        if (offset == 0x10) divider = value;
    }
};

/// SysTick counts 25 MHz clocks down; the wake-up timer is in the same time.
struct FakeCore {
    std::uint64_t clocks = 0;
    std::uint64_t clocks_a_look = 11;
    std::uint64_t started_at = 0;
    std::uint32_t reload = 0, enabled = 0;
    std::uint64_t alarm_at = 0;
    std::uint32_t alarm_reload = 0;
    int sleeps = 0;
    bool held = false;

    std::uint32_t read(std::uint32_t offset) {
        clocks += clocks_a_look;
        if (offset != 0x18) return 0;
        const std::uint64_t period = std::uint64_t{reload} + 1;
        return static_cast<std::uint32_t>((period - (clocks - started_at) % period) % period);
    }
    void write(std::uint32_t offset, std::uint32_t value) {
        if (offset == 0x10) enabled = value;
        if (offset == 0x14) reload = value;
        if (offset == 0x18) started_at = clocks;
    }
    void sleep() {
        ++sleeps;
        if (alarm_at > clocks) clocks = alarm_at;
    }
};
struct CoreRegisters : RegistersOf<FakeCore> {
    void hold_interrupts() const { device->held = true; }
    void release_interrupts() const { device->held = false; }
    void wait_for_interrupt() const {
        CHECK_TRUE(device->held);
        device->sleep();
    }
};
struct AlarmRegisters {
    FakeCore* device;
    [[nodiscard]] static std::uint32_t read(std::uint32_t) { return 0; }
    void write(std::uint32_t offset, std::uint32_t value) const {
        if (offset == 0x08) device->alarm_reload = value;
        if (offset == 0x00) device->alarm_at = (value & 9) == 9 ? device->clocks + device->alarm_reload : 0;
    }
};

/// Counts down, interrupts, counts down again, resets.
struct FakeWatchdog {
    std::uint32_t load = 0xFFFF'FFFF, control = 0;
    std::uint64_t value = 0xFFFF'FFFF;
    bool locked = true, interrupted = false, reset = false;

    static std::uint32_t read(std::uint32_t) { return 0; }
    void write(std::uint32_t offset, std::uint32_t v) {
        if (offset == 0xC00) locked = v != 0x1ACC'E551;
        if (locked) return;
        if (offset == 0x00) value = load = v;
        if (offset == 0x08) control = v;
        if (offset == 0x0C) {
            interrupted = false;
            value = load;
        }
    }
    void pass(std::uint64_t clocks) {
        while ((control & 1) != 0 && clocks > 0) {
            if (clocks < value) {
                value -= clocks;
                return;
            }
            clocks -= value;
            value = load;
            if (interrupted && (control & 2) != 0) reset = true;
            interrupted = true;
        }
    }
};

}  // namespace

TEST_GROUP(Mps2Devices){};

TEST(Mps2Devices, uart_divides_25_mhz_to_1_mbaud) {
    FakeUart device;
    hal::mps2::Uart<RegistersOf<FakeUart>, 16> uart{RegistersOf<FakeUart>{&device}};
    uart.start(1'000'000);
    CHECK_EQUAL(25U, device.divider);
    CHECK_EQUAL(0x0BU, device.control);
    uart.start(115'200);
    CHECK_EQUAL(217U, device.divider);
}

/// The queue fills, the interrupt is held off, and nothing is lost or out of order.
TEST(Mps2Devices, uart_queue_full) {
    FakeUart device;
    hal::mps2::Uart<RegistersOf<FakeUart>, 16> uart{RegistersOf<FakeUart>{&device}};
    uart.start(1'000'000);
    for (int i = 0; i < 100; ++i) device.line.push_back(static_cast<std::uint8_t>(i));
    int expected = 0;
    for (int quiet = 0; quiet < 3;) {
        if (device.interrupt()) uart.on_receive();
        const int byte = uart.read();
        quiet = byte < 0 ? quiet + 1 : 0;
        if (byte < 0) continue;
        CHECK_EQUAL(expected, byte);
        ++expected;
    }
    CHECK_EQUAL(100, expected);
    CHECK_EQUAL(0x0BU, device.control);
}

TEST(Mps2Devices, uart_gives_up_on_a_stuck_line) {
    FakeUart device;
    hal::mps2::Uart<RegistersOf<FakeUart>, 16> uart{RegistersOf<FakeUart>{&device}};
    CHECK_TRUE(uart.write('a'));
    device.stuck = true;
    CHECK_FALSE(uart.write('b'));
    CHECK_EQUAL(std::string("a"), device.sent);
    device.overrun = true;
    CHECK_TRUE(uart.overrun());
    CHECK_FALSE(uart.overrun());
}

TEST(Mps2Devices, clock_has_no_drift_over_an_hour_and_sleeps) {
    FakeCore core;
    hal::mps2::SysTickClock<CoreRegisters, AlarmRegisters> clock({&core}, {&core});
    clock.start();
    CHECK_EQUAL(0x00FF'FFFFU, core.reload);
    CHECK_EQUAL(5U, core.enabled);
    const std::uint64_t start = core.clocks;
    std::uint32_t frames = 0;
    for (std::uint64_t next_us = 100'000; next_us <= 3'600'000'000; next_us += 100'000) {
        clock.wait_until(next_us);
        ++frames;
        const std::uint64_t elapsed_us = (core.clocks - start) / 25;
        CHECK_TRUE(elapsed_us >= next_us && elapsed_us <= next_us + 10);
    }
    CHECK_EQUAL(36'000U, frames);
    CHECK_TRUE(core.sleeps >= 36'000 && core.sleeps < 80'000);
    CHECK_FALSE(core.held);
}

TEST(Mps2Devices, watchdog_interrupts_then_resets) {
    FakeWatchdog device;
    hal::mps2::CmsdkWatchdog<RegistersOf<FakeWatchdog>> watchdog{RegistersOf<FakeWatchdog>{&device}};
    watchdog.start();
    CHECK_TRUE(device.locked);
    for (int i = 0; i < 100; ++i) {
        device.pass(2'500'000);
        watchdog.kick();
    }
    CHECK_FALSE(device.interrupted);
    device.pass(5'000'000);
    CHECK_TRUE(device.interrupted);
    CHECK_FALSE(device.reset);
    device.pass(5'000'000);
    CHECK_TRUE(device.reset);
}
