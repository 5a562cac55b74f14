/// Linear multi-target IPDA: the other tracks' measurements are more clutter. Work linear in the number of
/// tracks and candidates.
#pragma once

#include "tracking/existence.hpp"
#include "tracking/track.hpp"

namespace tracking {

/// Scratch memory; sizes follow kMaxTracks rows and kMaxMeasurements.
template <class S>
struct LmWorkspace {
    std::array<std::array<Weight<S>, kMaxGated>, kMaxTracks> weight;  ///< PD N / rho of each pair
    std::array<std::array<Weight<S>, kMaxGated>, kMaxTracks>
        rival;  ///< (p / rho) P / (1 - P), clutter to the others
    std::array<std::array<Weight<S>, kMaxGated>, kMaxTracks> modulation;  ///< rho~ / rho
    std::array<Weight<S>, kMaxMeasurements> total;
};

/// work.modulation of every pair becomes rho~ / rho, the clutter its track sees against the real clutter, and
/// work.weight becomes PD N / rho~.
///
/// Source: Musicki and La Scala 2008; equations 14 of the 2013 and 23, 24 of the 2020 paper:
///     P_j^s = q_s psi_s p_j^s / sum_{l in gate of s} p_l^s,  rho~_j = rho_j + sum_{s != t} p_j^s P_j^s / (1
///     - P_j^s).
/// Both papers print the sum of P_j^s to the m of track t (m_k^tau); it runs over the measurements of s.
/// 1 - P_j^s is held at 2^-16 at least: it is zero only for a certain target (q psi = 1) with one
/// measurement. Two sure tracks that share one strong return suppress each other, which JIPDA does not do.
template <class S>
void modulate_clutter(std::span<const AssociationRow<S>> rows, std::span<const S> existence,
                      LmWorkspace<S>& work) {
    for (std::size_t t = 0; t < rows.size(); ++t) {
        Weight<S> sum{};
        const auto count = static_cast<std::size_t>(rows[t].count);
        for (std::size_t c = 0; c < count; ++c) {
            work.weight[t][c] = weight_exp(rows[t].item[c].log_ratio);
            sum += work.weight[t][c];
        }
        const S q = S(1) - exp(rows[t].log_missed);
        const S prior = q * existence[t];
        for (std::size_t c = 0; c < count; ++c) {
            work.rival[t][c] = Weight<S>{};
            if (!(q > S(0))) continue;
            const S taken = prior * share_of<S>(work.weight[t][c], sum);  // P_j^s
            S free = S(1) - taken;
            if (free < constant<S>(1, 65536)) free = constant<S>(1, 65536);
            work.rival[t][c] = work.weight[t][c] / weight_of(q) * (weight_of(taken) / weight_of(free));
        }
    }
    // Each row sees what the rows before it and the rows after it take: its own part stays out by not being
    // added, since the difference of large sums would lose the small ones.
    work.total.fill(Weight<S>{});
    for (std::size_t t = 0; t < rows.size(); ++t) {
        for (std::size_t c = 0; c < static_cast<std::size_t>(rows[t].count); ++c) {
            Weight<S>& taken = work.total[rows[t].item[c].measurement];
            work.modulation[t][c] = weight_of(S(1)) + taken;
            taken += work.rival[t][c];
        }
    }
    work.total.fill(Weight<S>{});
    for (std::size_t t = rows.size(); t-- > 0;) {
        for (std::size_t c = 0; c < static_cast<std::size_t>(rows[t].count); ++c) {
            Weight<S>& taken = work.total[rows[t].item[c].measurement];
            work.modulation[t][c] += taken;
            taken += work.rival[t][c];
            work.weight[t][c] = work.weight[t][c] / work.modulation[t][c];
        }
    }
}

/// LM-IPDA: IPDA against the modulated clutter. Rows and existence as in ipda; at most kMaxTracks rows.
template <class S>
void lm_ipda(std::span<AssociationRow<S>> rows, std::span<S> existence, LmWorkspace<S>& work) {
    modulate_clutter(std::span<const AssociationRow<S>>(rows), std::span<const S>(existence), work);
    for (std::size_t t = 0; t < rows.size(); ++t)
        detail::conclude_row<S>(rows[t], existence[t], weight_exp(rows[t].log_missed),
                                {work.weight[t].data(), static_cast<std::size_t>(rows[t].count)});
}

}  // namespace tracking
