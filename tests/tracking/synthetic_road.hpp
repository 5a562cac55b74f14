/// Detections of a road with known truth, without beat signals: what the signal processing would report for a
/// set of point targets, with noise by SNR, misses, echoes that cannot be resolved, folded range rates and
/// clutter. Seeded and the same on every machine; measurements are made in fixed point, so every tracker sees
/// the same.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include "tests/tracking/scalars.hpp"
#include "tracking/track.hpp"

namespace tracking_test {

struct Target {
    double range_m = 0;
    double rate_mps = 0;
    double snr_db = 25;
    int first_frame = 0;
    int last_frame = 1 << 30;
    std::vector<std::pair<int, double>> acceleration_from{};  ///< (frame, m/s^2 from it on), ascending
};

struct Road {
    std::vector<Target> targets;
    double detection_probability = 0.95;
    double clutter_per_frame = 0;  ///< uniform over 160 m x the unambiguous range rates
    double resolution_cells =
        1.6;  ///< echoes nearer in both dimensions are one detection at the stronger one
    double period_s = 0.1;
};

inline constexpr double kRangeCell = 4.996541;
inline constexpr double kRateCell = 0.950539;
inline constexpr double kSpan = 64 * kRateCell;

struct Frame {
    std::vector<tracking::Measurement<dsp::Real>> measurements;
    std::vector<Target> truth;  ///< those inside 0..160 m and their life; `snr_db` unused
    std::vector<int> index;     ///< of each in Road::targets
    std::vector<bool> seen;     ///< each has a detection of its own in this frame
};

class Synthesiser {
  public:
    Synthesiser(const Road& road, std::uint64_t seed) : road_(road), random_(seed), state_(road.targets) {}

    Frame next() {
        Frame frame;
        std::vector<double> snr;
        for (std::size_t i = 0; i < state_.size(); ++i) {
            Target& t = state_[i];
            if (number_ >= t.first_frame && number_ <= t.last_frame && t.range_m > 1 && t.range_m < 159) {
                frame.truth.push_back(t);
                frame.index.push_back(static_cast<int>(i));
                snr.push_back(t.snr_db);
            }
            if (number_ >= t.first_frame) move(t);
        }
        frame.seen.assign(frame.truth.size(), false);
        std::vector<double> strength;
        for (std::size_t i = 0; i < frame.truth.size(); ++i) {
            // Strongest of the echoes it cannot be told from, with some fading from frame to frame.
            const double fading = 1.5 * gaussian();
            strength.push_back(snr[i] + fading);
        }
        for (std::size_t i = 0; i < frame.truth.size(); ++i) {
            bool hidden = false;
            double pull_range = 0, pull_rate = 0;
            for (std::size_t j = 0; j < frame.truth.size(); ++j) {
                if (j == i) continue;
                const double dr = (frame.truth[j].range_m - frame.truth[i].range_m) / kRangeCell;
                const double dv = (frame.truth[j].rate_mps - frame.truth[i].rate_mps) / kRateCell;
                if (std::abs(dr) > road_.resolution_cells || std::abs(dv) > road_.resolution_cells) continue;
                hidden = hidden || strength[j] > strength[i];
                const double share = 1 / (1 + std::pow(10, (strength[i] - strength[j]) / 10));
                pull_range += share * dr * kRangeCell;
                pull_rate += share * dv * kRateCell;
            }
            const bool missed = uniform() > road_.detection_probability;
            const double noise_range = gaussian();
            const double noise_rate = gaussian();
            if (hidden || missed) continue;
            frame.seen[i] = true;
            frame.measurements.push_back(measure(frame.truth[i].range_m + pull_range,
                                                 frame.truth[i].rate_mps + pull_rate, strength[i],
                                                 noise_range, noise_rate));
        }
        std::poisson_distribution<int> false_alarms(road_.clutter_per_frame > 0 ? road_.clutter_per_frame
                                                                                : 1e-9);
        for (int n = false_alarms(random_); n > 0; --n) {
            const double range = 160 * uniform();
            const double rate = kSpan * (uniform() - 0.5);
            frame.measurements.push_back(measure(range, rate, 12 + 3 * uniform(), 0, 0));
        }
        std::stable_sort(frame.measurements.begin(), frame.measurements.end(),
                         [](const auto& a, const auto& b) { return a.snr_db > b.snr_db; });
        ++number_;
        return frame;
    }

  private:
    double uniform() { return std::ldexp(static_cast<double>(random_() >> 11), -53); }
    double gaussian() {
        return std::sqrt(-2 * std::log(1 - uniform())) * std::cos(6.283185307179586 * uniform());
    }

    void move(Target& t) const {
        const double T = road_.period_s;
        t.range_m += t.rate_mps * T;
        double acceleration = 0;
        for (const auto& [frame, value] : t.acceleration_from) {
            if (number_ >= frame) acceleration = value;
        }
        t.range_m += 0.5 * acceleration * T * T;
        t.rate_mps += acceleration * T;
    }

    static dsp::Real real(double v) {
        return dsp::Real::from_raw(static_cast<std::int32_t>(std::lround(v * (1 << 22))));
    }

    static tracking::Measurement<dsp::Real> measure(double range, double rate, double snr_db,
                                                    double noise_range, double noise_rate) {
        // 1.5 times the Cramer-Rao bound of 64 samples at this integrated SNR: 0.39 cell / amplitude ratio.
        const double sigma_cells = 1.5 * 0.39 / std::pow(10, snr_db / 20);
        const double folds = std::round(rate / kSpan);
        rate -= folds * kSpan;
        range += folds * kRangeCell;  // the coupling of a folded rate is removed wrongly, by one range cell
        tracking::Measurement<dsp::Real> m;
        m.z = {real(range + noise_range * sigma_cells * kRangeCell),
               real(rate + noise_rate * sigma_cells * kRateCell)};
        m.variance = {real(std::pow(sigma_cells * kRangeCell, 2)),
                      real(std::pow(sigma_cells * kRateCell, 2))};
        m.snr_db = real(snr_db);
        return m;
    }

    Road road_;
    std::mt19937_64 random_;
    std::vector<Target> state_;
    int number_ = 0;
};

/// The same measurements as another scalar. Exact.
template <class S>
std::vector<tracking::Measurement<S>> as(const std::vector<tracking::Measurement<dsp::Real>>& in) {
    std::vector<tracking::Measurement<S>> out;
    for (const auto& m : in) {
        tracking::Measurement<S> o;
        o.z = {tracking::scalar_from<S>(m.z[0]), tracking::scalar_from<S>(m.z[1])};
        o.variance = {tracking::scalar_from<S>(m.variance[0]), tracking::scalar_from<S>(m.variance[1])};
        o.snr_db = tracking::scalar_from<S>(m.snr_db);
        out.push_back(o);
    }
    return out;
}

}  // namespace tracking_test
