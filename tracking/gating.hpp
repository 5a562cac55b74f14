/// Which measurements can be a track's, and how much likelier each is the target than clutter.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "tracking/association.hpp"
#include "tracking/bits.hpp"
#include "tracking/kalman.hpp"
#include "tracking/scalar.hpp"
#include "tracking/scratch.hpp"
#include "tracking/track.hpp"

namespace tracking {

template <class S>
struct GateConfig {
    S gate =
        S(16);  ///< g^2: largest nu' S^-1 nu. 16 is 4 sigma, PG = 0.99966; smaller loses manoeuvring tracks
    S detection_probability = constant<S>(9, 10);  ///< PD of a target in the field of view
    /// For a track so near another that both echoes may be one detection, PD (a miss says little) and what is
    /// added to the standard deviations (the one detection lies anywhere between the two). Without this, two
    /// tracks that meet are drawn together and one of them is lost.
    S obscured_detection_probability = constant<S>(2, 10);
    S obscured_range_sigma_m = S(1);
    S obscured_rate_sigma_mps = constant<S>(1, 2);
    /// lambda, false detections a frame per m (m/s); below 2^-22 it is taken as 2^-22. Larger than thermal
    /// false alarms alone (about 2e-5) so that one doubtful detection does not outweigh everything known.
    S clutter_density = constant<S>(5, 10'000);
    /// Nonparametric: lambda from the measurements in each track's gate in place of clutter_density. For
    /// clutter nobody knows; a known density is better, since a gate holds few measurements.
    bool nonparametric = false;
    /// Least standard deviations of a measurement: the reflecting point wanders over a vehicle, and two
    /// echoes in one cell pull each other, whatever the signal-to-noise ratio says.
    S min_range_sigma_m = constant<S>(15, 100);
    S min_rate_sigma_mps = constant<S>(5, 100);
    /// Range rates are measured modulo this (wavelength / 2 chirp intervals); 0: unambiguous.
    S rate_span_mps = constant<S>(60'834'496, 1'000'000);
    /// Range error per span of range rate that was folded: coupling_s * rate_span_mps, because the signal
    /// processing removes the range-Doppler coupling of the folded rate.
    S alias_range_m = constant<S>(4'996'541, 1'000'000);

    [[nodiscard]] constexpr bool valid() const {
        return gate > S(0) && gate <= S(100) && detection_probability > S(0) &&
               detection_probability <= S(1) && obscured_detection_probability >= S(0) &&
               obscured_detection_probability <= detection_probability && obscured_range_sigma_m >= S(0) &&
               obscured_range_sigma_m <= S(10) && obscured_rate_sigma_mps >= S(0) &&
               obscured_rate_sigma_mps <= S(10) && clutter_density >= S(0) && clutter_density <= S(1) &&
               min_range_sigma_m >= constant<S>(1, 100) && min_range_sigma_m <= S(10) &&
               min_rate_sigma_mps >= constant<S>(1, 100) && min_rate_sigma_mps <= S(10) &&
               rate_span_mps >= S(0) && rate_span_mps <= S(400) && absolute(alias_range_m) <= S(100);
    }
};

/// Fills association rows. Each candidate has its own S = P + R, since measurements differ in accuracy.
template <class S>
class Gate {
  public:
    explicit Gate(const GateConfig<S>& config)
        : config_(config),
          least_variance_(config.min_range_sigma_m * config.min_range_sigma_m,
                          config.min_rate_sigma_mps * config.min_rate_sigma_mps),
          obscured_variance_(config.obscured_range_sigma_m * config.obscured_range_sigma_m,
                             config.obscured_rate_sigma_mps * config.obscured_rate_sigma_mps),
          most_change_(config.rate_span_mps > S(0) ? config.rate_span_mps * constant<S>(1, 2) : largest<S>()),
          most_shift_(absolute(config.alias_range_m) * kMaxFolds),
          gate_probability_(S(1) - exp(config.gate * constant<S>(-1, 2))),
          seen_(logs(config.detection_probability)),
          obscured_(logs(config.obscured_detection_probability)) {}

    /// nu = z - x, with the range rate unfolded to the ambiguity nearest to x and the range shifted with it.
    [[nodiscard]] Vec2<S> innovation(const Vec2<S>& x, const Vec2<S>& z) const {
        S range = z[0] - x[0];
        S rate = z[1] - x[1];
        if (absolute(rate) > most_change_) {
            for (int k = 0; k < kMaxFolds && rate > most_change_; ++k) {
                range += config_.alias_range_m;
                rate -= config_.rate_span_mps;
            }
            for (int k = 0; k < kMaxFolds && rate < -most_change_; ++k) {
                range -= config_.alias_range_m;
                rate += config_.rate_span_mps;
            }
        }
        return {range, rate};
    }

