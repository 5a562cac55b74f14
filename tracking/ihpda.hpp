/// Integrated highest probability data association: each track takes one measurement, by where it lies and by
/// the rank of its signal strength.
///
/// Source: Kim, Choi, Kim, Yang and Song 2013, whose page differs from what its own model gives; followed
/// here is the model:
///   - the two cases of delta are printed exchanged: delta = q belongs to an empty gate;
///   - the m / (lambda V) term of delta and beta_0 lacks the factor q = PD PG;
///   - the alternating sum for P_A is replaced by the product it equals, which loses no digits;
///   - gamma(m) P_A(m) needs no case of its own: it is 1 / (m + (m-1) snr) as printed;
///   - delta's sum of P_j^s in the linear form runs over the measurements of s (see lm_ipda.hpp).
/// Taking the largest beta, not any, is known to bias existence upwards: the update treats the choice as if
/// it had been made before looking.
#pragma once

#include "tracking/assignment.hpp"
#include "tracking/lm_ipda.hpp"

namespace tracking {

/// How tracks that want the same measurement come to terms.
enum class Sharing : std::uint8_t {
    ignored,  ///< IHPDA: they do not, both may take it
    optimal,  ///< JIHPDA: the one-to-one assignment with the largest sum of beta
    greedy,   ///< MMR (Kolitz 1988): the largest beta of the table takes its measurement, again and again
};

struct IhpdaConfig {
    Sharing sharing = Sharing::optimal;
    bool modulated =
        false;  ///< the betas of the assignment see the other tracks as clutter: LM-IHPDA with greedy
    /// The assignment maximises psi * beta in place of the paper's beta: a track that hardly exists then
    /// cannot take the measurement of one that does.
    bool by_existence = true;
};

/// P(the target has rank l | m measurements, one of them the target) for l = 1..m, strongest first; out has
/// m. Exponential strengths, the target's mean 1 + snr times the clutter's. Sums to 1. Cost 2m
/// multiplications and divisions.
template <class S>
void rank_probabilities(S log_spread, std::span<Weight<S>> out) {
    const Weight<S> a = weight_exp(log_spread);
    const Weight<S> one = weight_of(S(1));
    Weight<S> strongest = one;  // P_A(m)
    for (std::size_t i = 1; i < out.size(); ++i) {
        const Weight<S> odds = weight_of(S(static_cast<int>(i))) * a;
        strongest *= odds / (one + odds);
    }
    Weight<S> p = strongest;
    for (std::size_t l = 0; l < out.size(); ++l) {
        if (l > 0) {
            const Weight<S> passed = weight_of(S(static_cast<int>(l) - 1)) * a;
            p *= (one + passed) / (weight_of(S(static_cast<int>(l))) * a);
        }
        out[l] = p;
    }
}

/// Scratch memory of ihpda.
template <class S>
struct IhpdaWorkspace {
    LmWorkspace<S> linear;
    Assignment<S> assignment;
    std::array<std::int8_t, kMaxTracks> choice{};  ///< candidate index, or kNone
};

namespace detail {

/// A row's hypotheses about each candidate kept: it is the target's (T), or exists and it is not (F).
template <class S>
struct RankHypotheses {
    std::array<Weight<S>, kMaxGated> is_target;
    std::array<Weight<S>, kMaxGated> is_not;
};

/// `keep`: candidates considered, as bits. weight: PD N / lambda~; modulation: lambda~ / lambda.
template <class S>
void rank_hypotheses(const AssociationRow<S>& row, std::uint32_t keep, std::span<const S> strength,
                     const RankInput<S>& input, std::span<const Weight<S>> weight,
                     std::span<const Weight<S>> modulation, RankHypotheses<S>& out) {
    const int count = std::popcount(keep);
    if (count == 0) return;
    std::array<Weight<S>, kMaxGated> rank_probability;
    rank_probabilities<S>(input.log_spread, {rank_probability.data(), static_cast<std::size_t>(count)});
    const Weight<S> m = weight_of(S(count));
    const Weight<S> missed = weight_exp(row.log_missed);
    const Weight<S> detected_elsewhere =
        weight_of(S(1) - exp(row.log_missed)) * m / weight_exp(input.log_gate_clutter);
    for (std::uint32_t left = keep; left != 0; left &= left - 1) {
        const auto c = static_cast<std::size_t>(std::countr_zero(left));
        const S own = strength[row.item[c].measurement];
        std::size_t rank = 0;
        for (std::uint32_t others = keep; others != 0; others &= others - 1) {
            const auto d = static_cast<std::size_t>(std::countr_zero(others));
            const S other = strength[row.item[d].measurement];
            if (own < other || (own == other && d < c)) ++rank;
        }
        const Weight<S> p = rank_probability[rank];
        const S rest = S(1) - share_of<S>(p, weight_of(S(1)));
        out.is_target[c] = weight[c] * m * p;
        out.is_not[c] = missed + detected_elsewhere / modulation[c] * weight_of(rest > S(0) ? rest : S(0));
    }
}

}  // namespace detail

/// Fills every row with its one measurement, beta and missed summing to 1 and beta 0 for the others, and
/// updates `existence`.
///
/// strength: of each measurement of the frame, any increasing function of the signal strength (decibels
/// serve). input: one a row. At most kMaxTracks rows. A gate with no measurement left is a miss. Amplitude
/// enters by rank only; do not add log_amplitude_ratio to the rows as well. Cost m^2 comparisons a row, and
/// with `greedy` one pass over all candidates for every row.
template <class S>
void ihpda(std::span<AssociationRow<S>> rows, std::span<S> existence, std::span<const S> strength,
           std::span<const RankInput<S>> input, const IhpdaConfig& config, IhpdaWorkspace<S>& work) {
    constexpr auto kNone = static_cast<std::int8_t>(Assignment<S>::kNone);
    const auto all_of = [&](std::size_t t) { return (std::uint32_t{1} << rows[t].count) - 1; };
    const Weight<S> one = weight_of(S(1));

    // Betas of the single-track update, in row.beta.
    detail::RankHypotheses<S> h;
    if (config.modulated) {
        modulate_clutter(std::span<const AssociationRow<S>>(rows), std::span<const S>(existence),
                         work.linear);
    } else {
        for (std::size_t t = 0; t < rows.size(); ++t) {
            work.linear.modulation[t].fill(one);
            for (std::size_t c = 0; c < static_cast<std::size_t>(rows[t].count); ++c)
                work.linear.weight[t][c] = weight_exp(rows[t].item[c].log_ratio);
        }
    }
    for (std::size_t t = 0; t < rows.size(); ++t) {
        detail::rank_hypotheses<S>(rows[t], all_of(t), strength, input[t], work.linear.weight[t],
                                   work.linear.modulation[t], h);
        for (std::size_t c = 0; c < static_cast<std::size_t>(rows[t].count); ++c)
            rows[t].item[c].beta = share_of<S>(h.is_target[c], h.is_target[c] + h.is_not[c]);
    }

    const auto value = [&](std::size_t t, std::size_t c) {
        const S beta = rows[t].item[c].beta;
        return config.by_existence && config.sharing != Sharing::ignored ? existence[t] * beta : beta;
    };
    std::uint64_t given = 0;  // measurements somebody got
    work.choice.fill(kNone);
    if (config.sharing == Sharing::ignored) {
        for (std::size_t t = 0; t < rows.size(); ++t) {
            for (std::size_t c = 0; c < static_cast<std::size_t>(rows[t].count); ++c)
                if (work.choice[t] == kNone ||
                    value(t, static_cast<std::size_t>(work.choice[t])) < value(t, c))
                    work.choice[t] = static_cast<std::int8_t>(c);
        }
    } else if (config.sharing == Sharing::optimal) {
        assign_best(
            std::span<const AssociationRow<S>>(rows),
            [&](int t, int c) { return value(static_cast<std::size_t>(t), static_cast<std::size_t>(c)); },
            [](int) { return S(0); }, work.assignment);
        work.choice = work.assignment.candidate;
    } else {
        for (std::size_t round = 0; round < rows.size(); ++round) {
            std::size_t winner = rows.size();
            std::size_t prize = 0;
            for (std::size_t t = 0; t < rows.size(); ++t) {
                if (work.choice[t] != kNone) continue;
                for (std::size_t c = 0; c < static_cast<std::size_t>(rows[t].count); ++c) {
                    if ((given >> rows[t].item[c].measurement & 1) != 0) continue;
                    if (winner == rows.size() || value(winner, prize) < value(t, c)) {
                        winner = t;
                        prize = c;
                    }
                }
            }
            if (winner == rows.size()) break;
            work.choice[winner] = static_cast<std::int8_t>(prize);
            given |= std::uint64_t{1} << rows[winner].item[prize].measurement;
        }
    }
    if (config.sharing != Sharing::ignored) {
        given = 0;
        for (std::size_t t = 0; t < rows.size(); ++t)
            if (work.choice[t] != kNone)
                given |= std::uint64_t{1}
                         << rows[t].item[static_cast<std::size_t>(work.choice[t])].measurement;
    }

    // Each track forgets what others got, ranks what is left anew and is updated against the real clutter:
    // the modulation has done its work in the assignment and would count the rivals twice.
    std::array<Weight<S>, kMaxGated> unmodulated;
    unmodulated.fill(one);
    for (std::size_t t = 0; t < rows.size(); ++t) {
        AssociationRow<S>& row = rows[t];
        std::uint32_t keep = 0;
        std::array<Weight<S>, kMaxGated> weight;
        for (std::size_t c = 0; c < static_cast<std::size_t>(row.count); ++c) {
            row.item[c].beta = row.item[c].weight = S(0);
            weight[c] = weight_exp(row.item[c].log_ratio);
            const bool others =
                (given >> row.item[c].measurement & 1) != 0 && static_cast<int>(c) != work.choice[t];
            if (config.sharing == Sharing::ignored || !others) keep |= std::uint32_t{1} << c;
        }
        detail::rank_hypotheses<S>(row, keep, strength, input[t], weight, unmodulated, h);
        if (work.choice[t] == kNone) {
            // Possible with something left to take only where its beta is zero.
            row.missed = row.missed_weight = S(1);
            const Weight<S> present = weight_of(existence[t]) * weight_exp(row.log_missed);
            const Weight<S> all = weight_of(S(1) - existence[t]) + present;
            existence[t] = share_of<S>(present, all);
            continue;
        }
        const auto c = static_cast<std::size_t>(work.choice[t]);
        const Weight<S> likelihood = h.is_target[c] + h.is_not[c];
        row.item[c].beta = row.item[c].weight = share_of<S>(h.is_target[c], likelihood);
        row.missed = row.missed_weight = share_of<S>(h.is_not[c], likelihood);
        const Weight<S> present = weight_of(existence[t]) * likelihood;
        existence[t] = share_of<S>(present, weight_of(S(1) - existence[t]) + present);
    }
}

}  // namespace tracking
