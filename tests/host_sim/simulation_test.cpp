// The firmware in its world, in process: what must hold for any signal processing and tracker worth the name.
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "can/messages.hpp"
#include "host_sim/simulation.hpp"
#include "host_sim/summary.hpp"
#include "tests/host_sim/quiet_run.hpp"

#include <CppUTest/TestHarness.h>

using sim_test::quiet;
using sim_test::simulate;

namespace {

std::string error_of(const sim::SimulationOptions& options) {
    try {
        (void)simulate(options);
    } catch (const sim::InputError& e) {
        return e.what();
    }
    return "";
}

std::string contents(const std::filesystem::path& file) {
    std::ostringstream text;
    text << std::ifstream(file, std::ios::binary).rdbuf();
    return text.str();
}

}  // namespace

TEST_GROUP(Simulation) {
    std::filesystem::path folder = std::filesystem::temp_directory_path() / "simulation_test";
    void setup() {
        std::filesystem::create_directories(folder);
    }
    void teardown() {
        std::filesystem::remove_all(folder);
    }
};

TEST(Simulation, EveryTrackerFollowsTheFourTargets) {
    for (std::size_t i = 0; i < tracking::kAssociatorNames.size(); ++i) {
        auto options = quiet("four-targets", 60);
        options.tracker = static_cast<tracking::Associator>(i);
        const auto r = simulate(options);
        STRCMP_EQUAL(std::string(tracking::kAssociatorNames[i]).c_str(), r.tracker.c_str());
        LONGS_EQUAL(4, r.metrics.confirmed_tracks);
        LONGS_EQUAL(0, r.metrics.false_tracks);
        LONGS_EQUAL(0, r.metrics.id_switches);
        CHECK(r.metrics.range_rmse_m < 0.3);
        CHECK(r.metrics.velocity_rmse_mps < 0.3);
    }
}

TEST(Simulation, EveryTrackerWithClutterCountedInTheGates) {
    for (std::size_t i = 0; i < tracking::kAssociatorNames.size(); ++i) {
        auto options = quiet("four-targets", 60);
        options.tracker = static_cast<tracking::Associator>(i);
        options.nonparametric = true;
        const auto m = simulate(options).metrics;
        LONGS_EQUAL(4, m.confirmed_tracks);
        LONGS_EQUAL(0, m.false_tracks);
        LONGS_EQUAL(0, m.id_switches);
    }
}

TEST(Simulation, LevelOfIterativeJipdaIsTaken) {
    auto options = quiet("four-targets", 20);
    options.tracker = tracking::Associator::ijipda;
    options.tracker_level = 0;
    CHECK(simulate(options).metrics.confirmed_tracks == 4);
}

TEST(Simulation, TracksTheFourTargets) {
    const auto r = simulate(quiet("four-targets", 60));
    LONGS_EQUAL(60, r.frames);
    LONGS_EQUAL(4, r.metrics.targets);
    LONGS_EQUAL(0, r.metrics.never_confirmed);
    LONGS_EQUAL(0, r.metrics.false_tracks);
    LONGS_EQUAL(0, r.metrics.track_losses);
    CHECK(*r.metrics.first_confirmation_s <= 0.6);
    CHECK(r.metrics.range_rmse_m < 0.6 && r.metrics.velocity_rmse_mps < 0.2);
    LONGS_EQUAL(0, r.faults);
    LONGS_EQUAL(0, r.overruns);
    // Status, warning and header in each cycle, two frames an object once they are confirmed.
    CHECK(r.can_frames > 60 * 3 + 50 * 8);
    LONGS_EQUAL(0, r.dropped_frames);
}

TEST(Simulation, LeakageAndRoadAloneAreNoTargets) {
    const auto r = simulate(quiet("empty", 300));
    LONGS_EQUAL(0, r.metrics.false_tracks);
    LONGS_EQUAL(0, r.metrics.confirmed_tracks);
}

TEST(Simulation, WarnsWhenTheVehicleAheadBrakes) {
    sim::Simulation simulation(quiet("approach", 110));
    auto highest = tracking::WarningLevel::none;
    while (simulation.step()) highest = std::max(highest, simulation.view().radar.warning().level);
    CHECK(highest == tracking::WarningLevel::brake);
}

