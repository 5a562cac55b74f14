// Behaviour of the whole tracker on roads with known truth. Bars are stated beside what is measured.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <span>
#include <vector>

#include <Eigen/Dense>

#include "tests/tracking/synthetic_road.hpp"
#include "tracking/tracker.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::Associator;
using tracking::constant;
using tracking::kMaxConfirmed;
using tracking::kMaxTracks;
using tracking::Measurement;
using tracking::Track;
using tracking::Tracker;
using tracking::TrackerConfig;
using tracking::TrackState;
using tracking_test::Frame;
using tracking_test::Road;
using tracking_test::Synthesiser;
using tracking_test::value;

namespace {
template <class S>
Measurement<S> at(int range_cm, int rate_cmps, int snr_db = 20) {
    Measurement<S> m;
    m.z = {constant<S>(range_cm, 100), constant<S>(rate_cmps, 100)};
    m.variance = {constant<S>(9, 100), constant<S>(4, 1000)};
    m.snr_db = S(snr_db);
    return m;
}

int confirmed(std::span<const Track<Real>> tracks) {
    return static_cast<int>(
        std::count_if(tracks.begin(), tracks.end(), [](const auto& t) { return t.is_confirmed(); }));
}

/// The confirmed track nearest to the truth, if near: within 3 of |range| / m + |range rate| / (0.5 m/s).
const Track<Real>* nearest(std::span<const Track<Real>> tracks, const tracking_test::Target& truth) {
    const Track<Real>* best = nullptr;
    double smallest = 3;
    for (const auto& t : tracks) {
        if (!t.is_confirmed()) continue;
        const double d =
            std::abs(value(t.x[0]) - truth.range_m) + std::abs(value(t.x[1]) - truth.rate_mps) / 0.5;
        if (d >= smallest) continue;
        smallest = d;
        best = &t;
    }
    return best;
}

template <class S>
void follows_one_target() {
    Tracker<S> tracker{TrackerConfig<S>{}};
    for (int frame = 0; frame < 50; ++frame) {
        const std::array<Measurement<S>, 1> m{at<S>(10000 - 100 * frame, -1000)};
        const auto report = tracker.step(m);
        LONGS_EQUAL(frame == 1 ? 1 : 0, report.initiated);
        LONGS_EQUAL(frame == 3 ? 1 : 0, report.confirmed);
        LONGS_EQUAL(frame == 0 ? 0 : 1, tracker.tracks().size());
    }
    const auto& t = tracker.tracks()[0];
    CHECK(t.state == TrackState::confirmed);
    LONGS_EQUAL(1, t.id);
    LONGS_EQUAL(49, t.age);
    LONGS_EQUAL(50, t.hits);
    CHECK(t.existence > constant<S>(99, 100));
    DOUBLES_EQUAL(51, value(t.x[0]), 0.001);
    DOUBLES_EQUAL(-10, value(t.x[1]), 0.001);
}
}  // namespace

TEST_GROUP(Tracker){};

TEST(Tracker, FollowsOneTarget) {
    follows_one_target<double>();
    follows_one_target<Real>();
}

