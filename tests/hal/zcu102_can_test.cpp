// Expected register values are written out from the Zynq UltraScale+ register reference, not from the
// driver's names.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <deque>
#include <vector>

#include "hal/zcu102/can.hpp"
#include "tests/hal/register_fake.hpp"

#include <CppUTest/TestHarness.h>

namespace {

struct RawFrame {
    std::uint32_t id, dlc, data_1, data_2;
    bool operator==(const RawFrame&) const = default;
};

/// The controller as its manual describes it. What goes wrong is chosen by the test.
struct FakeController {
    enum class Behaviour { healthy, dead, stuck_in_reset };
    Behaviour behaviour = Behaviour::healthy;

    std::uint32_t srr = 0, brpr = 0, btr = 0, afr = 0, isr = 0, ecr = 0;
    std::uint32_t afmr[4] = {}, afir[4] = {};
    std::uint32_t estat = 1;  // error active
    bool bus_idle = true;
    bool bus_transmits = true;  // frames leave the transmit FIFO before the next look at the controller
    int resets = 0;
    RawFrame writing{};
    std::vector<RawFrame> fifo, sent;
    std::deque<RawFrame> received;

    std::uint32_t read(std::uint32_t offset) {
        if (behaviour == Behaviour::dead) return 0;
        if (bus_transmits && !fifo.empty() && (srr & 2) != 0) transmit();
        switch (offset) {
            case 0x10:
                return ecr;
            case 0x18: {
                if ((srr & 2) == 0) return behaviour == Behaviour::stuck_in_reset ? 0 : 1;
                return 8U | estat << 7 | (bus_idle ? 0x10U : 0x20U) | (fifo.size() >= 64 ? 0x400U : 0U);
            }
            case 0x1C:
                return isr | (received.empty() ? 0U : 0x80U);
            case 0x50:
                return received.empty() ? 0 : received.front().id;
            case 0x54:
                return received.empty() ? 0 : received.front().dlc;
            case 0x58:
                return received.empty() ? 0 : received.front().data_1;
            case 0x5C: {
                if (received.empty()) return 0;
                const std::uint32_t last = received.front().data_2;
                received.pop_front();
                return last;
            }
            default:
                return 0;
        }
    }

    void write(std::uint32_t offset, std::uint32_t value) {
        const bool configuration = (srr & 2) == 0;
        switch (offset) {
            case 0x00:
                if ((value & 1) != 0) {
                    ++resets;
                    brpr = btr = afr = isr = ecr = 0;
                    estat = 1;
                    fifo.clear();
                    received.clear();
                    srr = 0;
                    return;
                }
                srr = value;
                break;
            case 0x08:
                if (configuration) brpr = value;
                break;
            case 0x0C:
                if (configuration) btr = value;
                break;
            case 0x24:
                isr &= ~value;
                break;
            case 0x30:
                writing.id = value;
                break;
            case 0x34:
                writing.dlc = value;
                break;
            case 0x38:
                writing.data_1 = value;
                break;
            case 0x3C:
                writing.data_2 = value;
                fifo.push_back(writing);
                break;
            case 0x60:
                afr = value;
                break;
            default:
                if (offset >= 0x64 && offset < 0x84) {
                    const std::uint32_t i = (offset - 0x64) / 8;
                    if ((afr >> i & 1) == 0) ((offset - 0x64) % 8 == 0 ? afmr : afir)[i] = value;
                }
        }
    }

    void transmit() {
        sent.insert(sent.end(), fifo.begin(), fifo.end());
        fifo.clear();
        isr |= 1U << 1 | 1U << 14;  // TXOK, TXFEMP
    }
    void go_bus_off() {
        isr |= 1U << 9;
        estat = 2;
    }
};

can::Frame numbered(std::uint16_t n) {
    return {static_cast<std::uint16_t>(0x400 + n), 8, {static_cast<std::uint8_t>(n), 2, 3, 4, 5, 6, 7, 8}};
}

}  // namespace