TEST(Simulation, OverCapacityAndInterferenceAreReportedAsFaults) {
    CHECK((simulate(quiet("over-capacity", 20)).faults & static_cast<int>(can::Fault::over_capacity)) != 0);
    CHECK((simulate(quiet("interference", 130)).faults & static_cast<int>(can::Fault::interference)) != 0);
}

TEST(Simulation, TheSameSeedGivesTheSameBytesAndAnotherSeedOthers) {
    auto o = quiet("highway", 20);
    o.log = folder / "a.log";
    simulate(o);
    o.log = folder / "b.log";
    simulate(o);
    CHECK(contents(folder / "a.log") == contents(folder / "b.log"));
    CHECK(contents(folder / "a.log").size() > 1000);
    o.seed = 2;
    o.log = folder / "c.log";
    simulate(o);
    CHECK(contents(folder / "a.log") != contents(folder / "c.log"));
}

TEST(Simulation, ARecordingReplaysToTheSameTracks) {
    auto o = quiet("four-targets", 15);
    o.record = folder / "frames.bin";
    sim::Simulation live(o);
    while (live.step()) {
    }
    sim::SimulationOptions again;
    again.replay = folder / "frames.bin";
    again.quiet = true;
    sim::Simulation replay(again);
    LONGS_EQUAL(15, replay.frames());
    while (replay.step()) {
    }
    const auto expected = live.view().radar.tracks();
    const auto actual = replay.view().radar.tracks();
    LONGS_EQUAL(expected.size(), actual.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
        CHECK(expected[i].x[0] == actual[i].x[0] && expected[i].x[1] == actual[i].x[1]);
    }
    const auto json = sim::to_json(replay.result());
    CHECK(json["targets"].is_null() && json["range_rmse_m"].is_null());
    LONGS_EQUAL(4, json["confirmed_tracks"].get<int>());
    STRCMP_EQUAL("frames.bin", json["scenario"].get<std::string>().c_str());
}

TEST(Simulation, DetectionsBypassTheSignalProcessing) {
    {
        std::ofstream csv(folder / "d.csv");
        csv << "frame,range_m,range_rate_mps,snr_db\n";
        for (int i = 0; i < 20; ++i) csv << i << "," << 60 - 0.5 * i << ",-5,25\n";
    }
    sim::SimulationOptions o;
    o.detections = folder / "d.csv";
    o.quiet = true;
    sim::Simulation simulation(o);
    while (simulation.step()) {
    }
    const auto tracks = simulation.view().radar.tracks();
    LONGS_EQUAL(1, tracks.size());
    DOUBLES_EQUAL(50.5, tracking::scalar_from<double>(tracks[0].x[0]), 0.05);
    DOUBLES_EQUAL(-5, tracking::scalar_from<double>(tracks[0].x[1]), 0.05);
    CHECK(simulation.view().map == nullptr);
}

TEST(Simulation, DetectionsKeepTheStrongestAndTheirVarianceFollowsFromTheSnr) {
    {
        std::ofstream csv(folder / "d.csv");
        csv << "frame,range_m,range_rate_mps,snr_db\n";
        for (int i = 0; i < 70; ++i) csv << "2," << 10 + i << ",0," << 15 + i * 0.1 << "\n";
    }
    const auto frames = sim::read_detections(folder / "d.csv", {});
    LONGS_EQUAL(3, frames.size());
    LONGS_EQUAL(0, frames[1].count);
    LONGS_EQUAL(64, frames[2].count);
    LONGS_EQUAL(6, frames[2].dropped);
    DOUBLES_EQUAL(79, tracking::scalar_from<double>(frames[2].item[0].range_m), 1e-5);
    DOUBLES_EQUAL(16, tracking::scalar_from<double>(frames[2].item[63].range_m), 1e-5);
    // 21.9 dB: 1.5^2 x 6 / (4 pi^2 x 154.9) + 0.02^2 cells^2 by hand.
    DOUBLES_EQUAL(0.002608 * 4.996541 * 4.996541,
                  tracking::scalar_from<double>(frames[2].item[0].range_variance_m2), 1e-3);
}

