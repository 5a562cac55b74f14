#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "hal/common/beat_input.hpp"
#include "hal/common/beat_link.hpp"
#include "hal/common/receiving_clock.hpp"

#include <CppUTest/TestHarness.h>

namespace {

constexpr std::uint64_t kPeriod_us = 100'000;
constexpr std::uint64_t kByte_us = 10;  // 1 Mbaud, 8N1
constexpr std::size_t kFifo = 64;       // bytes
constexpr std::uint32_t kLook_us = 400;

/// A processor in which every look at a register takes time, and a UART that loses what does not fit its
/// FIFO.
struct FakeBoard {
    std::uint64_t time_us = 0;
    std::vector<std::uint8_t> wire;  ///< sent from start_us on
    std::uint64_t start_us = 0;
    std::size_t arrived = 0;
    std::size_t lost = 0;
    std::vector<std::uint8_t> fifo;

    void pass(std::uint64_t us) {
        time_us += us;
        while (arrived < wire.size() && start_us + (arrived + 1) * kByte_us <= time_us) {
            if (fifo.size() < kFifo) {
                fifo.push_back(wire[arrived]);
            } else {
                ++lost;
            }
            ++arrived;
        }
    }
    int read() {
        pass(1);
        if (fifo.empty()) return -1;
        const int byte = fifo.front();
        fifo.erase(fifo.begin());
        return byte;
    }
    std::uint64_t now_us() {
        pass(1);
        return time_us;
    }
    void pause() { pass(1); }
    void wait_until(std::uint64_t until_us) {
        while (now_us() < until_us) {
        }
    }
};

hal::RingMemory ring_memory;

}  // namespace

TEST_GROUP(ReceivingClock) {
    FakeBoard board;
    dsp::BeatFrame frame;
    std::uint32_t sequence = 0;

    void setup() override {
        ring_memory = {};
        dsp::BeatFrame sent;
        for (std::size_t i = 0; i < sent.chirp.size(); ++i) sent.chirp[i].fill(static_cast<std::int16_t>(i));
        hal::BeatPacket packet;
        hal::encode_beat_packet(sent, 7, packet);
        board.wire.assign(packet.begin(), packet.end());
        board.start_us = 20'000;  // the cycle before is done, the next begins at 100 ms
    }
};

TEST(ReceivingClock, a_frame_that_begins_between_two_cycles_is_there_at_the_next) {
    hal::BeatInput beat(ring_memory, board, board, kPeriod_us);
    hal::ReceivingClock clock(board, beat, kLook_us);
    clock.wait_until(kPeriod_us);
    CHECK_TRUE(beat.acquire(frame, sequence) == hal::BeatResult::ok);
    CHECK_EQUAL(7U, sequence);
    CHECK_EQUAL(63, frame.chirp[63][63]);
    CHECK_EQUAL(0U, board.lost);
}

TEST(ReceivingClock, without_it_the_frame_is_lost) {
    hal::BeatInput beat(ring_memory, board, board, kPeriod_us);
    board.wait_until(kPeriod_us);
    CHECK_TRUE(beat.acquire(frame, sequence) != hal::BeatResult::ok);
    CHECK_TRUE(board.lost > 7000);
}

/// With less than a FIFO between two looks nothing is lost, with more something is: kLook_us is no guess.
TEST(ReceivingClock, looks_often_enough) {
    for (const std::uint32_t look_us : {100U, kLook_us, 600U, 700U, 2000U}) {
        board.time_us = 0;
        board.arrived = board.lost = 0;
        board.fifo.clear();
        hal::BeatInput beat(ring_memory, board, board, kPeriod_us);
        hal::ReceivingClock clock(board, beat, look_us);
        clock.wait_until(kPeriod_us + 5'000);
        CHECK_EQUAL(look_us < kFifo * kByte_us, board.lost == 0);
    }
}

TEST(ReceivingClock, damage_that_came_between_two_cycles_shows_in_the_next_one_only) {
    board.wire[5000] ^= 1;
    hal::BeatInput beat(ring_memory, board, board, kPeriod_us);
    hal::ReceivingClock clock(board, beat, kLook_us);
    clock.wait_until(150'000);
    CHECK_TRUE(beat.acquire(frame, sequence) == hal::BeatResult::invalid);
    clock.wait_until(250'000);
    CHECK_TRUE(beat.acquire(frame, sequence) == hal::BeatResult::missing);
}

TEST(ReceivingClock, waits_until_the_time_and_not_longer) {
    hal::BeatInput beat(ring_memory, board, board, kPeriod_us);
    hal::ReceivingClock clock(board, beat, kLook_us);
    clock.wait_until(5'000);
    CHECK_TRUE(board.time_us >= 5'000 && board.time_us < 5'010);
    clock.wait_until(4'000);
    CHECK_TRUE(board.time_us < 5'020);
}
