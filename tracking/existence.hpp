/// Does the target of a track exist? The probability's way from one frame to the next.
///
/// Source: Musicki, Evans and Stankovic 1994 (IPDA), Markov chain one (exists or not) and two (exists and can
/// be seen, exists and cannot, does not exist). Every existence-based solver of this folder takes the
/// predicted probabilities of its rows and replaces them by the updated ones.
#pragma once

#include <array>
#include <cstddef>

#include "tracking/association.hpp"
#include "tracking/weight.hpp"

namespace tracking {

/// Markov chain one. Probabilities for one frame.
template <class S>
struct ExistenceChain {
    S survive = constant<S>(98, 100);  ///< exists -> exists; nearer 1 keeps lost tracks longer
    S appear = S(0);                   ///< does not exist -> exists

    [[nodiscard]] constexpr bool valid() const {
        return survive >= S(0) && survive <= S(1) && appear >= S(0) && appear <= S(1);
    }
    /// psi of the next frame before its measurements.
    [[nodiscard]] constexpr S predict(S psi) const { return survive * psi + appear * (S(1) - psi); }
};

/// Existence with the target hidden or not: behind a bridge, in a blind speed.
template <class S>
struct ObservableExistence {
    S seen = S(0);    ///< exists and can be detected: this is what the solvers update
    S hidden = S(0);  ///< exists and cannot
    [[nodiscard]] constexpr S exists() const { return seen + hidden; }
};

/// Markov chain two over {seen, hidden, absent}; row: from, column: to.
template <class S>
struct ObservableChain {
    std::array<std::array<S, 3>, 3> transition{
        {{constant<S>(90, 100), constant<S>(8, 100), constant<S>(2, 100)},
         {constant<S>(30, 100), constant<S>(68, 100), constant<S>(2, 100)},
         {S(0), S(0), S(1)}}};

    /// Entries are probabilities and rows sum to 1 within 2^-16.
    [[nodiscard]] constexpr bool valid() const {
        for (const auto& row : transition) {
            S rest = S(1);
            for (const S p : row) {
                if (p < S(0) || p > S(1)) return false;
                rest -= p;
            }
            if (rest > constant<S>(1, 65536) || -rest > constant<S>(1, 65536)) return false;
        }
        return true;
    }
    [[nodiscard]] constexpr ObservableExistence<S> predict(const ObservableExistence<S>& psi) const {
        const S absent = S(1) - psi.exists();
        const auto into = [&](std::size_t to) {
            return psi.seen * transition[0][to] + psi.hidden * transition[1][to] + absent * transition[2][to];
        };
        return {into(0), into(1)};
    }
};

/// The update of chain two, from what any solver made of `seen`. The measurements say nothing about hidden
/// against absent, so these two keep their proportion.
template <class S>
ObservableExistence<S> update_observable(const ObservableExistence<S>& predicted, S seen) {
    const S unseen_before = S(1) - predicted.seen;
    if (!(unseen_before > S(0))) return {seen, S(0)};
    const Weight<S> hidden = weight_of(predicted.hidden) * weight_of(S(1) - seen);
    return {seen, share_of<S>(hidden, weight_of(unseen_before))};
}

/// psi L / (1 - psi + psi L) from ln L. L may be e^+-30, so whichever of L and 1/L is small is used.
template <class S>
S updated_existence(S psi, S log_evidence) {
    const S doubt = S(1) - psi;
    const S part = log_evidence > S(0) ? psi : weighted(psi, exp(log_evidence));
    const S whole = part + (log_evidence > S(0) ? weighted(doubt, exp(-log_evidence)) : doubt);
    return whole > S(0) ? share(part, reciprocal(whole)) : S(0);
}

namespace detail {

/// Turns likelihoods relative to "all clutter" into the row's probabilities, all conditional on existence,
/// and psi into its update: L = missed + sum of candidates, psi+ = psi L / (1 - psi + psi L). `candidates` is
/// parallel to the row's.
template <class S>
void conclude_row(AssociationRow<S>& row, S& psi, Weight<S> missed, std::span<const Weight<S>> candidates) {
    Weight<S> likelihood = missed;
    for (const Weight<S>& w : candidates) likelihood += w;
    row.missed = row.missed_weight = share_of<S>(missed, likelihood);
    for (std::size_t c = 0; c < candidates.size(); ++c)
        row.item[c].beta = row.item[c].weight = share_of<S>(candidates[c], likelihood);
    const Weight<S> present = weight_of(psi) * likelihood;
    const Weight<S> all = weight_of(S(1) - psi) + present;
    psi = share_of<S>(present, all);
}

}  // namespace detail
}  // namespace tracking
