#include <cstdint>
#include <random>
#include <string>
#include <string_view>

#include "hal/common/slcan.hpp"

#include <CppUTest/TestHarness.h>

namespace {

struct FakeLine {
    std::string incoming;
    std::string outgoing;
    std::size_t next = 0;
    bool blocked = false;
    bool lost = false;

    int read() { return next < incoming.size() ? static_cast<std::uint8_t>(incoming[next++]) : -1; }
    bool write(std::uint8_t byte) {
        if (!blocked) outgoing += static_cast<char>(byte);
        return !blocked;
    }
    bool overrun() {
        const bool was = lost;
        lost = false;
        return was;
    }
};

}  // namespace

/// Commands and answers from the Lawicel CAN232 manual, version 3.
TEST_GROUP(Slcan) {
    FakeLine line;
    hal::SlcanPort<FakeLine> port{line};
    can::Frame frame;

    std::string answer(std::string_view command) {
        line.incoming.append(command);
        line.outgoing.clear();
        while (port.receive(frame)) {
        }
        return line.outgoing;
    }
};

TEST(Slcan, opening_as_slcand_does) {
    CHECK_TRUE(port.state() == hal::CanState::down);
    CHECK_EQUAL(std::string("\r\r\r"), answer("C\rS6\rO\r"));
    CHECK_TRUE(port.state() == hal::CanState::active);
    CHECK_EQUAL(std::string("\r"), answer("C\r"));
    CHECK_TRUE(port.state() == hal::CanState::down);
}

TEST(Slcan, queries) {
    CHECK_EQUAL(std::string("F00\r"), answer("F\r"));
    CHECK_EQUAL(std::string("V0101\r"), answer("V\r"));
    CHECK_EQUAL(std::string("NR077\r"), answer("N\r"));
    CHECK_EQUAL(std::string("\r"), answer("Z0\r"));
    CHECK_EQUAL(std::string(""), answer("\r\r\n\r"));
    CHECK_EQUAL(0U, port.malformed());
}

TEST(Slcan, refused) {
    for (const char* command : {"S9\r", "S\r", "Z1\r", "OO\r", "X\r", "t4310\r", "t\r", "CC\r", "\n!\r"}) {
        CHECK_EQUAL(std::string("\a"), answer(command));
    }
    CHECK_EQUAL(9U, port.malformed());
    answer("O\r");
    for (const char* command :
         {"O\r", "S6\r", "t8000\r", "t43\r", "t431\r", "t4319\r", "t43120\r", "t431201x2\r", "t4311zz\r",
          "t43110102\r", "T200000000\r", "r43\r", "tGGG0\r"}) {
        CHECK_EQUAL(std::string("\a"), answer(command));
    }
    CHECK_EQUAL(9U + 13U, port.malformed());
    CHECK_EQUAL(0U, port.counters().received);
}

TEST(Slcan, frames_for_the_radar) {
    answer("O\r");
    line.incoming += "t43180102030405a6b7C8\rt0000\rt7FF3FFEEDD\r";
    CHECK_TRUE(port.receive(frame));
    CHECK_TRUE((frame == can::Frame{0x431, 8, {1, 2, 3, 4, 5, 0xA6, 0xB7, 0xC8}}));
    CHECK_TRUE(port.receive(frame));
    CHECK_TRUE((frame == can::Frame{0x000, 0, {}}));
    CHECK_TRUE(port.receive(frame));
    CHECK_TRUE((frame == can::Frame{0x7FF, 3, {0xFF, 0xEE, 0xDD}}));
    CHECK_FALSE(port.receive(frame));
    CHECK_EQUAL(3U, port.counters().received);
}

TEST(Slcan, extended_and_remote_frames_are_rejected) {
    answer("O\r");
    CHECK_EQUAL(std::string("\r\r\r"), answer("T0000043121122\rr4312\rR000004310\r"));
    CHECK_EQUAL(3U, port.counters().rejected);
    CHECK_EQUAL(0U, port.malformed());
}

TEST(Slcan, frames_of_the_radar) {
    const can::Frame sent{0x400, 8, {0x01, 0x23, 0x45, 0x67, 0x89, 0xAB, 0xCD, 0xEF}};
    CHECK_FALSE(port.send(sent));
    CHECK_EQUAL(1U, port.counters().dropped);
    answer("O\r");
    line.outgoing.clear();
    CHECK_TRUE(port.send(sent));
    CHECK_TRUE(port.send({0x7FF, 0, {}}));
    CHECK_EQUAL(std::string("t40080123456789ABCDEF\rt7FF0\r"), line.outgoing);
    CHECK_EQUAL(2U, port.counters().sent);
    line.blocked = true;
    CHECK_FALSE(port.send(sent));
    CHECK_EQUAL(2U, port.counters().dropped);
}

TEST(Slcan, too_long_a_command_is_one_error) {
    answer("O\r");
    CHECK_EQUAL(std::string("\a"), answer(std::string(500, 't') + "\r"));
    CHECK_EQUAL(1U, port.malformed());
    CHECK_EQUAL(std::string("\r"), answer("t43120102\r"));
    CHECK_EQUAL(1U, port.counters().received);
}

TEST(Slcan, garbage_never_becomes_a_frame_with_a_length_beyond_8) {
    answer("O\r");
    std::mt19937 random(7);
    std::string garbage;
    constexpr std::string_view kAlphabet = "tTrR0123456789ABCDEF\rOCSx\xFF";
    for (int i = 0; i < 200'000; ++i) garbage += kAlphabet[random() % kAlphabet.size()];
    line.incoming = garbage;
    line.next = 0;
    int quiet = 0;
    while (quiet < 2) {
        if (port.receive(frame)) {
            CHECK_TRUE(frame.id < 0x800 && frame.length <= 8);
        } else {
            quiet = line.next == line.incoming.size() ? quiet + 1 : 0;
        }
    }
    CHECK_TRUE(port.malformed() > 1000);
    CHECK_TRUE(port.counters().received > 0);
}

TEST(Slcan, lost_bytes_are_counted) {
    line.lost = true;
    port.begin_cycle();
    port.begin_cycle();
    CHECK_EQUAL(1U, port.counters().receive_overflow);
}