TEST_GROUP(Zcu102Can) {
    FakeController device;
    FakeTimer timer;
    hal::zcu102::CanController<RegistersOf<FakeController>, FakeTimer> port{{&device}, timer};
    can::Frame frame;
};

/// 100 MHz / 10 = 10 MHz, 20 quanta a bit: 1 + 16 + 3, sample point 85 %, jump width 3.
TEST(Zcu102Can, programmed_for_500_kbit) {
    CHECK_TRUE(port.start());
    CHECK_EQUAL(9U, device.brpr);
    CHECK_EQUAL((2U << 7 | 2U << 4 | 15U), device.btr);
    CHECK_EQUAL(2U, device.srr);
    CHECK_TRUE(port.state() == hal::CanState::active);
}

TEST(Zcu102Can, bit_timings_for_other_clocks) {
    using hal::zcu102::bit_timing;
    // 24 MHz: 3 x 16 quanta, 1 + 13 + 2: 87.5 % exactly. 33 MHz: 6 x 11 quanta, 1 + 8 + 2, comes nearest.
    CHECK_EQUAL(3U, bit_timing(24'000'000, 500'000, 875).prescaler);
    CHECK_EQUAL(875U, bit_timing(24'000'000, 500'000, 875).sample_point_permille());
    CHECK_EQUAL(11U, bit_timing(33'000'000, 500'000, 875).quanta());
    CHECK_TRUE(bit_timing(100'000'000, 1'000'000, 875).valid(100'000'000, 1'000'000));
    CHECK_FALSE(bit_timing(99'999'900, 500'000, 875).valid(99'999'900, 500'000));
}

/// Identifier in bits 31 to 21; bit 20 (remote) and 19 (extended) must be zero.
TEST(Zcu102Can, acceptance_filters) {
    port.start();
    CHECK_EQUAL(3U, device.afr);
    CHECK_EQUAL(0xFFF8'0000U, device.afmr[0]);
    CHECK_EQUAL(0xFFF8'0000U, device.afmr[1]);
    CHECK_EQUAL(0x8620'0000U, device.afir[0]);  // 0x431
    CHECK_EQUAL(0x8640'0000U, device.afir[1]);  // 0x432
}

TEST(Zcu102Can, sends) {
    port.start();
    CHECK_TRUE(port.send({0x411, 8, {1, 2, 3, 4, 5, 6, 7, 8}}));
    CHECK_TRUE(port.send({0x7FF, 5, {1, 2, 3, 4, 5, 0xEE, 0xEE, 0xEE}}));
    CHECK_EQUAL(2U, port.counters().sent);
    CHECK_EQUAL(2U, device.sent.size());
    CHECK_TRUE((device.sent[0] == RawFrame{0x8220'0000, 0x8000'0000, 0x0102'0304, 0x0506'0708}));
    CHECK_TRUE((device.sent[1] == RawFrame{0xFFE0'0000, 0x5000'0000, 0x0102'0304, 0x0500'0000}));
}

TEST(Zcu102Can, receives) {
    port.start();
    device.received = {{0x8620'0000, 0x8000'1234, 0x0102'0304, 0x0506'0708},
                       {0x8640'0000, 0x2000'0000, 0xAABB'FFFF, 0xFFFF'FFFF}};
    CHECK_TRUE(port.receive(frame));
    CHECK_TRUE((frame == can::Frame{0x431, 8, {1, 2, 3, 4, 5, 6, 7, 8}}));
    CHECK_TRUE(port.receive(frame));
    CHECK_TRUE((frame == can::Frame{0x432, 2, {0xAA, 0xBB}}));
    CHECK_FALSE(port.receive(frame));
    CHECK_EQUAL(2U, port.counters().received);
}

/// A length code above 8 means 8 bytes (ISO 11898-1).
TEST(Zcu102Can, length_code_15) {
    port.start();
    device.received = {{0x8620'0000, 0xF000'0000, 0x0102'0304, 0x0506'0708}};
    CHECK_TRUE(port.receive(frame));
    CHECK_EQUAL(8, frame.length);
}

TEST(Zcu102Can, extended_and_remote_frames_are_rejected) {
    port.start();
    device.received = {{0x8628'0000, 0, 0, 0}, {0x8630'0000, 0, 0, 0}, {0x8620'0000, 0, 0, 0}};
    CHECK_TRUE(port.receive(frame));
    CHECK_EQUAL(0x431, frame.id);
    CHECK_FALSE(port.receive(frame));
    CHECK_EQUAL(2U, port.counters().rejected);
    CHECK_EQUAL(1U, port.counters().received);
}

TEST(Zcu102Can, receive_overflow_is_counted) {
    port.start();
    device.isr |= 1U << 6;
    CHECK_FALSE(port.receive(frame));
    CHECK_FALSE(port.receive(frame));
    CHECK_EQUAL(1U, port.counters().receive_overflow);
}

TEST(Zcu102Can, newest_list_wins) {
    port.start();
    device.bus_transmits = false;
    port.begin_cycle();
    for (std::uint16_t n = 0; n < 35; ++n) CHECK_TRUE(port.send(numbered(n)));
    device.received = {{0x8620'0000, 0x1000'0000, 0x4200'0000, 0}};
    port.begin_cycle();  // the bus is held by others: the old list goes
    CHECK_EQUAL(0U, device.fifo.size());
    CHECK_EQUAL(35U, port.counters().dropped);
    CHECK_EQUAL(9U, device.brpr);  // programmed anew
    CHECK_EQUAL(3U, device.afr);
    CHECK_TRUE(port.receive(frame));  // what had been received is not lost with it
    CHECK_EQUAL(0x42, frame.data[0]);

    device.bus_transmits = true;
    for (std::uint16_t n = 100; n < 103; ++n) port.send(numbered(n));
    port.begin_cycle();
    CHECK_EQUAL(3U, device.sent.size());
    CHECK_EQUAL(100U, device.sent[0].data_1 >> 24);
    CHECK_EQUAL(3U, port.counters().sent);
    CHECK_EQUAL(35U, port.counters().dropped);
}

TEST(Zcu102Can, a_list_that_got_through_is_not_discarded) {
    port.start();
    const int resets = device.resets;
    for (int cycle = 0; cycle < 10; ++cycle) {
        port.begin_cycle();
        device.bus_transmits = false;
        for (std::uint16_t n = 0; n < 1 + cycle; ++n) port.send(numbered(n));
        CHECK_EQUAL(0U, port.counters().dropped);
        device.transmit();
    }
    port.begin_cycle();
    CHECK_EQUAL(resets, device.resets);
    CHECK_EQUAL(55U, port.counters().sent);
    CHECK_EQUAL(55U, device.sent.size());
}

TEST(Zcu102Can, waits_for_a_gap_for_a_limited_time) {
    port.start();
    device.bus_transmits = false;
    device.bus_idle = false;
    port.send(numbered(1));
    const std::uint64_t before = timer.time_us;
    port.begin_cycle();
    CHECK_TRUE(timer.time_us - before >= 300 && timer.time_us - before < 320);
    CHECK_EQUAL(0U, device.fifo.size());
}

TEST(Zcu102Can, full_fifo_drops) {
    port.start();
    device.bus_transmits = false;
    for (std::uint16_t n = 0; n < 64; ++n) CHECK_TRUE(port.send(numbered(n)));
    CHECK_FALSE(port.send(numbered(64)));
    CHECK_EQUAL(1U, port.counters().dropped);
}

TEST(Zcu102Can, error_passive_and_counters) {
    port.start();
    device.ecr = 0x8061;  // REC 128, TEC 97
    device.estat = 3;
    CHECK_TRUE(port.state() == hal::CanState::passive);
    CHECK_EQUAL(97, port.errors().transmit);
    CHECK_EQUAL(128, port.errors().receive);
    // Discarding a list resets the controller and its error counters; that must not look like recovery.
    device.bus_transmits = false;
    port.send(numbered(1));
    port.begin_cycle();
    CHECK_TRUE(port.state() == hal::CanState::passive);
    port.begin_cycle();
    CHECK_TRUE(port.state() == hal::CanState::active);
}

TEST(Zcu102Can, bus_off_is_left_after_the_recovery_time) {
    port.start();
    device.bus_transmits = false;
    port.send(numbered(1));
    port.send(numbered(2));
    device.go_bus_off();
    CHECK_TRUE(port.state() == hal::CanState::bus_off);
    CHECK_EQUAL(1U, port.counters().bus_off);
    CHECK_EQUAL(2U, port.counters().dropped);
    CHECK_FALSE(port.send(numbered(3)));
    CHECK_EQUAL(3U, port.counters().dropped);
    CHECK_EQUAL(0U, device.srr);  // off the bus

    timer.time_us += 50'000;
    port.begin_cycle();
    CHECK_TRUE(port.state() == hal::CanState::bus_off);
    timer.time_us += 60'000;
    device.bus_transmits = true;
    port.begin_cycle();
    CHECK_TRUE(port.state() == hal::CanState::active);
    CHECK_TRUE(port.send(numbered(7)));
    CHECK_EQUAL(1U, port.counters().sent);
    CHECK_EQUAL(1U, device.sent.size());  // nothing of the old list
    CHECK_EQUAL(7U, device.sent[0].data_1 >> 24);
    CHECK_EQUAL(1U, port.counters().bus_off);
}

/// As in the loop, cycle by cycle: the bus is left each time, and back within two periods with a fresh list.
TEST(Zcu102Can, bus_off_again_and_again) {
    port.start();
    std::uint64_t longest_us = 0;
    for (std::uint32_t n = 1; n <= 100; ++n) {
        device.bus_transmits = false;
        port.send(numbered(0));
        device.ecr = 0x0100;  // TEC beyond 255
        device.go_bus_off();
        const std::uint64_t left_us = timer.time_us;
        port.begin_cycle();
        CHECK_EQUAL(n, port.counters().bus_off);
        while (port.state() != hal::CanState::active) {
            timer.time_us += 100'000;
            port.begin_cycle();
        }
        longest_us = std::max(longest_us, timer.time_us - left_us);
        device.bus_transmits = true;
        device.sent.clear();
        CHECK_TRUE(port.send(numbered(1)));
        CHECK_EQUAL(n, port.counters().sent);
        CHECK_EQUAL(1U, device.sent.size());
        CHECK_EQUAL(1U, device.sent[0].data_1 >> 24);  // the old list is not sent late
    }
    std::printf("bus off: %u times, %u recovered, after %u ms at most; each list after it fresh\n",
                port.counters().bus_off, port.counters().sent, static_cast<unsigned>(longest_us / 1000));
    CHECK_TRUE(longest_us < 210'000);
}

TEST(Zcu102Can, dead_controller_does_not_hang) {
    device.behaviour = FakeController::Behaviour::dead;
    CHECK_FALSE(port.start());
    CHECK_TRUE(port.state() == hal::CanState::down);
    CHECK_FALSE(port.send(numbered(1)));
    CHECK_FALSE(port.receive(frame));
    device.behaviour = FakeController::Behaviour::healthy;
    timer.time_us += 200'000;
    port.begin_cycle();
    CHECK_TRUE(port.state() == hal::CanState::active);
}

TEST(Zcu102Can, controller_that_never_reports_configuration_mode) {
    device.behaviour = FakeController::Behaviour::stuck_in_reset;
    CHECK_FALSE(port.start());
    CHECK_TRUE(port.state() == hal::CanState::down);
}
