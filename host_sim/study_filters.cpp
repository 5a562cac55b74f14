#include "host_sim/study_filters.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "host_sim/assignment.hpp"
#include "tracking/gating.hpp"
#include "tracking/pda.hpp"
#include "tracking/tracker.hpp"

namespace sim {

namespace {

using tracking::constant;
using Vec2d = tracking::Vec2<double>;

template <class S>
S scalar(double v) {
    if constexpr (std::floating_point<S>) {
        return v;
    } else {
        return S::from_raw(static_cast<std::int32_t>(std::lround(std::ldexp(v, S::fraction_bits))));
    }
}
double number(double v) {
    return v;
}
double number(dsp::Real v) {
    return std::ldexp(v.raw(), -dsp::Real::fraction_bits);
}

template <class S>
Vec2d numbers(const tracking::Vec2<S>& v) {
    return {number(v[0]), number(v[1])};
}

template <class S>
tracking::OrderStatisticsConfig<S> order_as(const tracking::OrderStatisticsConfig<double>& c) {
    return {scalar<S>(c.alpha), c.precedence, c.missed, c.reduced, c.reduction, c.covariance};
}

/// Gated by any track, with indices small enough for a row.
template <class S>
struct NearMeasurements {
    std::vector<tracking::Measurement<S>> value;
    std::vector<std::uint32_t> targets;

    template <class Tracks>
    void select(const std::vector<StudyMeasurement>& all, const Tracks& tracks,
                const tracking::Gate<S>& gate) {
        value.clear();
        targets.clear();
        for (const StudyMeasurement& m : all) {
            if (value.size() == tracking::kMaxMeasurements) return;
            tracking::Measurement<S> mine;
            mine.z = {scalar<S>(m.value.z[0]), scalar<S>(m.value.z[1])};
            mine.variance = {scalar<S>(m.value.variance[0]), scalar<S>(m.value.variance[1])};
            for (const auto& t : tracks) {
                S distance2(0);
                S log_density(0);
                if (!gate.test(gate.innovation(t.x, mine.z), t.covariance, gate.noise(mine, true), distance2,
                               log_density))
                    continue;
                value.push_back(mine);
                targets.push_back(m.targets);
                break;
            }
        }
    }
};

double square(double v) {
    return v * v;
}

/// Below 1 where a track is good.
double closeness(const Vec2d& track, const Vec2d& truth) {
    return square((track[0] - truth[0]) / kKept_m) + square((track[1] - truth[1]) / kKept_mps);
}

/// Track of each target, kUnassigned where none is good.
std::vector<int> good_tracks(const std::vector<Vec2d>& tracks, const std::vector<Vec2d>& truth) {
    CostMatrix cost(truth.size(), tracks.size());
    for (std::size_t t = 0; t < truth.size(); ++t)
        for (std::size_t i = 0; i < tracks.size(); ++i)
            cost(t, i) = std::min(closeness(tracks[i], truth[t]), 1.0);
    std::vector<int> track_of = assign(cost);
    for (std::size_t t = 0; t < truth.size(); ++t)
        if (cost(t, static_cast<std::size_t>(track_of[t])) >= 1) track_of[t] = kUnassigned;
    return track_of;
}

constexpr double kGospaCutoff_m = 10;
constexpr double kGospaRateWeight_s = 2;

double gospa_square(const std::vector<Vec2d>& tracks, const std::vector<Vec2d>& truth) {
    CostMatrix cost(truth.size(), tracks.size());
    for (std::size_t t = 0; t < truth.size(); ++t)
        for (std::size_t i = 0; i < tracks.size(); ++i)
            cost(t, i) = std::min(square(tracks[i][0] - truth[t][0]) +
                                      square(kGospaRateWeight_s * (tracks[i][1] - truth[t][1])),
                                  square(kGospaCutoff_m));
    const std::vector<int> track_of = assign(cost);
    double sum = 0;
    for (std::size_t t = 0; t < truth.size(); ++t) sum += cost(t, static_cast<std::size_t>(track_of[t]));
    return sum;
}

/// Follows who tracks whom, frame by frame.
class Bookkeeper {
  public:
    Bookkeeper(const StudyGeometry& geometry, const StudyCondition& condition, std::size_t frames)
        : geometry_(geometry),
          condition_(condition),
          frames_(frames),
          follower_(geometry.targets.size()),
          found_(geometry.targets.size()),
          own_(geometry.targets.size()) {
        for (std::size_t t = 0; t < follower_.size(); ++t) follower_[t] = static_cast<int>(t);
    }

