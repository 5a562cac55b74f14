/// The association of one frame as a value: for each track a row of candidate measurements and the missed
/// column.
///
/// Gating fills rows (which measurements, and the logarithm of each likelihood ratio); a solver (NN, PDA,
/// JPDA, ...) turns the ratios of all rows into probabilities, beta and missed, and copies them to the
/// weights; the order-statistics decision logic may then reshape the weights. The filter moves the estimate
/// by the weights and widens the covariance by the probabilities. Every step works on
/// `std::span<AssociationRow<S>>`, so steps combine freely and no step knows how many tracks there are.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "tracking/scalar.hpp"

namespace tracking {

/// Measurements one track can have in its gate; of more, the likeliest are kept and the rest is counted.
inline constexpr int kMaxGated = 16;

template <class S>
struct Candidate {
    std::uint16_t measurement = 0;  ///< index into the frame's measurements
    S log_ratio = S(0);             ///< ln( PD N(nu; 0, S) / lambda ): target against clutter
    S beta = S(0);                  ///< probability that this measurement is the track's
    S weight = S(0);  ///< its share in the new estimate: beta, or what a decision logic made of it
};

template <class S>
struct AssociationRow {
    std::array<Candidate<S>, kMaxGated> item{};  ///< ascending measurement index
    int count = 0;
    int dropped = 0;        ///< gated measurements that did not fit
    bool obscured = false;  ///< filled for a track whose echo may be one with another track's
    S log_missed = S(0);    ///< ln(1 - PD PG)
    /// ln(1 - PD PG + sum of ratios): for the track against its absence. Set by pda().
    S log_evidence = S(0);
    S missed = S(1);         ///< beta_0: probability that none is
    S missed_weight = S(1);  ///< share of the prediction in the new estimate

    [[nodiscard]] std::span<Candidate<S>> candidates() {
        return {item.data(), static_cast<std::size_t>(count)};
    }
    [[nodiscard]] std::span<const Candidate<S>> candidates() const {
        return {item.data(), static_cast<std::size_t>(count)};
    }
};

/// Copies the probabilities of a solver to the weights.
template <class S>
void use_betas_as_weights(AssociationRow<S>& row) {
    for (Candidate<S>& c : row.candidates()) c.weight = c.beta;
    row.missed_weight = row.missed;
}

/// What a sensor is like where a track is.
template <class S>
struct SensorLogs {
    S detected = S(0);  ///< ln(PD / lambda)
    S missed = S(0);    ///< ln(1 - PD PG)
};

/// What associators that rank measurements by signal strength want to know beyond a row.
template <class S>
struct RankInput {
    S log_gate_clutter = S(0);  ///< ln(lambda V): clutter measurements expected in the gate
    S log_spread = S(0);        ///< ln(1 + snr), the mean strength of the target against clutter
};

}  // namespace tracking
