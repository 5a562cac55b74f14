// A board is played by a replica of its own, whose inputs differ from what the PC believes: in when a frame
// or an ego motion is seen, in frames that never arrive, in late cycles. Only a byte that no such input
// explains may be reported.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "can/codec.hpp"
#include "can/signals.hpp"
#include "can/transmitter.hpp"
#include "host_sim/beat_synthesis.hpp"
#include "host_sim/board_twin.hpp"
#include "host_sim/scenario.hpp"
#include "host_sim/world.hpp"

#include <CppUTest/TestHarness.h>

namespace {

constexpr firmware::RadarConfig kConfig{};
constexpr int kFrames = 30;

std::vector<dsp::BeatFrame> synthesise_beats() {
    const sim::World world(sim::load_scenario("four-targets"), 7);
    const sim::BeatSynthesis synthesis(world.scenario().waveform, world.scenario().front_end, 7);
    std::vector<dsp::BeatFrame> frames(kFrames);
    for (std::size_t i = 0; i < frames.size(); ++i)
        synthesis.synthesise(world.echoes(i), world.bursts(i), i, frames[i]);
    return frames;
}
const std::vector<dsp::BeatFrame> kBeats = synthesise_beats();

struct Bench {
    sim::FirmwareReplica board{kConfig};
    sim::BoardTwin twin{kConfig};
    can::Transmitter car;
    std::uint32_t next = 0;
    std::vector<sim::ListVerdict> verdicts;

    can::Frame ego(int speed_mmps) {
        const can::Frame frame = car.frame(can::EgoMotion{.speed_mmps = speed_mmps, .valid = true});
        twin.bus_sent(frame);
        return frame;
    }
    const dsp::BeatFrame& send_beat() {
        twin.beat_sent(next, kBeats[next % kFrames]);
        return kBeats[next++ % kFrames];
    }
    sim::CycleInputs with_beat() {
        const dsp::BeatFrame& frame = send_beat();
        return {.beat = hal::BeatResult::ok, .frame = &frame, .sequence = next - 1};
    }
    void hear(const can::Frame& frame) {
        if (const auto verdict = twin.receive(frame)) verdicts.push_back(*verdict);
    }
    /// The board's cycle, and its list over to the twin.
    std::vector<can::Frame> cycle(const sim::CycleInputs& inputs) {
        auto list = board.run(inputs);
        for (const can::Frame& frame : list) hear(frame);
        return list;
    }
    void cycles(int count) {
        for (int i = 0; i < count; ++i) cycle(with_beat());
    }
    void finish() {
        if (const auto verdict = twin.give_up_list()) verdicts.push_back(*verdict);
    }
    [[nodiscard]] int different() const {
        int count = 0;
        for (const auto& v : verdicts) count += v.identical ? 0 : 1;
        return count;
    }
};

}  // namespace

TEST_GROUP(BoardTwin){};

