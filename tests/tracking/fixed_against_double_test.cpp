// The tracker in fixed point against the same source in double precision, on identical detections: crossings,
// meetings that cannot be resolved, clutter, misses, folded range rates, more targets than fit.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "tests/tracking/synthetic_road.hpp"
#include "tracking/tracker.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::Associator;
using tracking::Tracker;
using tracking::TrackerConfig;
using tracking_test::Road;
using tracking_test::value;

namespace {
struct Agreement {
    int frames = 0;
    int same = 0;  // frames with the same ids and states
    double range_m = 0;
    double rate_mps = 0;
    int confirmed = 0;  // sum over frames, so that agreement on nothing is noticed

    void add(const Tracker<double>& reference, const Tracker<Real>& fixed) {
        ++frames;
        const auto a = reference.tracks();
        const auto b = fixed.tracks();
        bool equal = a.size() == b.size();
        for (std::size_t i = 0; i < a.size() && equal; ++i)
            equal = a[i].id == b[i].id && a[i].state == b[i].state;
        if (!equal) return;
        ++same;
        for (std::size_t i = 0; i < a.size(); ++i) {
            if (!a[i].is_confirmed()) continue;
            ++confirmed;
            range_m = std::max(range_m, std::abs(value(a[i].x[0]) - value(b[i].x[0])));
            rate_mps = std::max(rate_mps, std::abs(value(a[i].x[1]) - value(b[i].x[1])));
        }
    }
};

Agreement compare(const std::vector<Road>& roads, int frames, Associator associator,
                  bool nonparametric = false) {
    TrackerConfig<double> reference_config;
    TrackerConfig<Real> fixed_config;
    reference_config.associator = fixed_config.associator = associator;
    reference_config.gate.nonparametric = fixed_config.gate.nonparametric = nonparametric;
    Agreement result;
    std::uint64_t seed = 1;
    for (const Road& road : roads) {
        Tracker<double> reference(reference_config);
        Tracker<Real> fixed(fixed_config);
        tracking_test::Synthesiser synthesiser(road, seed++);
        for (int i = 0; i < frames; ++i) {
            const auto frame = synthesiser.next();
            reference.step(tracking_test::as<double>(frame.measurements));
            fixed.step(frame.measurements);
            result.add(reference, fixed);
        }
    }
    return result;
}

std::vector<Road> roads() {
    std::vector<Road> all;
    for (int k = 0; k < 6; ++k) {
        Road crossing;  // four vehicles that pass each other, as in Lee and Kim 2000
        crossing.clutter_per_frame = 0.3 * k;
        crossing.detection_probability = 0.98 - 0.03 * k;
        crossing.targets = {{30, 3.0 - 0.4 * k, 25}, {60, 0.5, 22}, {95, -2.5 - 0.3 * k, 24}, {140, -5, 26}};
        all.push_back(crossing);

        Road meeting;  // two that cannot be resolved for seconds, and oncoming traffic beyond the ambiguity
        meeting.clutter_per_frame = 1;
        meeting.targets = {{75, -2, 28},
                           {103, -5, 28.0 - 2 * k, 0, 1 << 30, {{80, 2.0}, {110, 0.0}}},
                           {150, -42, 24, 20},
                           {150, -33, 24, 60},
                           {155, -29.9, 24, 130, 1 << 30, {{131, -2.0}}}};
        all.push_back(meeting);

        Road crowd;
        crowd.clutter_per_frame = 3;
        for (int i = 0; i < 22; ++i) {
            crowd.targets.push_back(
                {12.0 + 6.5 * i, -14.0 + 1.3 * ((i * 7 + k) % 22), 18.0 + i % 5, 5 * (i % 7)});
        }
        all.push_back(crowd);
    }
    return all;
}
}  // namespace

TEST_GROUP(FixedAgainstDouble){};

TEST(FixedAgainstDouble, EveryAssociatorAgrees) {
    for (std::size_t i = 0; i < tracking::kAssociatorNames.size(); ++i) {
        const auto associator = static_cast<Associator>(i);
        const Agreement a = compare(roads(), 200, associator);
        std::printf(
            "%-8s %d frames, ids and states equal in %.3f %% (bar 99.9), range within %.5f m (bar 0.05), "
            "range rate within %.5f m/s (bar 0.02)\n",
            tracking::name_of(associator).data(), a.frames, 100.0 * a.same / a.frames, a.range_m, a.rate_mps);
        CHECK(a.frames >= 2000);
        CHECK(a.same >= 0.999 * a.frames);
        CHECK(a.range_m <= 0.05);
        CHECK(a.rate_mps <= 0.02);
        CHECK(a.confirmed >= 5 * a.frames);
    }
}

TEST(FixedAgainstDouble, NonparametricClutterDensityAgrees) {
    for (const auto associator : {Associator::ospda, Associator::lm_ihpda, Associator::imm_pdaf}) {
        const Agreement a = compare(roads(), 120, associator, true);
        CHECK(a.same >= 0.999 * a.frames);
        CHECK(a.range_m <= 0.05);
        CHECK(a.rate_mps <= 0.02);
        CHECK(a.confirmed >= 5 * a.frames);
    }
}