    /// R: the measurement's variances, not below the configured least, and wider for an obscured track.
    [[nodiscard]] Vec2<S> noise(const Measurement<S>& m, bool obscured) const {
        const auto larger = [](S a, S b) { return a > b ? a : b; };
        S range = larger(m.variance[0], least_variance_[0]);
        S rate = larger(m.variance[1], least_variance_[1]);
        if (obscured) {
            range += obscured_variance_[0];
            rate += obscured_variance_[1];
        }
        return {range, rate};
    }

    /// How far in range and in range rate a measurement of at most these variances can be from a track of
    /// covariance P in its gate.
    [[nodiscard]] S range_reach(const Mat2<S>& p, S variance, bool obscured) const {
        return reach(p(0, 0), variance, least_variance_[0], obscured ? obscured_variance_[0] : S(0));
    }
    [[nodiscard]] S rate_reach(const Mat2<S>& p, S variance, bool obscured) const {
        return reach(p(1, 1), variance, least_variance_[1], obscured ? obscured_variance_[1] : S(0));
    }

    /// ln of the likelihood ratio PD N(nu; 0, S) / lambda of a measurement inside the gate; nothing outside,
    /// or when S is singular.
    [[nodiscard]] bool test(const Vec2<S>& nu, const Mat2<S>& p, const Vec2<S>& r, S& distance2,
                            S& log_density) const {
        // Each coordinate alone, without a division: rejects nearly all.
        if (product_exceeds(nu[0], nu[0], config_.gate, S(p(0, 0) + r[0])) ||
            product_exceeds(nu[1], nu[1], config_.gate, S(p(1, 1) + r[1])))
            return false;
        const Innovation<S> innovation(p, r);
        if (!innovation.valid()) return false;
        distance2 = innovation.distance2(nu);
        if (distance2 > config_.gate) return false;
        log_density = innovation.log_density(distance2);
        return true;
    }

    /// What most measurements are not four times as inaccurate as.
    [[nodiscard]] Vec2<S> usual_noise(bool obscured) const {
        return noise({{S(0), S(0)}, {S(0), S(0)}, S(0)}, obscured);
    }

    /// Candidates of a track predicted at (x, P) among the measurements whose bit is set in `usable`, none of
    /// them past the last. Of more than kMaxGated the likeliest are kept. Betas are left to a solver.
    /// `log_excess(z)`: ln of the clutter density at z over config().clutter_density, asked of measurements
    /// in the gate only. `range_reach`: what is farther away in range need not be looked at closer.
    template <class LogExcess>
    void fill(AssociationRow<S>& row, const Vec2<S>& x, const Mat2<S>& p,
              std::span<const Measurement<S>> measurements, std::uint64_t usable, bool obscured,
              LogExcess log_excess, S range_reach = largest<S>()) const {
        const SensorLogs<S>& logs = sensor(obscured);
        row.count = 0;
        row.dropped = 0;
        row.obscured = obscured;
        row.log_missed = logs.missed;
        const S folded_reach = range_reach + most_shift_;
        // First those near enough, a short loop that turns most away.
        Scratch<std::uint8_t, 64> near;
        std::size_t count = 0;
        for_each_bit(usable, [&](std::uint32_t index) {
            const Measurement<S>& m = measurements[index];
            if (absolute(m.z[0] - x[0]) > folded_reach) return;
            if (absolute(innovation(x, m.z)[0]) <= range_reach)
                near[count++] = static_cast<std::uint8_t>(index);
        });
        for (std::size_t i = 0; i < count; ++i) {
            const std::uint8_t index = near[i];
            const Measurement<S>& m = measurements[index];
            S distance2(0);
            S log_density(0);
            if (!test(innovation(x, m.z), p, noise(m, obscured), distance2, log_density)) continue;
            insert(row, index, logs.detected + log_density - log_excess(m.z));
        }
    }
    /// The same with clutter as expected everywhere. Bits in `usable` past the measurements are ignored.
    void fill(AssociationRow<S>& row, const Vec2<S>& x, const Mat2<S>& p,
              std::span<const Measurement<S>> measurements, std::uint64_t usable, bool obscured) const {
        if (measurements.size() < 64) usable &= (std::uint64_t{1} << measurements.size()) - 1;
        fill(row, x, p, measurements, usable, obscured, [](const Vec2<S>&) { return S(0); });
    }