TEST(BoardTwin, TheSameInputsGiveIdenticalLists) {
    Bench b;
    for (int i = 0; i < kFrames; ++i) {
        const can::Frame ego = b.ego(20'000 + 10 * i);
        auto inputs = b.with_beat();
        inputs.bus = {&ego, 1};
        b.cycle(inputs);
    }
    b.finish();
    LONGS_EQUAL(kFrames, b.verdicts.size());
    LONGS_EQUAL(0, b.different());
    LONGS_EQUAL(kFrames, b.twin.counters().processed);
    LONGS_EQUAL(0, b.twin.counters().missing);
    LONGS_EQUAL(0, b.twin.outstanding());
    CHECK_TRUE(b.twin.counters().can_frames > 5 * kFrames);  // objects among them
}

TEST(BoardTwin, AListIsSettledByItsLastFrame) {
    Bench b;
    b.cycles(12);
    LONGS_EQUAL(12, b.verdicts.size());  // with the version message at its end in lists 1 and 11
    LONGS_EQUAL(11, b.verdicts.back().sequence);
}

TEST(BoardTwin, FramesTheBoardNeverHadAreCountedAndTheRestIsIdentical) {
    Bench b;
    b.cycles(5);
    b.cycle({.beat = hal::BeatResult::missing});
    b.send_beat();
    b.cycle({.beat = hal::BeatResult::invalid});  // came damaged
    b.cycles(10);
    b.finish();
    LONGS_EQUAL(0, b.different());
    LONGS_EQUAL(15, b.twin.counters().processed);
    LONGS_EQUAL(2, b.twin.counters().missing + b.twin.counters().invalid);
}

TEST(BoardTwin, AFrameSeenOneCycleLaterIsNoDifference) {
    Bench b;
    b.cycles(5);
    const dsp::BeatFrame& late = b.send_beat();
    b.cycle({.beat = hal::BeatResult::missing});
    b.cycle({.beat = hal::BeatResult::ok, .frame = &late, .sequence = b.next - 1});
    b.cycles(5);
    b.finish();
    LONGS_EQUAL(0, b.different());
    LONGS_EQUAL(11, b.twin.counters().processed);
}

TEST(BoardTwin, EgoMotionSeenOneCycleLaterIsNoDifference) {
    Bench b;
    std::vector<can::Frame> waiting;
    for (int i = 0; i < kFrames; ++i) {
        waiting.push_back(b.ego(20'000 + 500 * i));
        auto inputs = b.with_beat();
        const bool late = i % 7 == 3;
        if (!late) inputs.bus = waiting;
        b.cycle(inputs);
        if (!late) waiting.clear();
    }
    b.finish();
    LONGS_EQUAL(0, b.different());
    LONGS_EQUAL(kFrames, b.twin.counters().processed);
}

TEST(BoardTwin, InputsThatShowOnlyLaterAreNoDifference) {
    // After a restart the fault bits are held for five cycles, so that when exactly the first ego motion or
    // frame was seen shows only at their end.
    for (int ego_at = 1; ego_at < 6; ++ego_at) {
        for (int beat_at = 1; beat_at < 6; ++beat_at) {
            Bench b;
            b.cycle({.beat = hal::BeatResult::missing});
            const can::Frame ego = b.ego(20'000);
            const dsp::BeatFrame& first = b.send_beat();
            for (int i = 1; i < 12; ++i) {
                sim::CycleInputs inputs{.beat = hal::BeatResult::missing};
                if (i == beat_at) inputs = {.beat = hal::BeatResult::ok, .frame = &first, .sequence = 0};
                if (i == ego_at) inputs.bus = {&ego, 1};
                b.cycle(inputs);
            }
            b.finish();
            LONGS_EQUAL(0, b.different());
            LONGS_EQUAL(1, b.twin.counters().processed);
        }
    }
}

// The bit FrameInvalid is held for five cycles as well, and a board with a slow line leaves the next frame
// unanswered for many: whether a cycle had a damaged frame or none shows late.
TEST(BoardTwin, AFrameAfterADamagedOneMayBeLongOnItsWay) {
    for (const int ego_at : {1, 2, 7}) {
        Bench b;
        b.cycle({.beat = hal::BeatResult::missing});
        can::Frame ego = b.ego(20'000);
        b.send_beat();  // and comes damaged
        for (int i = 0; i < 10; ++i) {
            sim::CycleInputs inputs{.beat = hal::BeatResult::missing};
            if (i == ego_at) inputs.bus = {&ego, 1};
            b.cycle(inputs);
        }
        b.cycle({.beat = hal::BeatResult::invalid});
        LONGS_EQUAL(0, b.twin.outstanding());
        ego = b.ego(20'100);
        const dsp::BeatFrame& second = b.send_beat();
        for (int i = 0; i < 12; ++i) {
            sim::CycleInputs inputs{.beat = hal::BeatResult::missing};
            if (i == ego_at) inputs.bus = {&ego, 1};
            b.cycle(inputs);
        }
        b.cycle({.beat = hal::BeatResult::ok, .frame = &second, .sequence = b.next - 1});
        b.cycle({.beat = hal::BeatResult::missing});
        b.finish();
        LONGS_EQUAL(0, b.different());
        LONGS_EQUAL(1, b.twin.counters().invalid);
        LONGS_EQUAL(1, b.twin.counters().processed);
        LONGS_EQUAL(0, b.twin.outstanding());
    }
}

// Half a packet of an earlier run swallows the head of the first one, which is found all the same.
TEST(BoardTwin, ADamagedFrameMayBeOneFromBeforeTheRun) {
    Bench b;
    b.cycle({.beat = hal::BeatResult::missing});
    const dsp::BeatFrame& first = b.send_beat();
    b.cycle({.beat = hal::BeatResult::invalid});
    b.cycle({.beat = hal::BeatResult::ok, .frame = &first, .sequence = b.next - 1});
    b.cycles(10);
    b.finish();
    LONGS_EQUAL(0, b.different());
    LONGS_EQUAL(11, b.twin.counters().processed);
}

TEST(BoardTwin, LateCyclesAreRecognised) {
    Bench b;
    b.cycles(5);
    for (int i = 0; i < 3; ++i) {
        auto inputs = b.with_beat();
        inputs.overrun = true;
        b.cycle(inputs);
        b.cycles(7);
    }
    b.finish();
    LONGS_EQUAL(0, b.different());
    LONGS_EQUAL(3, b.twin.counters().overruns);
}

TEST(BoardTwin, ABoardThatRanBeforeIsIdenticalFromItsRestartOn) {
    Bench b;
    can::Transmitter before;
    for (int i = 0; i < 20; ++i) {  // another PC's session, with frames lost on the bus
        const can::Frame ego = before.frame(can::EgoMotion{.speed_mmps = 30'000, .valid = true});
        b.board.run({.beat = hal::BeatResult::ok,
                     .frame = &kBeats[static_cast<std::size_t>(i)],
                     .sequence = 500U + static_cast<std::uint32_t>(i),
                     .overrun = i == 4,
                     .bus = {&ego, 1}});
    }
    const can::Frame restart = b.car.frame(can::Command{can::CommandCode::restart, 1, 0});
    b.twin.bus_sent(restart);
    const auto first = b.cycle({.bus = {&restart, 1}});
    can::Status status;
    CHECK_TRUE(can::decode(first.front(), status));
    LONGS_EQUAL(0, status.cycle);
    for (int i = 0; i < kFrames; ++i) {
        const can::Frame ego = b.ego(20'000);
        auto inputs = b.with_beat();
        inputs.bus = {&ego, 1};
        b.cycle(inputs);
    }
    b.finish();
    LONGS_EQUAL(0, b.different());
    LONGS_EQUAL(kFrames, b.twin.counters().processed);
}

TEST(BoardTwin, EverySingleWrongBitOfAListIsReported) {
    Bench b;
    b.cycles(15);
    const sim::FirmwareReplica board_before = b.board;
    const dsp::BeatFrame frame = kBeats[20];
    const auto list = sim::FirmwareReplica(board_before)
                          .run({.beat = hal::BeatResult::ok, .frame = &frame, .sequence = 15});
    CHECK_TRUE(list.size() >= 5);
    for (std::size_t f = 0; f < list.size(); ++f) {
        for (std::size_t bit = 0; bit < 8U * list[f].length; ++bit) {
            Bench fresh;
            fresh.cycles(15);
            fresh.twin.beat_sent(15, frame);
            for (std::size_t i = 0; i < list.size(); ++i) {
                can::Frame sent = list[i];
                if (i == f)
                    sent.data[bit / 8] = static_cast<std::uint8_t>(sent.data[bit / 8] ^ 1U << bit % 8);
                fresh.hear(sent);
            }
            fresh.finish();
            if (fresh.different() != 1)
                FAIL(("wrong bit " + std::to_string(bit) + " of frame " + std::to_string(f)).c_str());
            STRCMP_CONTAINS(("board " + std::string(sim::to_text(list[f]), 0, 3)).c_str(),
                            fresh.verdicts.back().difference.c_str());
            if (bit == 3 && f > 2) break;  // all bits of the first frames, some of the others: 15 cycles each
        }
    }
}

TEST(BoardTwin, AMissingAndAnAdditionalFrameAreReported) {
    for (const bool additional : {false, true}) {
        Bench b;
        b.cycles(15);
        const auto inputs = b.with_beat();
        const auto list = b.board.run(inputs);
        for (std::size_t i = 0; i + (additional ? 0 : 1) < list.size(); ++i) b.hear(list[i]);
        if (additional) b.hear(list.back());
        b.finish();
        LONGS_EQUAL(1, b.different());
        STRCMP_CONTAINS(additional ? "after the end of the list came" : "board nothing more",
                        b.verdicts.back().difference.c_str());
        b.cycles(3);  // and the lists after it are compared again
        LONGS_EQUAL(1, b.different());
    }
}

TEST(BoardTwin, AnotherResultForTheSameFrameIsReported) {
    firmware::RadarConfig other = kConfig;
    other.dsp.cfar.offset_cdb = 100;
    Bench b;
    sim::FirmwareReplica board(other);
    for (int i = 0; i < kFrames; ++i)
        for (const can::Frame& frame : board.run(b.with_beat())) b.hear(frame);
    b.finish();
    CHECK_TRUE(b.different() > 0);
}

TEST(BoardTwin, OtherNodesAreNoPartOfTheList) {
    Bench b;
    b.cycles(3);
    for (const can::Frame& frame : b.board.run(b.with_beat())) {
        b.hear({.id = 0x123, .length = 1});
        b.hear(frame);
        b.hear({.id = can::ego::kMessage.id, .length = 8});
    }
    b.finish();
    LONGS_EQUAL(0, b.different());
    LONGS_EQUAL(4, b.verdicts.size());
}
