// Frames taken apart again by the rules of ISO 11898-1; the worst case from the literature (Davis, Burns,
// Bril and Lukkien 2007: 135 bits for 8 bytes with the intermission).
#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

#include "host_sim/bus_load.hpp"

#include <CppUTest/TestHarness.h>

namespace {

can::Frame random_frame(std::mt19937& random) {
    can::Frame frame{.id = static_cast<std::uint16_t>(random() % 0x800),
                     .length = static_cast<std::uint8_t>(random() % 9)};
    // Long runs of equal bits are what stuffing is about.
    const auto style = random() % 3;
    for (unsigned i = 0; i < frame.length; ++i)
        frame.data[i] = style == 0 ? static_cast<std::uint8_t>(random())
                                   : static_cast<std::uint8_t>(style == 1 ? 0 : 0xFF);
    return frame;
}

unsigned take(const std::vector<bool>& bits, std::size_t& at, int count) {
    unsigned value = 0;
    for (int i = 0; i < count; ++i) value = value << 1 | (bits.at(at++) ? 1u : 0u);
    return value;
}

}  // namespace

TEST_GROUP(BusLoad){};

TEST(BusLoad, FramesCanBeTakenApartAgain) {
    std::mt19937 random(1);
    for (int run = 0; run < 3000; ++run) {
        const can::Frame frame = random_frame(random);
        const std::vector<bool> wire = sim::wire_bits(frame);
        // Remove the bit after every five equal ones, in the part that is stuffed.
        const std::size_t stuffed_bits = wire.size() - 13;
        std::vector<bool> plain;
        std::size_t equal = 0;
        for (std::size_t i = 0; i < stuffed_bits; ++i) {
            if (equal == 5) {
                CHECK(wire[i] != wire[i - 1]);
                equal = 1;
                continue;
            }
            equal = i > 0 && wire[i] == wire[i - 1] ? equal + 1 : 1;
            plain.push_back(wire[i]);
        }
        LONGS_EQUAL(34 + 8 * frame.length, plain.size());
        std::size_t at = 0;
        LONGS_EQUAL(0, take(plain, at, 1));
        LONGS_EQUAL(frame.id, take(plain, at, 11));
        LONGS_EQUAL(0, take(plain, at, 3));
        LONGS_EQUAL(frame.length, take(plain, at, 4));
        for (unsigned i = 0; i < frame.length; ++i) LONGS_EQUAL(frame.data[i], take(plain, at, 8));
        // All bits with their CRC are a multiple of x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1.
        std::vector<bool> rest = plain;
        const std::vector<int> powers = {15, 14, 10, 8, 7, 4, 3, 0};
        for (std::size_t i = 0; i + 15 < rest.size(); ++i) {
            if (!rest[i]) continue;
            for (const int power : powers) {
                const std::size_t bit = i + 15 - static_cast<std::size_t>(power);
                rest[bit] = !rest[bit];
            }
        }
        CHECK(std::none_of(rest.begin(), rest.end(), [](bool bit) { return bit; }));
    }
}

TEST(BusLoad, WorstCaseIsABoundAndIsKnown) {
    LONGS_EQUAL(135, sim::worst_wire_bits(8));
    LONGS_EQUAL(55, sim::worst_wire_bits(0));
    std::mt19937 random(2);
    std::vector<int> longest(9);
    for (int run = 0; run < 20000; ++run) {
        const can::Frame frame = random_frame(random);
        const int bits = static_cast<int>(sim::wire_bits(frame).size());
        CHECK(bits <= sim::worst_wire_bits(frame.length));
        CHECK(bits >= 47 + 8 * frame.length);
        longest[frame.length] = std::max(longest[frame.length], bits);
    }
    CHECK(longest[8] > 47 + 64 + 10);  // stuffing really happens
}

TEST(BusLoad, SixteenObjectsStayBelowFortyPercent) {
    double bits_per_s = 0;
    double frames_per_s = 0;
    for (const sim::MessageLoad& load : sim::message_loads(16)) {
        bits_per_s += load.bits_per_s;
        frames_per_s += load.frames_per_s;
    }
    // 32 halves of objects, status, warning, header, ego motion, command and echo ten times a second; version
    // once.
    DOUBLES_EQUAL(381, frames_per_s, 1e-9);
    CHECK(bits_per_s < 0.40 * sim::kBitrate);
    CHECK(bits_per_s > 320 * 135);
}
