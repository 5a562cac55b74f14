// Expected values: vectors of the AUTOSAR E2E protocol specification (profile 11, data id mode both) and a
// CRC written out bit by bit.
#include <array>
#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "can/e2e.hpp"

#include <CppUTest/TestHarness.h>

using can::E2eStatus;

namespace {

/// Polynomial division, one message bit after the other.
std::uint8_t bitwise_crc(const std::vector<std::uint8_t>& bytes) {
    unsigned remainder = 0;
    for (const std::uint8_t byte : bytes) {
        for (int bit = 7; bit >= 0; --bit) {
            const unsigned out = (remainder >> 7) & 1u;
            remainder = ((remainder << 1) & 0xFFu) ^ ((out ^ ((byte >> bit) & 1u)) != 0 ? 0x1Du : 0u);
        }
    }
    return static_cast<std::uint8_t>(remainder);
}

can::Frame protected_frame(std::uint8_t counter, std::uint16_t data_id = 0x123) {
    can::Frame frame{.id = 0x400, .length = 8};
    can::e2e_protect(frame, data_id, counter);
    return frame;
}

E2eStatus check(can::E2eReceiverState& state, const can::Frame& frame, std::uint16_t data_id = 0x123) {
    return can::e2e_check(state, std::span(frame.data).first(frame.length), data_id);
}

}  // namespace

TEST_GROUP(E2e){};

TEST(E2e, PublishedVectors) {
    // Eight zero bytes, data id 0x123, both id bytes: CC 00 00 ..., and 91 01 00 ... with the next counter.
    std::uint8_t counter = 0;
    can::Frame frame{.id = 0x400, .length = 8};
    can::e2e_protect(frame, 0x123, counter);
    BYTES_EQUAL(0xCC, frame.data[0]);
    BYTES_EQUAL(0x00, frame.data[1]);
    can::e2e_protect(frame, 0x123, counter);
    BYTES_EQUAL(0x91, frame.data[0]);
    BYTES_EQUAL(0x01, frame.data[1]);
}

TEST(E2e, Crc8IsJ1850WithoutItsXors) {
    // The catalogue's check value of CRC-8/SAE-J1850 over "123456789" is 0x4B with start value and final XOR
    // 0xFF.
    const std::array<std::uint8_t, 9> digits = {'1', '2', '3', '4', '5', '6', '7', '8', '9'};
    BYTES_EQUAL(0x4B, can::crc8(digits, 0xFF) ^ 0xFF);
}

TEST(E2e, CrcMatchesBitwiseDivision) {
    std::mt19937 random(1);
    for (int run = 0; run < 2000; ++run) {
        std::vector<std::uint8_t> bytes(2 + random() % 7);
        for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
        const auto data_id = static_cast<std::uint16_t>(random());
        std::vector<std::uint8_t> covered = {static_cast<std::uint8_t>(data_id & 0xFF),
                                             static_cast<std::uint8_t>(data_id >> 8)};
        covered.insert(covered.end(), bytes.begin() + 1, bytes.end());
        BYTES_EQUAL(bitwise_crc(covered), can::e2e_crc(bytes, data_id));
    }
}

TEST(E2e, CounterIsCyclicAndLeavesTheHighNibble) {
    std::uint8_t counter = 0;
    can::Frame frame{.id = 0x400, .length = 8};
    frame.data[1] = 0xA0;
    for (int i = 0; i < 40; ++i) {
        can::e2e_protect(frame, 1, counter);
        BYTES_EQUAL(0xA0 | (i % 15), frame.data[1]);
    }
}

TEST(E2e, LengthsThatCannotBeProtectedAreLeftAlone) {
    for (const int length : {0, 1, 9, 255}) {
        std::uint8_t counter = 3;
        can::Frame frame{.id = 0x400, .length = static_cast<std::uint8_t>(length)};
        const can::Frame before = frame;
        can::e2e_protect(frame, 1, counter);
        CHECK(before == frame);
        BYTES_EQUAL(3, counter);
    }
}

TEST(E2e, EveryStepOfTheCounterHasItsState) {
    for (unsigned from = 0; from < can::kE2eCounters; ++from) {
        for (unsigned step = 0; step < can::kE2eCounters; ++step) {
            can::E2eReceiverState state;
            CHECK(E2eStatus::ok == check(state, protected_frame(static_cast<std::uint8_t>(from))));
            const auto to = static_cast<std::uint8_t>((from + step) % can::kE2eCounters);
            const E2eStatus status = check(state, protected_frame(to));
            const E2eStatus expected = step == 0                            ? E2eStatus::repeated
                                       : step == 1                          ? E2eStatus::ok
                                       : step <= can::E2eConfig{}.max_delta ? E2eStatus::ok_some_lost
                                                                            : E2eStatus::wrong_sequence;
            CHECK(expected == status);
            LONGS_EQUAL(step == 0 ? 0 : step - 1, state.lost);
            // In order again at once.
            const auto next = static_cast<std::uint8_t>((to + 1u) % can::kE2eCounters);
            CHECK(E2eStatus::ok == check(state, protected_frame(next)));
        }
    }
}

TEST(E2e, EverySingleAndDoubleBitErrorIsFound) {
    const can::Frame good = protected_frame(7);
    for (unsigned a = 0; a < 64; ++a) {
        for (unsigned b = a; b < 64; ++b) {
            can::Frame bad = good;
            bad.data[a / 8] = static_cast<std::uint8_t>(bad.data[a / 8] ^ (1u << (a % 8)));
            if (b != a) bad.data[b / 8] = static_cast<std::uint8_t>(bad.data[b / 8] ^ (1u << (b % 8)));
            can::E2eReceiverState state;
            CHECK(E2eStatus::error == check(state, bad));
            CHECK(!state.synchronised);
        }
    }
}

TEST(E2e, ErrorsDoNotMoveTheCounter) {
    can::E2eReceiverState state;
    check(state, protected_frame(4));
    can::Frame bad = protected_frame(9);
    bad.data[5] ^= 1;
    CHECK(E2eStatus::error == check(state, bad));
    CHECK(E2eStatus::ok == check(state, protected_frame(5)));
}

TEST(E2e, CounterFifteenIsAnErrorThoughTheCrcIsRight) {
    can::Frame frame{.id = 0x400, .length = 8};
    frame.data[1] = 0x0F;
    frame.data[0] = can::e2e_crc(frame.data, 0x123);
    can::E2eReceiverState state;
    CHECK(E2eStatus::error == check(state, frame));
}

TEST(E2e, FrameOfAnotherMessageIsAnErrorForAllOurDataIds) {
    for (std::uint16_t sent = 0x400; sent < 0x440; ++sent) {
        for (std::uint16_t expected = 0x400; expected < 0x440; ++expected) {
            can::E2eReceiverState state;
            const E2eStatus status = check(state, protected_frame(0, sent), expected);
            CHECK((sent == expected ? E2eStatus::ok : E2eStatus::error) == status);
        }
    }
}

TEST(E2e, NothingAndTooLittleAreTold) {
    can::E2eReceiverState state;
    CHECK(E2eStatus::no_new_data == can::e2e_check(state, {}, 1));
    const std::array<std::uint8_t, 1> one{};
    CHECK(E2eStatus::error == can::e2e_check(state, one, 1));
    CHECK(!state.synchronised);
}