TEST(Simulation, RecordedTrafficIsSynthesisedAndTracked) {
    {
        std::ofstream csv(folder / "t.csv");
        csv << "time_s,track_id,range_m,range_rate_mps\n";
        for (int i = 0; i <= 40; ++i) csv << i * 0.05 << ",7," << 80 - 0.3 * i << ",-6\n";
        std::ofstream(folder / "e.csv") << "time_s,speed_mps\n0,20\n2,22\n";
    }
    sim::SimulationOptions o;
    o.traffic = folder / "t.csv";
    o.ego = folder / "e.csv";
    o.quiet = true;
    sim::Simulation simulation(o);
    LONGS_EQUAL(20, simulation.frames());
    for (int i = 0; i < 10; ++i) CHECK(simulation.step());
    DOUBLES_EQUAL(20.9, simulation.view().ego->speed_mps, 1e-9);
    while (simulation.step()) {
    }
    const auto r = simulation.result();
    LONGS_EQUAL(1, r.metrics.targets);
    LONGS_EQUAL(0, r.metrics.never_confirmed);
    CHECK(r.metrics.range_rmse_m < 0.2);
    LONGS_EQUAL(0, r.faults);
    // Without a word of the car the radar says so.
    o.ego.clear();
    CHECK((simulate(o).faults & static_cast<int>(can::Fault::ego_stale)) != 0);
}

TEST(Simulation, NamesBadInput) {
    sim::SimulationOptions none;
    none.quiet = true;
    STRCMP_CONTAINS("exactly one of scenario, replay, traffic and detections", error_of(none).c_str());
    auto o = quiet("empty", 3);
    o.replay = folder / "x.bin";
    STRCMP_CONTAINS("exactly one", error_of(o).c_str());
    o = quiet("empty", 0);
    STRCMP_CONTAINS("frames: must be at least 1", error_of(o).c_str());
    o = quiet("empty", 3);
    o.log = folder / "no/such/folder/can.log";
    STRCMP_CONTAINS("no/such/folder/can.log", error_of(o).c_str());
    o = quiet("empty", 3);
    o.record = folder / "no/such/folder/frames.bin";
    STRCMP_CONTAINS("no/such/folder/frames.bin: cannot be created", error_of(o).c_str());
    o = quiet("empty", 3);
    o.bus = "nocan7";
    STRCMP_CONTAINS("nocan7", error_of(o).c_str());
    o = none;
    o.replay = folder / "short.bin";
    std::ofstream(o.replay) << std::string(9000, 'x');
    STRCMP_CONTAINS("short.bin: 9000 bytes", error_of(o).c_str());
    std::ofstream(o.replay, std::ios::trunc).close();
    STRCMP_CONTAINS("short.bin: is empty", error_of(o).c_str());
    o = none;
    o.traffic = folder / "t.csv";
    std::ofstream(o.traffic) << "time_s,track_id,range_m,range_rate_mps\n0,1,nan,0\n";
    STRCMP_CONTAINS("t.csv:2: range_m: not a finite number", error_of(o).c_str());
    o = none;
    o.detections = folder / "d.csv";
    const auto with_row = [&](const char* row) {
        std::ofstream(o.detections) << "frame,range_m,range_rate_mps,snr_db\n" << row << "\n";
        return error_of(o);
    };
    STRCMP_CONTAINS("d.csv:2: frame: is negative", with_row("-1,50,0,20").c_str());
    STRCMP_CONTAINS("d.csv:2: frame: must be a whole number", with_row("0.5,50,0,20").c_str());
    STRCMP_CONTAINS("d.csv:2: range_m: not within", with_row("0,-3,0,20").c_str());
    STRCMP_CONTAINS("d.csv:2: range_rate_mps: not within", with_row("0,50,900,20").c_str());
    STRCMP_CONTAINS("d.csv:2: snr_db: not within", with_row("0,50,0,-20").c_str());
    o.record = folder / "r.bin";
    STRCMP_CONTAINS("record: detections have no beat frames", with_row("0,50,0,20").c_str());
}
