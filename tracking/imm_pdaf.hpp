/// IMM with a PDA filter for each mode: a manoeuvring target in clutter.
///
/// Source: Kim, Park, Kim and Ji, whose page gives the bank but not its likelihood; Bar-Shalom, Chang and
/// Blom 1989 do. Existence is added as in IPDA, with the likelihood of all modes together.
#pragma once

#include "tracking/association.hpp"
#include "tracking/existence.hpp"
#include "tracking/imm.hpp"

namespace tracking {

/// A measurement in the gate that is common to all modes.
template <class S>
struct GatedMeasurement {
    Vec2<S> z;
    Vec2<S> variance;
};

/// One sensor's frame: each mode makes its own PDA update with the same measurements, its likelihood
///     L_j = 1 - q + PD sum_i N(nu_ij; 0, S_j) / lambda
/// moves the mode's probability, and existence follows from sum_j c_j L_j. Several sensors update one after
/// another, with predict() before the first only. The gate is the caller's: one for all modes, or modes would
/// be judged on different data; take it about combined().
///
/// Returns beta of "no measurement is the target's", over all modes. beta, if not empty, gets that of each
/// measurement. At most kMaxGated measurements. Cost M times that of a PDA update.
template <class S, int N, std::size_t M>
S pda_update(ImmState<S, N, M>& state, S& existence, std::span<const GatedMeasurement<S>> measurements,
             const SensorLogs<S>& logs, std::span<S> beta = {}) {
    std::array<Weight<S>, M> mode_weight;
    std::array<Weight<S>, kMaxGated> ratio;
    std::array<Weight<S>, kMaxGated> of_measurement{};
    const Weight<S> missed = weight_exp(logs.missed);
    for (std::size_t j = 0; j < M; ++j) {
        const VecN<S, N> x = state.x[j];
        const MatN<S, N> p = state.covariance[j];
        Weight<S> likelihood = missed;
        for (std::size_t i = 0; i < measurements.size(); ++i) {
            const Vec2<S> nu(measurements[i].z[0] - x[0], measurements[i].z[1] - x[1]);
            const Ldl<S> innovation(
                innovation_covariance(measured_covariance<S, N>(p), measurements[i].variance));
            ratio[i] = weight_exp(S(logs.detected + innovation.log_density(innovation.distance2(nu))));
            likelihood += ratio[i];
        }
        mode_weight[j] = weight_of(state.probability[j]) * likelihood;
        for (std::size_t i = 0; i < measurements.size(); ++i)
            of_measurement[i] += weight_of(state.probability[j]) * ratio[i];

        // The mixture over "none" and each measurement, matched in mean and covariance.
        const S negligible = constant<S>(1, 1 << 14);
        std::array<VecN<S, N>, kMaxGated> move;
        std::array<S, kMaxGated> share;
        VecN<S, N> mean = VecN<S, N>::Zero();
        const S none = share_of<S>(missed, likelihood);
        MatN<S, N> spread = p * none;
        S used = none;
        for (std::size_t i = 0; i < measurements.size(); ++i) {
            share[i] = share_of<S>(ratio[i], likelihood);
            if (share[i] < negligible) continue;
            used += share[i];
            const Vec2<S> nu(measurements[i].z[0] - x[0], measurements[i].z[1] - x[1]);
            const Ldl<S> innovation(
                innovation_covariance(measured_covariance<S, N>(p), measurements[i].variance));
            const KalmanGain<S, N> gain(p, innovation);
            move[i] = gain.correction(nu);
            mean += move[i] * share[i];
            spread += gain.posterior(p, measurements[i].variance) * share[i];
        }
        spread += p * (S(1) - used);  // what was too small to look at
        detail::add_outer_n<S, N>(spread, S(1) - used + none, mean);
        for (std::size_t i = 0; i < measurements.size(); ++i)
            if (!(share[i] < negligible)) detail::add_outer_n<S, N>(spread, share[i], move[i] - mean);
        state.x[j] = x + mean;
        state.covariance[j] = spread;
    }
    Weight<S> likelihood{};
    for (const Weight<S>& w : mode_weight) likelihood += w;
    detail::normalise_modes<S, M>(mode_weight, state.probability);
    const Weight<S> present = weight_of(existence) * likelihood;
    existence = share_of<S>(present, weight_of(S(1) - existence) + present);
    for (std::size_t i = 0; i < beta.size() && i < measurements.size(); ++i)
        beta[i] = share_of<S>(of_measurement[i], likelihood);
    return share_of<S>(missed, likelihood);
}

/// The motions of a vehicle seen by the radar, x = [range m, range rate m/s]: steady, and braking or
/// accelerating.
template <class S>
struct RadarModes {
    S period_s = constant<S>(1, 10);
    S steady_sigma_mps2 =
        constant<S>(5, 10);                ///< relative acceleration of a vehicle that follows the traffic
    S hard_sigma_mps2 = S(5);              ///< of one that brakes or pulls away, up to about 8 m/s^2
    S stay_steady = constant<S>(98, 100);  ///< from one frame to the next: 5 s on average
    S stay_hard = constant<S>(95, 100);    ///< 2 s

    [[nodiscard]] constexpr bool valid() const {
        return period_s > S(0) && steady_sigma_mps2 > S(0) && hard_sigma_mps2 > steady_sigma_mps2 &&
               stay_steady > S(0) && stay_steady < S(1) && stay_hard > S(0) && stay_hard < S(1);
    }
    [[nodiscard]] ImmModel<S, 2, 2> model() const {
        ImmModel<S, 2, 2> m;
        m.mode[0] = constant_velocity<S, 1>(period_s, steady_sigma_mps2);
        m.mode[1] = constant_velocity<S, 1>(period_s, hard_sigma_mps2);
        m.change = {{{stay_steady, S(1) - stay_steady}, {S(1) - stay_hard, stay_hard}}};
        return m;
    }
};
static_assert(RadarModes<dsp::Real>{}.valid());

}  // namespace tracking
