// The whole loop on a board in memory: what must be on the bus, by the meaning of the messages in
// can/messages.hpp.
#include <array>
#include <memory>
#include <optional>

#include "can/receiver.hpp"
#include "firmware/radar.hpp"
#include "tests/firmware/fake_board.hpp"

#include <CppUTest/TestHarness.h>

using firmware::Radar;
using firmware::RadarConfig;
using test::Fault;

namespace {

/// What a consumer makes of the frames of one cycle.
struct Heard {
    std::optional<can::Status> status;
    std::optional<can::ObjectListHeader> header;
    std::optional<can::CollisionWarning> warning;
    std::optional<can::CommandEcho> echo;
    std::optional<can::Version> version;
    std::array<can::Object, can::kMaxObjects> object{};
    int kinematics = 0;
    int quality = 0;
    int echoes = 0;
    int rejected = 0;
};

class Rig {
  public:
    explicit Rig(const RadarConfig& config = {}) : radar_(std::make_unique<Radar>(config, fake.board())) {
        radar_->start();
    }
    Radar& radar() { return *radar_; }

    Heard cycle(int ego_mmps = 20'000) {
        if (ego_mmps >= 0) fake.send_ego(ego_mmps);
        fake.can.sent.clear();
        CHECK(radar_->run_cycle());
        return heard();
    }
    Heard cycles(int n, int ego_mmps = 20'000) {
        Heard last;
        for (int i = 0; i < n; ++i) last = cycle(ego_mmps);
        return last;
    }
    Heard command(can::CommandCode code, int value) {
        fake.can.to_radar.push_back(fake.car.frame(can::Command{code, ++sequence_, value}));
        return cycle();
    }

    test::FakeBoard fake;

  private:
    Heard heard() {
        Heard h;
        const auto read = [&](const can::Frame& frame, auto& slot) {
            slot.emplace();
            if (!can::is_good(receiver_.receive(frame, *slot))) ++h.rejected;
        };
        for (const can::Frame& frame : fake.can.sent) {
            switch (frame.id) {
                case 0x400:
                    read(frame, h.status);
                    break;
                case 0x401:
                    read(frame, h.version);
                    break;
                case 0x402:
                    read(frame, h.warning);
                    break;
                case 0x403:
                    read(frame, h.echo);
                    ++h.echoes;
                    break;
                case 0x410:
                    read(frame, h.header);
                    break;
                default: {
                    const bool first_half = frame.id < 0x421;
                    const auto index = static_cast<std::size_t>(frame.id - (first_half ? 0x411 : 0x421));
                    ++(first_half ? h.kinematics : h.quality);
                    if (!can::is_good(receiver_.receive(frame, h.object.at(index)))) ++h.rejected;
                }
            }
        }
        return h;
    }

    can::Receiver receiver_;
    std::unique_ptr<Radar> radar_;
    std::uint8_t sequence_ = 0;
};

bool has(const Heard& h, can::Fault fault) {
    return (h.status->faults & static_cast<unsigned>(fault)) != 0;
}

}  // namespace

TEST_GROUP(Radar){};

