/// Iterative JIPDA: from IPDA to JIPDA by levels, each track on its own.
#pragma once

#include <bit>

#include "tracking/existence.hpp"
#include "tracking/track.hpp"

namespace tracking {

inline constexpr int kMaxLevel = kMaxTracks - 1;

struct IjipdaConfig {
    int level = 3;  ///< 0 is IPDA, the number of tracks - 1 and above is JIPDA; up to kMaxLevel
    /// Candidates that may be visited for one track; a level that would need more is not used. A visit costs
    /// about 15 ns on a PC. 0 still gives level 0.
    std::uint32_t budget = 50'000;

    [[nodiscard]] constexpr bool valid() const { return level >= 0 && level <= kMaxLevel; }
};
static_assert(IjipdaConfig{}.valid());

struct IjipdaStatus {
    int level = kMaxLevel;     ///< lowest level reached by a row; kMaxLevel when every row is exact
    int limited = 0;           ///< rows the budget kept below the level asked for
    std::uint64_t visits = 0;  ///< candidates visited
};

/// Scratch memory of ijipda.
template <class S>
struct IjipdaWorkspace {
    /// A subtree being evaluated: `track` with the tracks and measurements above it taken.
    struct Node {
        std::uint32_t above = 0;   ///< tracks from the root to here, this one included
        std::uint32_t rivals = 0;  ///< of the current measurement, still to visit
        std::uint8_t track = 0;
        std::uint8_t rival = 0;      ///< the one being visited
        std::uint8_t candidate = 0;  ///< the current measurement
        Weight<S> modulation{};      ///< rho~ / rho of it, so far
        Weight<S> denominator{};     ///< 1 - q psi + sum of q psi p / rho~, so far
    };
    std::array<Node, kMaxTracks> stack;
    std::array<std::array<Weight<S>, kMaxGated>, kMaxTracks> weight;  ///< q psi p / rho
    std::array<Weight<S>, kMaxTracks> without;                        ///< 1 - q psi
    std::array<std::uint32_t, kMaxMeasurements> users;  ///< rows that have the measurement, as bits
    std::array<Weight<S>, kMaxGated> modulation;        ///< of the root's candidates: the level's result
    std::array<Weight<S>, kMaxGated> best;              ///< of the deepest level completed
};

namespace detail {

/// What became of one level of one root.
enum class LevelResult : std::uint8_t {
    exact,      ///< complete, and no branch was cut: deeper levels give the same
    cut,        ///< complete
    exhausted,  ///< the budget ran out; the result is not usable
};

/// Fills work.modulation with rho~ / rho of the root's candidates at `level`. Depth-first with an explicit
/// stack of at most level + 1 nodes.
template <class S>
LevelResult modulate_by_level(std::span<const AssociationRow<S>> rows, std::uint8_t root, int level,
                              std::uint32_t budget, std::uint64_t& visits, IjipdaWorkspace<S>& work) {
    using Node = typename IjipdaWorkspace<S>::Node;
    std::uint64_t taken = 0;  // measurements on the way from the root
    bool cut = false;
    int depth = 0;
    // Enters the current candidate of the node on top; false if the node has none left.
    const auto enter_candidate = [&](Node& node) {
        const AssociationRow<S>& row = rows[node.track];
        while (node.candidate < row.count && (taken >> row.item[node.candidate].measurement & 1) != 0)
            ++node.candidate;
        if (node.candidate >= row.count) return false;
        ++visits;
        node.modulation = weight_of(S(1));
        node.rivals = work.users[row.item[node.candidate].measurement] & ~node.above;
        if (depth >= level && node.rivals != 0) {
            cut = true;
            node.rivals = 0;
        }
        return true;
    };
    const auto weight_in = [&](const Node& node, std::uint16_t measurement) {
        const AssociationRow<S>& row = rows[node.rival];
        std::size_t c = 0;
        while (row.item[c].measurement != measurement) ++c;
        return work.weight[node.rival][c];
    };

    work.stack[0] = {.above = std::uint32_t{1} << root,
                     .rivals = 0,
                     .track = root,
                     .rival = 0,
                     .candidate = 0,
                     .modulation = {},
                     .denominator = {}};
    bool open = enter_candidate(work.stack[0]);
    const std::uint64_t limit = visits + budget;
    while (true) {
        Node& node = work.stack[static_cast<std::size_t>(depth)];
        if (!open) {
            // All candidates of this node are done: its parent learns R = weight / denominator.
            if (depth == 0) break;
            --depth;
            Node& parent = work.stack[static_cast<std::size_t>(depth)];
            const std::uint16_t measurement = rows[parent.track].item[parent.candidate].measurement;
            parent.modulation += weight_in(parent, measurement) / node.denominator;
            taken &= ~(std::uint64_t{1} << measurement);
            open = true;
            continue;
        }
        if (node.rivals != 0) {
            if (visits >= limit) return LevelResult::exhausted;
            const auto rival = static_cast<std::uint8_t>(std::countr_zero(node.rivals));
            node.rivals &= node.rivals - 1;
            node.rival = rival;
            taken |= std::uint64_t{1} << rows[node.track].item[node.candidate].measurement;
            ++depth;
            Node& child = work.stack[static_cast<std::size_t>(depth)];
            child = {.above = node.above | std::uint32_t{1} << rival,
                     .rivals = 0,
                     .track = rival,
                     .rival = 0,
                     .candidate = 0,
                     .modulation = {},
                     .denominator = work.without[rival]};
            open = enter_candidate(child);
            continue;
        }
        if (depth == 0)
            work.modulation[node.candidate] = node.modulation;
        else
            node.denominator += work.weight[node.track][node.candidate] / node.modulation;
        ++node.candidate;
        open = enter_candidate(node);
    }
    return cut ? LevelResult::cut : LevelResult::exact;
}

}  // namespace detail

/// Iterative JIPDA: the IPDA update of every track against a clutter density that holds what the other tracks
/// may take, to a chosen depth of "they in turn have rivals". Rows and existence as in ipda; at most
/// kMaxTracks rows.
///
/// Source: Song, Kim and Musicki 2015; equations 7 to 10 and 16 to 20 of the 2020 paper, with
///     rho~(z; t) = rho(z) (1 + sum_s (p_s(z)/rho(z)) R_s),
///     R_s = q psi_s / (1 - q psi_s + q psi_s sum_n p_s(z_n) / rho~(z_n; s)),
/// s over the tracks not above, n over the measurements not taken above. The page is followed where it and
/// its own derivation agree; its equation 9 prints psi with a bar for the prediction and equation 11 lacks q
/// psi's separation of q (association is conditional on existence), and its sets are garbled.
///
/// Each track deepens its level until that is the level asked for, or every branch has ended (then it is
/// exact JIPDA), or the budget ends; an unfinished level is dropped. So the work is at most rows * budget
/// visits, whatever the clusters, and what was reached is reported.
template <class S>
IjipdaStatus ijipda(std::span<AssociationRow<S>> rows, std::span<S> existence, const IjipdaConfig& config,
                    IjipdaWorkspace<S>& work) {
    IjipdaStatus status;
    work.users.fill(0);
    for (std::size_t t = 0; t < rows.size(); ++t) {
        for (std::size_t c = 0; c < static_cast<std::size_t>(rows[t].count); ++c) {
            work.users[rows[t].item[c].measurement] |= std::uint32_t{1} << t;
            work.weight[t][c] = weight_of(existence[t]) * weight_exp(rows[t].item[c].log_ratio);
        }
        // Never zero: it is divided by when all of a certain target's measurements are taken.
        work.without[t] =
            weight_of(S(1) - existence[t]) + weight_of(existence[t]) * weight_exp(rows[t].log_missed);
        if (!(Weight<S>{} < work.without[t])) work.without[t] = weight_exp(S(-kMaxLogWeight));
    }
    for (std::size_t t = 0; t < rows.size(); ++t) {
        const auto count = static_cast<std::size_t>(rows[t].count);
        const std::uint64_t limit = status.visits + config.budget;
        work.best.fill(weight_of(S(1)));
        int reached = 0;
        while (true) {
            const auto left = static_cast<std::uint32_t>(limit > status.visits ? limit - status.visits : 0);
            const detail::LevelResult result =
                detail::modulate_by_level(std::span<const AssociationRow<S>>(rows),
                                          static_cast<std::uint8_t>(t), reached, left, status.visits, work);
            if (result == detail::LevelResult::exhausted) {
                --reached;
                ++status.limited;
                break;
            }
            work.best = work.modulation;
            if (result == detail::LevelResult::exact) {
                reached = kMaxLevel;
                break;
            }
            if (reached == config.level) break;
            ++reached;
        }
        if (reached < status.level) status.level = reached;
        std::array<Weight<S>, kMaxGated> ratio;
        for (std::size_t c = 0; c < count; ++c)
            ratio[c] = weight_exp(rows[t].item[c].log_ratio) / work.best[c];
        detail::conclude_row<S>(rows[t], existence[t], weight_exp(rows[t].log_missed), {ratio.data(), count});
    }
    return status;
}

}  // namespace tracking