    void add(std::size_t frame, const std::vector<Vec2d>& tracks, const std::vector<Vec2d>& truth) {
        const std::size_t targets = truth.size();
        const double g2 = gospa_square(tracks, truth);
        result.gospa += std::sqrt(g2) / static_cast<double>(frames_);
        result.ospa += std::sqrt(g2 / static_cast<double>(targets)) / static_cast<double>(frames_);

        // A follower stays one as long as it is good, whoever else is closer.
        std::vector<int> best = good_tracks(tracks, truth);
        for (std::size_t t = 0; t < targets; ++t) {
            if (closeness(tracks[static_cast<std::size_t>(follower_[t])], truth[t]) < 1) continue;
            if (best[t] == kUnassigned || best[t] == follower_[t]) continue;
            follower_[t] = best[t];
            ++result.switches;
        }
        if (frame + kLastFrames >= frames_) {
            for (std::size_t t = 0; t < targets; ++t) {
                found_[t] += best[t] != kUnassigned ? 1 : 0;
                own_[t] += best[t] == static_cast<int>(t) ? 1 : 0;
            }
        }
        for (const auto& [a, b] : geometry_.pairs) {
            const double apart = pair_distance(truth[a], truth[b]);
            if (apart < 2) continue;
            ++pair_frames_;
            if (pair_distance(tracks[a], tracks[b]) < apart / 2) ++coalesced_;
        }
    }
    StudyResult finish() {
        for (std::size_t t = 0; t < found_.size(); ++t) {
            result.track[t].found = 2 * found_[t] > kLastFrames ? 1 : 0;
            result.track[t].own = 2 * own_[t] > kLastFrames ? 1 : 0;
        }
        result.coalescence = pair_frames_ == 0 ? 0 : coalesced_ / pair_frames_;
        return std::move(result);
    }

    StudyResult result;

  private:
    /// In standard deviations of a measurement.
    [[nodiscard]] double pair_distance(const Vec2d& a, const Vec2d& b) const {
        return std::sqrt(square((a[0] - b[0]) / condition_.range_sigma_m) +
                         square((a[1] - b[1]) / condition_.rate_sigma_mps));
    }