TEST(Radar, TracksOneTargetAndSaysSoOnTheBus) {
    Rig rig;
    const Heard h = rig.cycles(10);
    CHECK(rig.fake.watchdog.started);
    LONGS_EQUAL(10, rig.fake.watchdog.kicks);
    LONGS_EQUAL(0, h.rejected);
    CHECK(h.status->mode == can::Mode::operating);
    LONGS_EQUAL(0, h.status->faults);
    CHECK(h.header->valid);
    LONGS_EQUAL(1, h.header->count);
    LONGS_EQUAL(1, h.kinematics);
    LONGS_EQUAL(1, h.quality);
    // Range cell 10 is 49.965 m; standing still relative to us, so moving with us at 20 m/s.
    DOUBLES_EQUAL(49'965, h.object[0].range_mm, 100);
    DOUBLES_EQUAL(0, h.object[0].range_rate_mmps, 50);
    CHECK(h.object[0].motion == can::Motion::moving);
    LONGS_EQUAL(h.header->cycle, h.object[0].cycle);
    LONGS_EQUAL(h.header->cycle, h.status->cycle);
    LONGS_EQUAL(h.header->cycle, h.warning->cycle);
    CHECK(h.warning->valid);
    CHECK(h.warning->level == can::WarningLevel::none);
}

TEST(Radar, KeepsThePeriodOfATenthOfASecond) {
    Rig rig;
    rig.cycles(50);
    LONGS_EQUAL(49 * 100'000, rig.fake.clock.time_us);
    LONGS_EQUAL(0, rig.radar().counters().overruns);
}

TEST(Radar, VersionComesOnceASecond) {
    Rig rig;
    int versions = 0;
    for (int i = 0; i < 30; ++i) versions += rig.cycle().version.has_value() ? 1 : 0;
    LONGS_EQUAL(3, versions);
}

TEST(Radar, AFaultNeverLooksLikeAnEmptyRoad) {
    struct Case {
        Fault fault;
        can::Fault bit;
        bool valid;  ///< may the list still be used?
    };
    const Case cases[] = {
        {Fault::missing_frame, can::Fault::frame_missing, false},
        {Fault::short_frame, can::Fault::frame_invalid, false},
        {Fault::sequence_gap, can::Fault::frame_missing, false},
        {Fault::dead_adc, can::Fault::adc_dead, false},
        {Fault::stuck_adc, can::Fault::adc_stuck, false},
        {Fault::stuck_chirp, can::Fault::adc_stuck, false},
        {Fault::clipped, can::Fault::frame_invalid, false},
        {Fault::interference, can::Fault::interference, true},
        {Fault::slow_cycle, can::Fault::overrun, true},
    };
    for (const Case& item : cases) {
        Rig rig;
        rig.cycles(10);
        rig.fake.front_end.fault = item.fault;
        const Heard h = rig.cycles(2);
        CHECK(has(h, item.bit));
        CHECK_EQUAL(item.valid, h.header->valid);
        CHECK_EQUAL(item.valid, h.warning->valid);
        CHECK(h.status->mode == (item.valid ? can::Mode::degraded : can::Mode::failed));

        rig.fake.front_end.fault = Fault::none;
        const Heard after = rig.cycles(10);
        LONGS_EQUAL(0, after.status->faults);
        CHECK(after.header->valid);
        LONGS_EQUAL(1, after.header->count);
    }
}

TEST(Radar, SeeingNothingWhileMovingIsBlockedAndNotEmpty) {
    Rig rig;
    rig.fake.front_end.fault = Fault::noise_only;
    Heard h = rig.cycles(2 * firmware::HealthConfig{}.blocked_cycles);
    CHECK(has(h, can::Fault::blocked));
    CHECK(!h.header->valid);

    Rig parked;
    parked.fake.front_end.fault = Fault::noise_only;
    h = parked.cycles(200, 0);
    LONGS_EQUAL(0, h.status->faults);
    CHECK(h.header->valid);
    LONGS_EQUAL(0, h.header->count);
}

TEST(Radar, WithoutEgoMotionItSaysSoAndGoesOn) {
    Rig rig;
    const Heard h = rig.cycles(10, -1);
    CHECK(has(h, can::Fault::ego_stale));
    CHECK(h.header->valid);
    LONGS_EQUAL(1, h.header->count);
    CHECK(h.object[0].motion == can::Motion::unknown);
}

TEST(Radar, FramesTheBusLosesShowInTheNextStatus) {
    Rig rig;
    rig.cycles(10);
    rig.fake.can.down = true;
    rig.cycle();
    rig.fake.can.down = false;
    CHECK(has(rig.cycle(), can::Fault::can_error));
}

TEST(Radar, CommandsAreValidatedAppliedAndEchoed) {
    Rig rig;
    rig.cycles(10);
    Heard h = rig.command(can::CommandCode::set_cfar_scale, 300);
    CHECK(h.echo->result == can::CommandResult::applied);
    LONGS_EQUAL(300, h.echo->value);
    LONGS_EQUAL(1, h.echo->sequence);
    h = rig.command(can::CommandCode::set_cfar_scale, 32'000);
    CHECK(h.echo->result == can::CommandResult::value_out_of_range);
    LONGS_EQUAL(300, h.echo->value);  // what is in force, not what was asked for
    h = rig.command(can::CommandCode::set_min_snr, -1);
    CHECK(h.echo->result == can::CommandResult::value_out_of_range);
    LONGS_EQUAL(0, h.echo->value);
    h = rig.command(can::CommandCode::set_tracker, static_cast<int>(tracking::Associator::pda));
    CHECK(h.echo->result == can::CommandResult::applied);
    h = rig.command(can::CommandCode::set_tracker, 200);
    CHECK(h.echo->result == can::CommandResult::value_out_of_range);
    LONGS_EQUAL(static_cast<int>(tracking::Associator::pda), h.echo->value);
    LONGS_EQUAL(3, rig.radar().counters().commands_refused);
    CHECK(!rig.cycle().echo.has_value());  // one echo a command

    h = rig.cycles(10);
    LONGS_EQUAL(1, h.header->count);
    h = rig.command(can::CommandCode::reset_tracks, 0);
    LONGS_EQUAL(0, h.header->count);
}

TEST(Radar, AnswersSeveralCommandsOfOneCycle) {
    Rig rig;
    rig.cycles(10);
    for (int i = 0; i < 6; ++i) {
        const can::Command command{can::CommandCode::set_min_snr, static_cast<std::uint8_t>(i), 100 * i};
        rig.fake.can.to_radar.push_back(rig.fake.car.frame(command));
    }
    const Heard h = rig.cycle();
    LONGS_EQUAL(4, h.echoes);
    LONGS_EQUAL(300, h.echo->value);
    LONGS_EQUAL(2, rig.radar().counters().commands_refused);
    LONGS_EQUAL(300, rig.radar().config().dsp.peaks.min_snr_cdb);
}

TEST(Radar, RestartBeginsAgainAtCycleZero) {
    Rig rig;
    const Heard first = rig.cycle();
    LONGS_EQUAL(0, first.status->cycle);
    rig.command(can::CommandCode::set_cfar_scale, 300);
    rig.cycles(20);
    const Heard h = rig.command(can::CommandCode::restart, 0);
    LONGS_EQUAL(0, h.status->cycle);
    CHECK(h.status->mode == can::Mode::starting);
    LONGS_EQUAL(0, rig.radar().config().dsp.cfar.offset_cdb);
    LONGS_EQUAL(0, h.header->count);
}

TEST(Radar, SpoiledInputFramesChangeNothing) {
    Rig rig;
    rig.cycles(10);
    can::Frame bad = rig.fake.car.frame(can::Command{can::CommandCode::reset_tracks, 1, 0});
    bad.data[3] ^= 1;  // CRC
    rig.fake.can.to_radar.push_back(bad);
    bad.length = 3;
    rig.fake.can.to_radar.push_back(bad);
    rig.fake.can.to_radar.push_back(can::Frame{.id = 0x7FF, .length = 8});
    const Heard h = rig.cycle();
    CHECK(!h.echo.has_value());
    LONGS_EQUAL(1, h.header->count);
}

TEST(Radar, DetectionsFromElsewhereGoTheSameWay) {
    Rig rig;
    dsp::DetectionList list;
    list.count = 1;
    list.item[0].range_m = dsp::Real(60);
    list.item[0].range_rate_mps = dsp::Real(-5);
    list.item[0].range_variance_m2 = dsp::Real::ratio(1, 4);
    list.item[0].rate_variance_m2ps2 = dsp::Real::ratio(1, 100);
    list.item[0].snr_db = dsp::Real(20);
    for (int i = 0; i < 6; ++i) {
        rig.fake.send_ego(20'000);
        rig.radar().run_cycle(list);
        list.item[0].range_m -= dsp::Real::ratio(1, 2);
    }
    LONGS_EQUAL(1, rig.radar().tracks().size());
    CHECK(rig.radar().health().output_valid());
}
