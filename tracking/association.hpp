/// The association of one frame as a value: for each track a row of candidate measurements and the missed
/// column.
///
/// Gating fills rows (which measurements, and the logarithm of each likelihood ratio); a solver (NN, PDA,
/// JPDA, ...) turns the ratios of all rows into probabilities; the order-statistics decision logic may then
/// reshape them. Every step works on `std::span<AssociationRow<S>>`, so steps combine freely and no step
/// knows how many tracks there are.
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
};

template <class S>
struct AssociationRow {
    std::array<Candidate<S>, kMaxGated> item{};  ///< ascending measurement index
    int count = 0;
    int dropped = 0;      ///< gated measurements that did not fit
    S log_missed = S(0);  ///< ln(1 - PD PG)
    S missed = S(0);      ///< beta_0: probability that none is

    [[nodiscard]] std::span<Candidate<S>> candidates() {
        return {item.data(), static_cast<std::size_t>(count)};
    }
    [[nodiscard]] std::span<const Candidate<S>> candidates() const {
        return {item.data(), static_cast<std::size_t>(count)};
    }
};

}  // namespace tracking