    const StudyGeometry& geometry_;
    const StudyCondition& condition_;
    std::size_t frames_;
    std::vector<int> follower_;
    std::vector<int> found_;
    std::vector<int> own_;
    double pair_frames_ = 0;
    double coalesced_ = 0;
};

}  // namespace

template <class S>
StudyResult run_study_filter(const StudyFilter& filter, const StudyGeometry& geometry,
                             const StudyCondition& condition, const StudyRun& run) {
    struct State {
        tracking::Vec2<S> x;
        tracking::Mat2<S> covariance;
    };
    const std::size_t targets = geometry.targets.size();
    const std::size_t frames = run.frames.size();

    tracking::GateConfig<S> gate_config;
    gate_config.gate = scalar<S>(condition.gate);
    gate_config.detection_probability = scalar<S>(condition.detection_probability);
    gate_config.clutter_density = scalar<S>(condition.clutter_density);
    gate_config.rate_span_mps = S(0);
    const tracking::Gate<S> gate(gate_config);
    const tracking::TrackerConfig<S> radar;
    tracking::MotionModel<S> motion;
    motion.period_s = scalar<S>(condition.period_s);
    const auto order = order_as<S>(filter.order);
    static thread_local tracking::JpdaWorkspace<S> work;

    std::vector<State> track(targets);
    for (std::size_t t = 0; t < targets; ++t) {
        track[t].x = {scalar<S>(run.truth[0][t][0]), scalar<S>(run.truth[0][t][1])};
        track[t].covariance << scalar<S>(square(condition.range_sigma_m)), S(0), S(0),
            scalar<S>(square(condition.rate_sigma_mps));
    }

    Bookkeeper books(geometry, condition, frames);
    StudyResult& result = books.result;
    result.track.resize(targets);
    result.correct_at.assign(targets, std::vector<double>(frames));
    result.estimate.push_back(run.truth[0]);

    constexpr std::size_t kSettled = 10;
    const double share = 1.0 / static_cast<double>(frames - kSettled);
    NearMeasurements<S> near;
    std::vector<tracking::AssociationRow<S>> rows(targets);
    for (std::size_t frame = 0; frame < frames; ++frame) {
        const std::vector<Vec2d>& truth = run.truth[frame + 1];
        for (std::size_t t = 0; t < targets; ++t) {
            track[t].x = tracking::predict_state(track[t].x, motion);
            track[t].covariance = tracking::predict_covariance(track[t].covariance, motion);
            if (frame < kSettled) continue;
            result.track[t].range_prediction += share * square(number(track[t].x[0]) - truth[t][0]);
            result.track[t].rate_prediction += share * square(number(track[t].x[1]) - truth[t][1]);
        }
        near.select(run.frames[frame], track, gate);
        for (std::size_t t = 0; t < targets; ++t) {
            bool obscured = false;
            for (std::size_t o = 0; condition.merging && o < targets; ++o) {
                const Vec2d apart = numbers<S>(track[t].x) - numbers<S>(track[o].x);
                obscured = obscured || (o != t && std::abs(apart[0]) < number(radar.resolution_range_m) &&
                                        std::abs(apart[1]) < number(radar.resolution_rate_mps));
            }
            gate.fill(rows[t], track[t].x, track[t].covariance, near.value, ~std::uint64_t{0}, obscured);
        }
        tracking::associate<S>(rows, filter.associator, order, work);

        std::vector<Vec2d>& estimate = result.estimate.emplace_back();
        for (std::size_t t = 0; t < targets; ++t) {
            bool seen = false;
            for (const StudyMeasurement& m : run.frames[frame]) seen = seen || (m.targets >> t & 1) != 0;
            double correct = seen ? 0 : number(rows[t].missed_weight);
            for (const auto& c : rows[t].candidates())
                if ((near.targets[c.measurement] >> t & 1) != 0) correct += number(c.weight);
            result.correct_at[t][frame] = correct;
            result.track[t].correct += correct / static_cast<double>(frames);

            tracking::update_with_row<S>(track[t].x, track[t].covariance, rows[t], near.value, gate);
            estimate.push_back(numbers(track[t].x));
            if (frame < kSettled) continue;
            result.track[t].range_estimate += share * square(estimate[t][0] - truth[t][0]);
            result.track[t].rate_estimate += share * square(estimate[t][1] - truth[t][1]);
        }
        books.add(frame, estimate, truth);
    }
    return books.finish();
}

template StudyResult run_study_filter<double>(const StudyFilter&, const StudyGeometry&, const StudyCondition&,
                                              const StudyRun&);
template StudyResult run_study_filter<dsp::Real>(const StudyFilter&, const StudyGeometry&,
                                                 const StudyCondition&, const StudyRun&);

std::vector<StudyFilter> lee2000_filters() {
    using namespace tracking;
    std::vector<StudyFilter> filters;
    const auto literal = [](double alpha) {
        auto order = kLeeKim2000<double>;
        order.alpha = alpha;
        return order;
    };
    filters.push_back({"nn", Associator::nn, {}});
    filters.push_back({"pda", Associator::pda, {}});
    for (const int alpha : {2, 4, 6, 8})
        filters.push_back({"ospda(" + std::to_string(alpha) + ")", Associator::ospda, literal(alpha)});
    filters.push_back({"jpda", Associator::jpda, {}});
    for (const int alpha : {2, 4, 6, 8})
        filters.push_back({"osjpda(" + std::to_string(alpha) + ")", Associator::osjpda, literal(alpha)});

    // From the literal reading to the default, one option after the other.
    auto order = literal(4);
    order.missed = MissedColumn::keep;
    filters.push_back({"ospda/keep", Associator::ospda, order});
    order.reduced = Reduced::claimed_by_others;
    filters.push_back({"ospda/claimed", Associator::ospda, order});
    order.precedence = Precedence::strength;
    filters.push_back({"ospda/strength", Associator::ospda, order});
    order.precedence = Precedence::optimal;
    filters.push_back({"ospda/optimal", Associator::ospda, order});
    order.reduction = Reduction::soft;
    filters.push_back({"ospda/soft", Associator::ospda, order});
    order.reduction = Reduction::exclusive;
    order.covariance = CovarianceBetas::decided;
    filters.push_back({"ospda/decided", Associator::ospda, order});
    const auto radar = TrackerConfig<double>{}.order_statistics;
    filters.push_back({"ospda", Associator::ospda, radar});
    filters.push_back({"osjpda", Associator::osjpda, radar});
    return filters;
}

}  // namespace sim
