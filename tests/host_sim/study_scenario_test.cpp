// Truth worked by hand; the statistics of measurements and clutter against their definitions.
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "host_sim/json_fields.hpp"
#include "host_sim/study_scenario.hpp"

#include <CppUTest/TestHarness.h>

namespace {

sim::StudyGeometry geometry_of(const std::string& json) {
    const auto file = std::filesystem::temp_directory_path() / "radar_study_geometry.json";
    std::ofstream(file) << json;
    const sim::StudyGeometry geometry = sim::read_study_geometry(file);
    std::filesystem::remove(file);
    return geometry;
}

constexpr const char* kPair = R"({ "description": "pair", "duration_s": 10,
    "targets": [ { "range_m": 50, "range_rate_mps": -2, "acceleration_mps2": [[4, 1]] },
                 { "range_m": 46, "range_rate_mps": 0 } ], "pairs": [[1, 2]] })";

}  // namespace

TEST_GROUP(StudyScenario){};

TEST(StudyScenario, TruthAndSpacingAboutTheMeanOfThePair) {
    const sim::StudyGeometry g = geometry_of(kPair);
    // At 6 s: 50 - 12 + 1/2 * 1 * 2^2 = 40, -2 + 2 = 0; the other stands at 46.
    sim::StudyCondition c;
    DOUBLES_EQUAL(40, sim::study_truth(g, c, 0, 6)[0], 1e-12);
    DOUBLES_EQUAL(0, sim::study_truth(g, c, 0, 6)[1], 1e-12);
    c.spacing = 0.5;
    DOUBLES_EQUAL(41.5, sim::study_truth(g, c, 0, 6)[0], 1e-12);
    DOUBLES_EQUAL(44.5, sim::study_truth(g, c, 1, 6)[0], 1e-12);
}

TEST(StudyScenario, MeasurementsAndClutterAsDescribed) {
    const sim::StudyGeometry g = geometry_of(kPair);
    sim::StudyCondition c;
    c.clutter_density = 0.05;
    double detected = 0;
    double range_error2 = 0;
    double rate_error2 = 0;
    double clutter = 0;
    double area = 0;
    double frames = 0;
    for (std::uint64_t run = 0; run < 50; ++run) {
        const sim::StudyRun r = sim::simulate_study_run(g, c, 1, 0, run);
        LONGS_EQUAL(101, r.truth.size());
        LONGS_EQUAL(100, r.frames.size());
        for (std::size_t k = 0; k < r.frames.size(); ++k) {
            ++frames;
            const auto& truth = r.truth[k + 1];
            area += (std::abs(truth[0][0] - truth[1][0]) + 20) * (std::abs(truth[0][1] - truth[1][1]) + 8);
            for (const auto& m : r.frames[k]) {
                if (m.targets == 0) {
                    ++clutter;
                    continue;
                }
                const auto& x = truth[m.targets == 1 ? 0 : 1];
                ++detected;
                range_error2 += (m.value.z[0] - x[0]) * (m.value.z[0] - x[0]);
                rate_error2 += (m.value.z[1] - x[1]) * (m.value.z[1] - x[1]);
            }
        }
    }
    // Within four standard errors.
    DOUBLES_EQUAL(0.9, detected / (2 * frames), 4 * 0.3 / std::sqrt(2 * frames));
    DOUBLES_EQUAL(0.5, std::sqrt(range_error2 / detected), 4 * 0.5 / std::sqrt(2 * detected));
    DOUBLES_EQUAL(0.095, std::sqrt(rate_error2 / detected), 4 * 0.095 / std::sqrt(2 * detected));
    DOUBLES_EQUAL(0.05 * area, clutter, 4 * std::sqrt(0.05 * area));
}

TEST(StudyScenario, UnresolvedTargetsGiveOneMeasurementBetweenThem) {
    const sim::StudyGeometry g = geometry_of(kPair);
    sim::StudyCondition c;
    c.merging = true;
    c.clutter_density = 0;
    c.detection_probability = 1;
    const sim::StudyRun r = sim::simulate_study_run(g, c, 1, 0, 0);
    for (std::size_t k = 0; k < r.frames.size(); ++k) {
        const auto& truth = r.truth[k + 1];
        // A cell is 4.997 m and 0.9505 m/s.
        const bool merged =
            std::abs(truth[0][0] - truth[1][0]) < 4.997 && std::abs(truth[0][1] - truth[1][1]) < 0.9505;
        LONGS_EQUAL(merged ? 1 : 2, r.frames[k].size());
        if (merged) DOUBLES_EQUAL((truth[0][0] + truth[1][0]) / 2, r.frames[k][0].value.z[0], 5 * 0.5);
    }
}

TEST(StudyScenario, SameSeedSameRunOtherIndexOtherRun) {
    const sim::StudyGeometry g = geometry_of(kPair);
    const sim::StudyCondition c;
    const auto a = sim::simulate_study_run(g, c, 1, 2, 3);
    const auto b = sim::simulate_study_run(g, c, 1, 2, 3);
    const auto other = sim::simulate_study_run(g, c, 1, 2, 4);
    CHECK(a.frames[5][0].value.z == b.frames[5][0].value.z);
    CHECK(a.frames[5][0].value.z != other.frames[5][0].value.z);
}

TEST(StudyScenario, BadFilesAreRefusedWithTheField) {
    const char* broken[] = {
        "{}",
        R"({ "description": "x", "duration_s": 10, "targets": [] })",
        R"({ "description": "x", "duration_s": 1, "targets": [ { "range_m": 5, "range_rate_mps": 0 } ] })",
        R"({ "description": "x", "duration_s": 10, "targets": [ { "range_m": "far", "range_rate_mps": 0 } ] })",
        R"({ "description": "x", "duration_s": 10, "targets": [ { "range_m": 5, "range_rate_mps": 0 } ], "pairs": [[1, 2]] })",
        R"({ "description": "x", "duration_s": 10, "targets": [ { "range_m": 5, "range_rate_mps": 0 } ], "pairs": [[1, 1]] })",
        R"({ "description": "x", "duration_s": 10, "speed": 3, "targets": [ { "range_m": 5, "range_rate_mps": 0 } ] })",
        "not JSON"};
    for (const char* json : broken) CHECK_THROWS(sim::InputError, geometry_of(json));
    CHECK_THROWS(sim::InputError, sim::read_study_geometry("/no/such/file.json"));
}

TEST(StudyScenario, ShippedGeometriesAreValid) {
    for (const char* name : {"lee2000-crossing", "lee2000-parallel", "lee2000-unresolved"}) {
        const auto g = sim::read_study_geometry(sim::study_directory() / (std::string(name) + ".json"));
        LONGS_EQUAL(4, g.targets.size());
        LONGS_EQUAL(2, g.pairs.size());
    }
}
