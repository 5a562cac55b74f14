// A case any filter must master, cases that tell them apart, and fixed point against double.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "host_sim/study_filters.hpp"

#include <CppUTest/TestHarness.h>

namespace {

sim::StudyGeometry shipped(const char* name) {
    return sim::read_study_geometry(sim::study_directory() / (std::string(name) + ".json"));
}

sim::StudyFilter filter_named(const std::string& name) {
    for (const auto& f : sim::lee2000_filters())
        if (f.name == name) return f;
    FAIL("no such filter");
    return {};
}

double lost(const char* filter, const sim::StudyGeometry& g, const sim::StudyCondition& c, int runs) {
    double sum = 0;
    for (int r = 0; r < runs; ++r) {
        const auto run = sim::simulate_study_run(g, c, 1, 0, static_cast<std::uint64_t>(r));
        for (const auto& t : sim::run_study_filter<double>(filter_named(filter), g, c, run).track)
            sum += 1 - t.found;
    }
    return sum;
}

}  // namespace

TEST_GROUP(StudyFilters){};

TEST(StudyFilters, EveryFilterKeepsTargetsThatAreAloneAndSeenEveryTime) {
    sim::StudyGeometry g = shipped("lee2000-parallel");
    for (std::size_t t = 0; t < g.targets.size(); ++t)
        g.targets[t].range_m = 20 + 30 * static_cast<double>(t);
    sim::StudyCondition c;
    c.clutter_density = 1e-6;
    c.detection_probability = 0.999;
    const auto run = sim::simulate_study_run(g, c, 1, 0, 0);
    for (const auto& filter : sim::lee2000_filters()) {
        const auto result = sim::run_study_filter<double>(filter, g, c, run);
        for (const auto& t : result.track) {
            DOUBLES_EQUAL(1, t.found, 0);
            DOUBLES_EQUAL(1, t.own, 0);
            // Below the measurement noise of 0.5 m, above what no filter reaches in 15 s of manoeuvres.
            CHECK(std::sqrt(t.range_estimate) < 0.5 && std::sqrt(t.range_estimate) > 0.01);
            CHECK(t.range_prediction >= t.range_estimate);
            CHECK(t.correct > 0.95);
        }
        DOUBLES_EQUAL(0, result.switches, 0);
        DOUBLES_EQUAL(result.gospa / 2, result.ospa, 1e-12);  // four against four
    }
}

TEST(StudyFilters, RadarsAssociationLosesAtMostHalfOfWhatPdaLoses) {
    const sim::StudyCondition c;
    for (const char* name : {"lee2000-crossing", "lee2000-parallel"}) {
        const auto g = shipped(name);
        const double pda = lost("pda", g, c, 20);
        CHECK(pda > 0);
        CHECK(2 * lost("ospda", g, c, 20) <= pda);
    }
}

TEST(StudyFilters, FixedPointFollowsDouble) {
    const auto g = shipped("lee2000-parallel");
    const sim::StudyCondition c;
    const auto run = sim::simulate_study_run(g, c, 1, 0, 1);
    for (const char* name : {"pda", "ospda(4)", "jpda", "osjpda(6)", "ospda", "osjpda"}) {
        const auto exact = sim::run_study_filter<double>(filter_named(name), g, c, run);
        const auto fixed = sim::run_study_filter<dsp::Real>(filter_named(name), g, c, run);
        double range = 0;
        double rate = 0;
        for (std::size_t k = 0; k < exact.estimate.size(); ++k) {
            for (std::size_t t = 0; t < g.targets.size(); ++t) {
                range = std::max(range, std::abs(exact.estimate[k][t][0] - fixed.estimate[k][t][0]));
                rate = std::max(rate, std::abs(exact.estimate[k][t][1] - fixed.estimate[k][t][1]));
            }
        }
        CHECK_TEXT(range <= 0.05 && rate <= 0.02, name);
    }
}
