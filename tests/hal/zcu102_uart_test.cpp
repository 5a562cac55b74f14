#include <cstdint>
#include <deque>
#include <string>

#include "hal/common/uart_console.hpp"
#include "hal/zcu102/uart.hpp"
#include "tests/hal/register_fake.hpp"

#include <CppUTest/TestHarness.h>

namespace {

struct FakeUart {
    std::uint32_t control = 0, mode = 0, generator = 0, divider = 0, interrupts = 0;
    std::deque<std::uint8_t> received;
    std::string sent;
    bool stuck = false;
    int status_reads = 0;

    std::uint32_t read(std::uint32_t offset) {
        switch (offset) {
            case 0x14:
                return interrupts;
            case 0x2C:
                ++status_reads;
                return (received.empty() ? 2U : 0U) | (stuck ? 0x10U : 0U);
            case 0x30: {
                const std::uint8_t byte = received.front();
                received.pop_front();
                return byte;
            }
            default:
                return 0;
        }
    }
    void write(std::uint32_t offset, std::uint32_t value) {
        switch (offset) {
            case 0x00:
                control = value;
                break;
            case 0x04:
                mode = value;
                break;
            case 0x14:
                interrupts &= ~value;
                break;
            case 0x18:
                generator = value;
                break;
            case 0x30:
                sent += static_cast<char>(value);
                break;
            case 0x34:
                divider = value;
                break;
            default:
                break;
        }
    }
};

}  // namespace

TEST_GROUP(Zcu102Uart) {
    FakeUart device;
    hal::zcu102::Uart<RegistersOf<FakeUart>> uart{RegistersOf<FakeUart>{&device}};
};

/// 100 MHz / (20 x 5) = 1 Mbaud exactly; 115200 baud to 0.01 %.
TEST(Zcu102Uart, baud_rates) {
    uart.start(hal::zcu102::baud_rate(100'000'000, 1'000'000));
    CHECK_EQUAL(100U, device.generator * (device.divider + 1));
    const hal::zcu102::BaudRate slow = hal::zcu102::baud_rate(100'000'000, 115'200);
    CHECK_EQUAL(868U, slow.generator * (slow.divider + 1));
    CHECK_TRUE(slow.divider >= 4);
    CHECK_EQUAL(0x20U, device.mode);     // 8N1
    CHECK_EQUAL(0x14U, device.control);  // both directions on, none off
}

TEST(Zcu102Uart, reads_and_writes) {
    CHECK_EQUAL(-1, uart.read());
    device.received = {0x00, 0xFF, 'h'};
    CHECK_EQUAL(0, uart.read());
    CHECK_EQUAL(255, uart.read());
    CHECK_EQUAL('h', uart.read());
    CHECK_TRUE(uart.write('x'));
    CHECK_EQUAL(std::string("x"), device.sent);
}

TEST(Zcu102Uart, a_line_that_takes_nothing_does_not_hold_the_loop) {
    device.stuck = true;
    hal::UartConsole console(uart);
    console.line("nobody takes this");
    CHECK_TRUE(device.status_reads <= 100'000);
}

TEST(Zcu102Uart, lost_bytes_are_seen_once) {
    CHECK_FALSE(uart.overrun());
    device.interrupts = 0x20;
    CHECK_TRUE(uart.overrun());
    CHECK_FALSE(uart.overrun());
}
