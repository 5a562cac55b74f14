/// Order-statistics decision logic (Lee and Kim 2000): the association rows of any solver, reshaped so that
/// each track prefers one measurement and neighbouring tracks do not share it. OSPDA is this over pda(),
/// OSJPDA is this over jpda().
///
/// As printed: in track order, the dominant measurement of a track is its largest beta among the measurements
/// not yet dominant for an earlier track; every other beta of the row is divided by alpha; rows are
/// normalised. What the paper leaves open, or what turned out to matter, is a named option here. `radar_study
/// lee2000` measures the options; the defaults are what it favours, kLeeKim2000 is the literal reading.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "tracking/assignment.hpp"
#include "tracking/association.hpp"
#include "tracking/scalar.hpp"
#include "tracking/scratch.hpp"
#include "tracking/track.hpp"

namespace tracking {

/// Who chooses a dominant measurement first.
enum class Precedence : std::uint8_t {
    index,     ///< track order, as printed
    strength,  ///< the largest beta of all, then the largest of those left, ...
    optimal,   ///< all at once: the one-to-one assignment with the largest product of likelihood ratios
};
/// What becomes of beta_0.
enum class MissedColumn : std::uint8_t {
    drop,  ///< as printed: a track with a measurement in its gate is always moved
    keep,
};
/// Which betas are made smaller.
enum class Reduced : std::uint8_t {
    all_but_dominant,   ///< as printed
    claimed_by_others,  ///< only measurements that are dominant for another track
};
enum class Reduction : std::uint8_t {
    divide,  ///< by alpha, as printed
    /// Of what another track claims only: times 1 - beta of the claimant. No parameter. If the claimants
    /// claimed with all their betas, two tracks would get exactly their JPDA marginals.
    soft,
    /// A track that has a dominant measurement drops what others claim; one that has none may be hidden in a
    /// claimant's echo and shares it softly. No parameter.
    exclusive,
};
/// Which probabilities the covariance is computed with.
enum class CovarianceBetas : std::uint8_t {
    reshaped,  ///< as printed: the decision is trusted
    original,  ///< the solver's: doubt about the decision widens the covariance
    decided,   ///< reshaped where the track has a dominant measurement, original where it has none
};

template <class S>
struct OrderStatisticsConfig {
    S alpha = S(4);  ///< > 1; 4 over PDA, 6 over JPDA in the paper. Used by Reduction::divide only
    Precedence precedence = Precedence::optimal;
    MissedColumn missed = MissedColumn::keep;
    Reduced reduced = Reduced::claimed_by_others;
    Reduction reduction = Reduction::exclusive;
    CovarianceBetas covariance = CovarianceBetas::decided;

