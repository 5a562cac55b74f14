#include <array>
#include <cstdint>

#include "hal/common/frame_ring.hpp"

#include <CppUTest/TestHarness.h>

namespace {

/// What the front end's DMA does: frame `stamp` (from 1) into the slots in turn; its first sample is its
/// stamp.
struct Dma {
    hal::RingMemory& memory;

    void begin(std::uint32_t stamp) {
        memory[stamp % 2].opened = stamp;
        memory[stamp % 2].frame.chirp[0][0] = static_cast<std::int16_t>(stamp);
    }
    void end(std::uint32_t stamp) { memory[stamp % 2].closed = stamp; }
    void frame(std::uint32_t stamp) {
        begin(stamp);
        end(stamp);
    }
};

}  // namespace

TEST_GROUP(FrameRing) {
    hal::RingMemory memory{};
    Dma dma{memory};
    hal::FrameRing ring{memory};
    dsp::BeatFrame frame;
    std::uint32_t sequence = 99;

    void taken(std::uint32_t stamp) {
        CHECK_TRUE(ring.take(frame, sequence) == hal::RingResult::taken);
        CHECK_EQUAL(stamp - 1, sequence);
        CHECK_EQUAL(static_cast<std::int16_t>(stamp), frame.chirp[0][0]);
    }
    void none() {
        CHECK_TRUE(ring.take(frame, sequence) == hal::RingResult::none);
    }
};

TEST(FrameRing, nothing_before_the_first_frame) {
    none();
    dma.begin(1);
    none();
}

TEST(FrameRing, each_frame_once) {
    for (std::uint32_t stamp = 1; stamp < 10; ++stamp) {
        dma.frame(stamp);
        taken(stamp);
        none();
    }
    CHECK_EQUAL(9U, ring.counters().taken);
    CHECK_EQUAL(0U, ring.counters().lost);
}

TEST(FrameRing, newest_of_two_and_the_lost_one_is_counted) {
    dma.frame(1);
    taken(1);
    dma.frame(2);
    dma.frame(3);
    taken(3);
    none();
    CHECK_EQUAL(1U, ring.counters().lost);
}

TEST(FrameRing, a_frame_being_written_is_not_touched) {
    dma.frame(1);
    dma.begin(2);
    taken(1);
    none();
    dma.end(2);
    taken(2);
}

TEST(FrameRing, the_slot_is_overwritten_while_the_loop_was_away) {
    dma.frame(1);
    taken(1);
    for (std::uint32_t stamp = 2; stamp <= 7; ++stamp) dma.frame(stamp);
    dma.begin(8);  // into the slot of 6
    taken(7);
    CHECK_EQUAL(5U, ring.counters().lost);
}

/// The front end starts anew: what lies in memory is older than what was handed out, so one frame is refused,
/// then all goes on.
TEST(FrameRing, stamps_that_go_back_are_stale_once) {
    dma.frame(1000);
    taken(1000);
    dma.frame(1);
    CHECK_TRUE(ring.take(frame, sequence) == hal::RingResult::stale);
    none();
    dma.frame(2);
    taken(2);
    CHECK_EQUAL(1U, ring.counters().stale);
    CHECK_EQUAL(0U, ring.counters().lost);
}

TEST(FrameRing, a_stuck_dma_gives_nothing_new) {
    dma.frame(5);
    taken(5);
    dma.frame(5);
    none();
}

TEST(FrameRing, stamps_may_wrap) {
    dma.frame(0xFFFF'FFFF);
    taken(0xFFFF'FFFF);
    dma.frame(2);  // 0 means never written and 1 was lost
    taken(2);
    CHECK_EQUAL(2U, ring.counters().lost);
}

TEST(FrameRing, writer_in_place_of_a_dma) {
    for (std::uint32_t n = 0; n < 5; ++n) {
        ring.open().chirp[0][0] = static_cast<std::int16_t>(n + 1);
        none();
        CHECK_TRUE(ring.close(n));
        taken(n + 1);
    }
    static_cast<void>(ring.open());
    CHECK_FALSE(ring.close(0xFFFF'FFFF));
    none();
}

/// While the copy is made the DMA begins to write the same slot. The second look at the stamps must notice. A
/// thread would do it at an arbitrary moment; a destination that overlaps the stamp does it at a certain one.
TEST(FrameRing, torn_frame) {
    hal::RingMemory two{};
    hal::FrameRing own(two);
    Dma{two}.frame(1);
    // The copy's destination ends on the slot's stamps: copying changes them, as a DMA would.
    auto* target = reinterpret_cast<dsp::BeatFrame*>(&two[1]);
    two[1].frame.chirp[0][0] = 77;
    CHECK_TRUE(own.take(*target, sequence) == hal::RingResult::torn);
    CHECK_EQUAL(1U, own.counters().torn);
}