TEST(Tracker, FourVehiclesThatCrossKeepTheirIdentities) {
    // As in Lee and Kim 2000: four vehicles, some crossing in range, near in velocity.
    int switches = 0, lost = 0, latest = 0, errors = 0;
    double range2 = 0, rate2 = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        Road road;
        road.clutter_per_frame = 0.3;
        road.targets = {{40, 2.5, 24}, {70, -0.5, 22}, {85, -3, 26}, {120, -6, 24}};
        Synthesiser synthesiser(road, seed);
        Tracker<Real> tracker{TrackerConfig<Real>{}};
        std::array<int, 4> first_seen{-1, -1, -1, -1};
        std::array<int, 4> first_confirmed{-1, -1, -1, -1};
        std::array<int, 4> early{}, late{};
        for (int frame = 0; frame < 150; ++frame) {
            const Frame f = synthesiser.next();
            tracker.step(f.measurements);
            for (std::size_t i = 0; i < f.truth.size(); ++i) {
                const auto who = static_cast<std::size_t>(f.index[i]);
                if (f.seen[i] && first_seen[who] < 0) first_seen[who] = frame;
                const Track<Real>* t = nearest(tracker.tracks(), f.truth[i]);
                if (t == nullptr) continue;
                if (first_confirmed[who] < 0) first_confirmed[who] = frame;
                if (frame == 15) early[who] = t->id;
                if (frame == 149) late[who] = t->id;
                range2 += std::pow(value(t->x[0]) - f.truth[i].range_m, 2);
                rate2 += std::pow(value(t->x[1]) - f.truth[i].rate_mps, 2);
                ++errors;
            }
        }
        for (std::size_t i = 0; i < 4; ++i) {
            latest = std::max(latest, first_confirmed[i] - first_seen[i]);
            if (late[i] == 0 || early[i] == 0) {
                ++lost;
            } else if (early[i] != late[i]) {
                ++switches;
            }
        }
    }
    const double range_rmse = std::sqrt(range2 / errors), rate_rmse = std::sqrt(rate2 / errors);
    std::printf(
        "four vehicles, 20 seeds: confirmed within %d frames (bar 6), lost %d (0), switched %d (0), RMSE "
        "%.3f m "
        "(0.6), %.3f m/s (0.2)\n",
        latest, lost, switches, range_rmse, rate_rmse);
    CHECK(latest <= 6);
    LONGS_EQUAL(0, lost);
    LONGS_EQUAL(0, switches);
    CHECK(range_rmse <= 0.6);
    CHECK(rate_rmse <= 0.2);
}

TEST(Tracker, MeetingVehiclesThatCannotBeResolvedForSecondsKeepTheirIdentities) {
    // The second comes up from behind, stays within two Doppler cells and two range cells for about two
    // seconds, and falls back. Only the stronger of the two echoes, pulled towards the other, is seen then.
    constexpr int kRuns = 100;
    std::map<Associator, int> kept;
    for (const auto associator : {Associator::pda, Associator::ospda}) {
        for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
            Road road;
            road.clutter_per_frame = 0.3;
            road.resolution_cells = 2;
            const double weaker_db = 3.0 * static_cast<double>(seed % 4);
            road.targets = {{75, -2, 28}, {103.25, -5, 28 - weaker_db, 0, 1 << 30, {{80, 2.0}, {110, 0.0}}}};
            Synthesiser synthesiser(road, seed);
            TrackerConfig<Real> config;
            config.associator = associator;
            Tracker<Real> tracker(config);
            std::array<int, 2> early{}, late{};
            for (int frame = 0; frame < 170; ++frame) {
                const Frame f = synthesiser.next();
                tracker.step(f.measurements);
                for (std::size_t i = 0; i < f.truth.size(); ++i) {
                    const Track<Real>* t = nearest(tracker.tracks(), f.truth[i]);
                    if (t == nullptr) continue;
                    if (frame == 30) early[i] = t->id;
                    if (frame == 169) late[i] = t->id;
                }
            }
            const bool whole = early[0] != 0 && early[1] != 0 && early[0] != early[1];
            kept[associator] += whole && early == late ? 1 : 0;
        }
    }
    std::printf("meeting unresolved, both identities kept: ospda %d of %d (bar 95), pda %d\n",
                kept[Associator::ospda], kRuns, kept[Associator::pda]);
    CHECK(kept[Associator::ospda] >= 95);
    CHECK(kept[Associator::pda] < kept[Associator::ospda]);  // else the scene is too easy to prove anything
}

TEST(Tracker, ClutterAloneConfirmsNearlyNothing) {
    for (const double per_frame : {0.1, 0.3}) {
        Road road;
        road.clutter_per_frame = per_frame;
        Synthesiser synthesiser(road, 5);
        Tracker<Real> tracker{TrackerConfig<Real>{}};
        int started = 0, false_tracks = 0;
        for (int frame = 0; frame < 36'000; ++frame) {
            const auto report = tracker.step(synthesiser.next().measurements);
            started += report.initiated;
            false_tracks += report.confirmed;
        }
        std::printf("one hour of %.1f false detections a frame: %d tracks started, %d confirmed (bar 1)\n",
                    per_frame, started, false_tracks);
        CHECK(false_tracks <= 1);
    }
}