    [[nodiscard]] constexpr bool valid() const { return alpha > S(1) && alpha <= S(100); }
};

/// The literal reading of the paper.
template <class S>
inline constexpr OrderStatisticsConfig<S> kLeeKim2000{S(4),
                                                      Precedence::index,
                                                      MissedColumn::drop,
                                                      Reduced::all_but_dominant,
                                                      Reduction::divide,
                                                      CovarianceBetas::reshaped};

namespace detail {

/// For each row the candidate that dominates it, for each measurement the row it dominates.
using Dominants = Matching;
inline constexpr int kNobody = Matching::kNone;

/// Largest beta among the row's measurements nobody owns; kNobody when there is none.
template <class S>
int largest_free(const AssociationRow<S>& row, const Dominants& dominants) {
    int best = kNobody;
    for (int i = 0; i < row.count; ++i) {
        const Candidate<S>& c = row.item[static_cast<std::size_t>(i)];
        if (dominants.owner[c.measurement] != kNobody) continue;
        if (best == kNobody || c.beta > row.item[static_cast<std::size_t>(best)].beta) best = i;
    }
    return best;
}

template <class S>
void choose_by_index(std::span<const AssociationRow<S>> rows, Dominants& dominants) {
    dominants.clear(rows);
    for (std::size_t t = 0; t < rows.size(); ++t) {
        const int item = largest_free(rows[t], dominants);
        if (item != kNobody) dominants.claim(t, item, rows[t]);
    }
}

template <class S>
void choose_by_strength(std::span<const AssociationRow<S>> rows, Dominants& dominants) {
    dominants.clear(rows);
    for (std::size_t round = 0; round < rows.size(); ++round) {
        std::size_t strongest = rows.size();
        int strongest_item = kNobody;
        S largest(0);
        for (std::size_t t = 0; t < rows.size(); ++t) {
            if (dominants.candidate[t] != kNobody) continue;
            const int item = largest_free(rows[t], dominants);
            if (item == kNobody) continue;
            const S beta = rows[t].item[static_cast<std::size_t>(item)].beta;
            if (strongest_item == kNobody || beta > largest) {
                strongest = t;
                strongest_item = item;
                largest = beta;
            }
        }
        if (strongest_item == kNobody) return;
        dominants.claim(strongest, strongest_item, rows[strongest]);
    }
}

template <class S>
void choose_optimally(std::span<const AssociationRow<S>> rows, Assignment<S>& dominants) {
    assign_best(
        rows,
        [&](int t, int c) {
            return rows[static_cast<std::size_t>(t)].item[static_cast<std::size_t>(c)].log_ratio;
        },
        [&](int t) { return rows[static_cast<std::size_t>(t)].log_missed; }, dominants);
}

}  // namespace detail

/// Reshapes the weights of all rows (at most kMaxTracks, measurement indices below kMaxMeasurements); each
/// row's weights sum to 1 afterwards. A row none of whose candidates has a probability keeps its prediction.
template <class S>
void order_statistics(std::span<AssociationRow<S>> rows, const OrderStatisticsConfig<S>& config) {
    const std::span<const AssociationRow<S>> read(rows);
    Assignment<S> dominants;
    switch (config.precedence) {
        case Precedence::index:
            detail::choose_by_index(read, dominants);
            break;
        case Precedence::strength:
            detail::choose_by_strength(read, dominants);
            break;
        case Precedence::optimal:
            detail::choose_optimally(read, dominants);
            break;
    }
    // What the owner of a measurement leaves to others. Betas change below.
    Scratch<S, kMaxTracks> left;
    for (std::size_t t = 0; t < rows.size(); ++t) {
        const int own = dominants.candidate[t];
        if (own != detail::kNobody) left[t] = S(1) - rows[t].item[static_cast<std::size_t>(own)].beta;
    }
    const auto reduced = [&](const Candidate<S>& c, int owner) {
        if (config.reduction == Reduction::divide) return S(c.beta * reciprocal(config.alpha));
        return owner == detail::kNobody ? c.beta : S(c.beta * left[static_cast<std::size_t>(owner)]);
    };
    const bool free_stay = config.reduced == Reduced::claimed_by_others;
    for (std::size_t t = 0; t < rows.size(); ++t) {
        AssociationRow<S>& row = rows[t];
        const bool has_dominant = dominants.candidate[t] != detail::kNobody;
        const bool trusted = config.covariance == CovarianceBetas::reshaped ||
                             (config.covariance == CovarianceBetas::decided && has_dominant);
        if (row.count == 0) {
            row.missed_weight = S(1);
            if (trusted) row.missed = S(1);
            continue;
        }
        const bool drop_claimed = config.reduction == Reduction::exclusive && has_dominant;
        bool changed = config.missed == MissedColumn::drop;
        S sum(0);
        for (Candidate<S>& c : row.candidates()) {
            const int owner = dominants.owner[c.measurement];
            if (owner == static_cast<int>(t) || (owner == detail::kNobody && free_stay)) {
                c.weight = c.beta;
            } else {
                changed = true;
                c.weight = S(0);
                if (drop_claimed && owner != detail::kNobody) continue;
                c.weight = reduced(c, owner);
            }
            sum += c.weight;
        }
        row.missed_weight = config.missed == MissedColumn::keep ? row.missed : S(0);
        if (!changed) continue;  // they sum up to 1 as before
        sum += row.missed_weight;
        if (sum <= S(0)) {
            row.missed_weight = S(1);
            sum = S(1);
        }
        const auto scale = reciprocal(sum);
        row.missed_weight = share(row.missed_weight, scale);
        if (trusted) {
            row.missed = row.missed_weight;
            for (Candidate<S>& c : row.candidates()) c.beta = c.weight = share(c.weight, scale);
        } else {
            for (Candidate<S>& c : row.candidates()) c.weight = share(c.weight, scale);
        }
    }
}

}  // namespace tracking