    /// The gate of a filled row for the rank-based associators: clutter expected in it, and the target's
    /// strength.
    [[nodiscard]] RankInput<S> rank_input(const AssociationRow<S>& row, const Track<S>& track,
                                          std::span<const Measurement<S>> measurements) const {
        constexpr auto kNepersPerDecibel = constant<S>(230'258'509, 1'000'000'000);
        const S snr = track.snr_db * kNepersPerDecibel;
        RankInput<S> out;
        out.log_spread = snr > S(0) ? snr + ln(S(S(1) + exp(-snr))) : ln(S(S(1) + exp(snr)));
        if (row.count == 0) return out;
        out.log_gate_clutter = floored_ln(config_.clutter_density) + log_volume(row, track, measurements);
        return out;
    }

    /// ln of the clutter density that a filled row shows over config().clutter_density: of its m measurements
    /// PD PG psi are expected to be the target's, the others lie in the volume V of the gate, so the density
    /// is (m - PD PG psi) / V, with at least half a measurement. 0 for an empty row. Musicki and Evans 2004.
    [[nodiscard]] S log_counted_excess(const AssociationRow<S>& row, const Track<S>& track,
                                       std::span<const Measurement<S>> measurements) const {
        if (row.count == 0) return S(0);
        const S pd = row.obscured ? config_.obscured_detection_probability : config_.detection_probability;
        const S clutter = S(row.count + row.dropped) - pd * gate_probability_ * track.existence;
        const S least = constant<S>(1, 2);
        return ln(clutter < least ? least : clutter) - log_volume(row, track, measurements) -
               floored_ln(config_.clutter_density);
    }

    /// ln(PD / lambda) and ln(1 - PD PG).
    [[nodiscard]] const SensorLogs<S>& sensor(bool obscured) const { return obscured ? obscured_ : seen_; }

    [[nodiscard]] const GateConfig<S>& config() const { return config_; }
    /// By how much innovation() shifts a range at most, when range rates are folded.
    [[nodiscard]] S most_shift() const { return most_shift_; }

  private:
    static constexpr int kMaxFolds = 3;  ///< that innovation() takes back

    [[nodiscard]] S reach(S p, S variance, S least, S obscured) const {
        return sqrt_above(config_.gate, S(p + ((variance > least ? variance : least) + obscured)));
    }

    /// ln V of a gate that is not empty, at the accuracy of its first measurement: ln(g^2 / 2) - ln N(0; 0,
    /// S), since V = pi g^2 sqrt|S|.
    [[nodiscard]] S log_volume(const AssociationRow<S>& row, const Track<S>& track,
                               std::span<const Measurement<S>> measurements) const {
        const Ldl<S> s(innovation_covariance(track.covariance,
                                             noise(measurements[row.item[0].measurement], row.obscured)));
        return ln(S(config_.gate * constant<S>(1, 2))) - s.log_density(S(0));
    }

    /// ln of a number of at least 2^-22: a certainty stays finite, so that comparing certainties works.
    static S floored_ln(S v) {
        const S least = constant<S>(1, std::int64_t{1} << 22);
        return ln(v < least ? least : v);
    }
    [[nodiscard]] SensorLogs<S> logs(S detection_probability) const {
        return {floored_ln(detection_probability) - floored_ln(config_.clutter_density),
                floored_ln(S(1) - detection_probability * gate_probability_)};
    }

    static void insert(AssociationRow<S>& row, std::uint16_t measurement, S log_ratio) {
        std::size_t at = 0;
        if (row.count < kMaxGated) {
            at = static_cast<std::size_t>(row.count++);
        } else {
            ++row.dropped;
            for (std::size_t i = 1; i < kMaxGated; ++i) {
                if (row.item[i].log_ratio < row.item[at].log_ratio) at = i;
            }
            if (log_ratio <= row.item[at].log_ratio) return;
            for (; at + 1 < kMaxGated; ++at) row.item[at] = row.item[at + 1];
        }
        row.item[at].measurement = measurement;
        row.item[at].log_ratio = log_ratio;
    }

    GateConfig<S> config_;
    Vec2<S> least_variance_;
    Vec2<S> obscured_variance_;
    S most_change_;  ///< of a range rate, unfolded
    S most_shift_;
    S gate_probability_;
    SensorLogs<S> seen_;
    SensorLogs<S> obscured_;
};

}  // namespace tracking