TEST(Tracker, EmergencyBrakingDoesNotLoseTheTrack) {
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        Road road;
        road.targets = {
            {60, 0, 24, 0, 1 << 30, {{30, -8.0}, {60, 0.0}}}};  // from 0 to -24 m/s relative at 8 m/s^2
        Synthesiser synthesiser(road, seed);
        Tracker<Real> tracker{TrackerConfig<Real>{}};
        for (int frame = 0; frame < 65; ++frame) {
            const Frame f = synthesiser.next();
            tracker.step(f.measurements);
            if (frame < 10) continue;
            LONGS_EQUAL(1, confirmed(tracker.tracks()));
            LONGS_EQUAL(1, tracker.tracks()[0].id);
            CHECK(std::abs(value(tracker.tracks()[0].x[0]) - f.truth[0].range_m) < 2);
        }
    }
}

TEST(Tracker, OncomingBeyondTheAmbiguityIsUnfoldedAtTheStart) {
    for (const double rate : {-42.0, -35.0, -70.0, 36.0}) {
        Road road;
        road.targets = {{rate < 0 ? 155.0 : 10.0, rate, 22}};
        Synthesiser synthesiser(road, 3);
        Tracker<Real> tracker{TrackerConfig<Real>{}};
        for (int frame = 0; frame < 15; ++frame) {
            const Frame f = synthesiser.next();
            tracker.step(f.measurements);
            if (frame < 8) continue;
            LONGS_EQUAL(1, confirmed(tracker.tracks()));
            DOUBLES_EQUAL(rate, value(tracker.tracks()[0].x[1]), 0.3);
            DOUBLES_EQUAL(f.truth[0].range_m, value(tracker.tracks()[0].x[0]), 1);
        }
    }
}

TEST(Tracker, RangeRateThatCrossesTheAmbiguityKeepsTheTrack) {
    Road road;
    road.detection_probability = 1;
    road.targets = {{150, -28, 24, 0, 1 << 30, {{10, -3.0}, {30, 0.0}}}};
    Synthesiser synthesiser(road, 3);
    Tracker<Real> tracker{TrackerConfig<Real>{}};
    for (int frame = 0; frame < 40; ++frame) tracker.step(synthesiser.next().measurements);
    LONGS_EQUAL(1, tracker.tracks().size());
    LONGS_EQUAL(1, tracker.tracks()[0].id);
    DOUBLES_EQUAL(-34, value(tracker.tracks()[0].x[1]), 0.3);
}

TEST(Tracker, CoastsThroughMissesThenGivesUp) {
    Tracker<Real> tracker{TrackerConfig<Real>{}};
    int range = 8000;
    const auto seen = [&](int frames) {
        for (int i = 0; i < frames; ++i, range -= 50) tracker.step(std::array{at<Real>(range, -500)});
    };
    const auto missed = [&](int frames) {
        int deleted = 0;
        for (int i = 0; i < frames; ++i, range -= 50) deleted += tracker.step({}).deleted;
        return deleted;
    };
    seen(10);
    LONGS_EQUAL(0, missed(4));
    CHECK(tracker.tracks()[0].state == TrackState::coasting);
    LONGS_EQUAL(4, tracker.tracks()[0].misses);
    CHECK_FALSE(tracker.tracks()[0].measured);
    seen(1);
    CHECK(tracker.tracks()[0].state == TrackState::confirmed);
    LONGS_EQUAL(1, tracker.tracks()[0].id);
    seen(10);
    LONGS_EQUAL(1, missed(20));
    LONGS_EQUAL(0, tracker.tracks().size());
}

TEST(Tracker, TwoTracksOfOneTargetMergeIntoTheOlder) {
    Tracker<Real> tracker{TrackerConfig<Real>{}};
    int range = 9000;
    int merged = 0;
    // Two reflections for a second, each with a track, then only one. Hidden behind the other the second
    // track is coasted as long as any.
    for (int frame = 0; frame < 70; ++frame, range -= 50) {
        const std::array both{at<Real>(range, -500, 22), at<Real>(range + 350, -500, 20)};
        merged += tracker.step(frame < 10 ? std::span(both) : std::span(both).first(1)).merged;
        if (frame == 9) LONGS_EQUAL(2, confirmed(tracker.tracks()));
    }
    LONGS_EQUAL(1, confirmed(tracker.tracks()));
    LONGS_EQUAL(1, tracker.tracks()[0].id);
    CHECK(merged <= 1);  // or it was given up as coasted too long
}

TEST(Tracker, IdsAreNotGivenAgainUntilAllOthersWere) {
    Tracker<Real> tracker{TrackerConfig<Real>{}};
    std::vector<int> ids;
    // One lasting target keeps id 1; another comes and goes 300 times.
    for (int round = 0; round < 300; ++round) {
        for (int frame = 0; frame < 14; ++frame) {
            std::vector<Measurement<Real>> m{at<Real>(12000, 0)};
            if (frame < 4) m.push_back(at<Real>(3000 + 20 * (round % 20), 0));
            const auto report = tracker.step(m);
            if (report.confirmed > 0 && tracker.tracks().size() == 2) ids.push_back(tracker.tracks()[1].id);
        }
        LONGS_EQUAL(1, tracker.tracks().size());
        LONGS_EQUAL(1, tracker.tracks()[0].id);
    }
    LONGS_EQUAL(300, ids.size());
    for (std::size_t i = 0; i < 254; ++i) LONGS_EQUAL(2 + i, ids[i]);
    LONGS_EQUAL(2, ids[254]);  // round again, past the one still in use
}

TEST(Tracker, StartsAreThePairsThatListingThemFinds) {
    const TrackerConfig<double> config;
    const tracking::Gate<double> gate(config.gate);
    const double span = config.gate.rate_span_mps;
    const double period = config.motion.period_s;
    const tracking::ProcessNoise<double> q = tracking::process_noise(config.motion);
    std::mt19937 random(6);
    std::uniform_real_distribution<double> uniform(-1, 1);
    const auto measured = [&](double range, double rate) {
        Measurement<double> m;
        m.z = {range, std::remainder(rate, span)};
        m.variance = {0.02 * std::pow(50, std::max(uniform(random), 0.0)), 0.005};  // half are accurate
        return m;
    };
    int started = 0;
    int folded = 0;
    for (int trial = 0; trial < 2000; ++trial) {
        std::vector<Measurement<double>> first, second;
        for (int i = 0; i < 12; ++i) {
            const double range = 80 + 60 * uniform(random);
            const double rate = -18 + 60 * uniform(random);
            // The signal processing has taken the coupling of the folded range rate out of the range.
            const double coupling =
                std::round((rate - std::remainder(rate, span)) / span) * config.gate.alias_range_m;
            first.push_back(measured(range + coupling, rate));
            second.push_back(
                measured(range + coupling + period * rate + uniform(random), rate + 1.5 * uniform(random)));
        }
        std::set<std::size_t> used;
        std::vector<double> expected;
        for (const auto& m : second) {
            double smallest = config.gate.gate;
            std::size_t best = first.size();
            double predicted = 0;
            int best_fold = 0;
            for (std::size_t j = 0; j < first.size(); ++j) {
                if (used.contains(j)) continue;
                const auto r0 = gate.noise(first[j], false);
                const auto r1 = gate.noise(m, false);
                Eigen::Matrix2d s;
                s << q.range + r0[0] + period * period * r0[1] + r1[0], q.cross + period * r0[1],
                    q.cross + period * r0[1], q.rate + r0[1] + r1[1];
                for (int fold = -1; fold <= 1; ++fold) {
                    const double rate = first[j].z[1] + fold * span;
                    if (rate < config.min_start_rate_mps || rate > config.max_start_rate_mps) continue;
                    const double range = first[j].z[0] - fold * config.gate.alias_range_m + period * rate;
                    // The measurement unfolded towards that rate.
                    const double folds = std::round((rate - m.z[1]) / span);
                    const Eigen::Vector2d nu(m.z[0] - folds * config.gate.alias_range_m - range,
                                             m.z[1] + folds * span - rate);
                    double distance = nu.dot(s.inverse() * nu);
                    if (distance > config.gate.gate) continue;
                    distance += fold == 0 ? 0 : config.fold_distance2;
                    if (distance > config.gate.gate || (best < first.size() && distance >= smallest))
                        continue;
                    smallest = distance;
                    best = j;
                    best_fold = fold;
                    predicted = rate;
                }
            }
            if (best == first.size()) continue;
            used.insert(best);
            expected.push_back(predicted);
            folded += best_fold == 0 ? 0 : 1;
        }
        Tracker<double> tracker{config};
        tracker.step(first);
        tracker.step(second);
        LONGS_EQUAL(expected.size(), tracker.tracks().size());
        for (std::size_t i = 0; i < expected.size(); ++i)
            DOUBLES_EQUAL(expected[i], tracker.tracks()[i].x[1], 3);
        started += static_cast<int>(expected.size());
    }
    CHECK(started > 10'000);
    CHECK(folded > 1000);
}

TEST(Tracker, OnlySoManyPairsAreLookedAtToStartTracks) {
    // A road where everything has nearly one range rate: every measurement might go with every other, and
    // none does. Of the 64, 16 have been compared with 64 when the limit is reached.
    Tracker<Real> tracker{TrackerConfig<Real>{}};
    std::vector<Measurement<Real>> first, second;
    for (int i = 0; i < tracking::kMaxMeasurements; ++i) {
        first.push_back(at<Real>(1000 + 200 * i, 0));
        second.push_back(at<Real>(1000 + 200 * i, 240));
    }
    LONGS_EQUAL(0, tracker.step(first).not_paired);
    const auto report = tracker.step(second);
    LONGS_EQUAL(tracking::kMaxMeasurements - tracking::kMaxStartPairs / tracking::kMaxMeasurements,
                report.not_paired);
    LONGS_EQUAL(0, report.initiated);
    // Those not looked at wait like the others: the next frame begins with the strongest again.
    const auto next = tracker.step(second);
    CHECK(next.initiated > 0);
    CHECK(next.not_paired > 0);
}

TEST(Tracker, OverCapacityKeepsTheStrongestAndCounts) {
    Tracker<Real> tracker{TrackerConfig<Real>{}};
    // 40 targets, 3.5 m apart; SNR is 10..49 dB in a scattered order.
    std::vector<Measurement<Real>> m;
    for (int i = 0; i < 40; ++i) m.push_back(at<Real>(1000 + 350 * i, 300 * (i % 2), 10 + 17 * i % 40));
    std::sort(m.begin(), m.end(), [](const auto& a, const auto& b) { return a.snr_db > b.snr_db; });
    int dropped = 0;
    for (int frame = 0; frame < 30; ++frame) {
        for (auto& d : m) d.z[0] += d.z[1] * constant<Real>(1, 10);
        dropped += tracker.step(m).dropped_for_capacity;
        CHECK(tracker.tracks().size() <= kMaxTracks);
        CHECK(confirmed(tracker.tracks()) <= kMaxConfirmed);
    }
    CHECK(dropped > 0);
    LONGS_EQUAL(kMaxConfirmed, confirmed(tracker.tracks()));
    for (const auto& t : tracker.tracks()) {
        if (t.is_confirmed()) CHECK(t.snr_db >= Real(49 - kMaxConfirmed + 1 - 6));  // replace_margin_db
    }
}

TEST(Tracker, TooManyMeasurementsUsesTheFirstAndCountsTheRest) {
    Tracker<Real> tracker{TrackerConfig<Real>{}};
    const std::vector<Measurement<Real>> m(70, at<Real>(5000, -100));
    LONGS_EQUAL(6, tracker.step(m).dropped_measurements);
    LONGS_EQUAL(6, tracker.step(m).dropped_measurements);
    CHECK(tracker.tracks().size() <= kMaxTracks);
}

TEST(Tracker, InvalidMeasurementsAreCountedAndIgnored) {
    Tracker<double> tracker{TrackerConfig<double>{}};
    std::vector<Measurement<double>> m(5, at<double>(5000, 0));
    m[0].z[0] = std::numeric_limits<double>::quiet_NaN();
    m[1].z[1] = std::numeric_limits<double>::infinity();
    m[2].variance[0] = 0;
    m[3].variance[1] = -1;
    for (int frame = 0; frame < 5; ++frame) LONGS_EQUAL(4, tracker.step(m).invalid_measurements);
    LONGS_EQUAL(1, tracker.tracks().size());
    DOUBLES_EQUAL(50, tracker.tracks()[0].x[0], 1e-6);
    Tracker<Real> fixed{TrackerConfig<Real>{}};
    std::vector<Measurement<Real>> none(1, at<Real>(5000, 0));
    none[0].variance[1] = Real(0);
    LONGS_EQUAL(1, fixed.step(none).invalid_measurements);
}

TEST(Tracker, ExtremesOfTheFormatDoNoHarm) {
    Tracker<Real> tracker{TrackerConfig<Real>{}};
    std::vector<Measurement<Real>> m;
    for (const Real range : {Real::min(), Real(0), Real::from_raw(1), Real::max()}) {
        for (const Real rate : {Real::min(), Real(0), Real::max()}) {
            for (const Real variance : {Real::from_raw(1), Real(1), Real::max()}) {
                Measurement<Real> e;
                e.z = {range, rate};
                e.variance = {variance, variance};
                e.snr_db = Real::max();
                m.push_back(e);
            }
        }
    }
    for (int frame = 0; frame < 20; ++frame) {
        tracker.step(m);
        for (const auto& t : tracker.tracks()) {
            CHECK(t.covariance(0, 0) > Real(0));
            CHECK(t.covariance(1, 1) > Real(0));
            CHECK(t.existence >= Real(0) && t.existence <= Real(1));
            CHECK(t.x[0] >= Real(0) && t.x[0] <= Real(170));
        }
    }
}

TEST(Tracker, DegenerateFrames) {
    for (const auto associator :
         {Associator::nn, Associator::pda, Associator::ospda, Associator::jpda, Associator::osjpda}) {
        TrackerConfig<Real> config;
        config.associator = associator;
        Tracker<Real> tracker(config);
        // No tracks, no measurements.
        LONGS_EQUAL(0, tracker.step({}).initiated);
        // Identical measurements make tracks that end up as one.
        const std::vector<Measurement<Real>> twins(2, at<Real>(5000, 0));
        for (int frame = 0; frame < 5; ++frame) tracker.step(twins);
        const std::array one{at<Real>(5000, 0)};  // exactly on every prediction
        for (int frame = 0; frame < 60; ++frame) tracker.step(one);
        LONGS_EQUAL(1, tracker.tracks().size());
        DOUBLES_EQUAL(50, value(tracker.tracks()[0].x[0]), 1e-3);
        tracker.reset();
        LONGS_EQUAL(0, tracker.tracks().size());
    }
}

TEST(Tracker, CertainDetectionAndNoClutterStillTracks) {
    TrackerConfig<Real> config;
    config.gate.detection_probability = Real(1);
    config.gate.clutter_density = Real(0);
    CHECK(config.valid());
    Tracker<Real> tracker(config);
    for (int frame = 0; frame < 10; ++frame) tracker.step(std::array{at<Real>(5000, 0)});
    LONGS_EQUAL(1, confirmed(tracker.tracks()));
    tracker.step({});
    tracker.step({});
    LONGS_EQUAL(0, confirmed(tracker.tracks()));  // a certain detection that is missing is certain absence
}

TEST(Tracker, ConfigurationIsChecked) {
    CHECK(TrackerConfig<double>{}.valid());
    CHECK(TrackerConfig<Real>{}.valid());
    TrackerConfig<Real> c;
    c.motion.period_s = Real(0);
    CHECK_FALSE(c.valid());
    c = {};
    c.gate.detection_probability = Real(2);
    CHECK_FALSE(c.valid());
    c = {};
    c.order_statistics.alpha = Real(1);
    CHECK_FALSE(c.valid());
    c = {};
    c.delete_existence = c.confirm_existence;
    CHECK_FALSE(c.valid());
    c = {};
    c.associator = static_cast<Associator>(200);
    CHECK_FALSE(c.valid());
}
