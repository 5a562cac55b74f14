/// Joint probabilistic data association: the exact marginals of all one-to-one events, without listing
/// events.
///
/// Source: Fortmann, Bar-Shalom and Scheffe 1983 for the model; the recursion over sets of used tracks is the
/// sum-product form of the Held-Karp / permanent dynamic programme.
///
/// How the work is kept small and fixed point safe, in this order:
///   1. Tracks that share no measurement are independent: each connected component, a cluster, is solved
///   alone.
///   2. A measurement only one track can have restricts nobody. It joins the track's "missed" weight and is
///      split off again at the end, so only shared measurements cost anything.
///   3. All weights are divided by the prices of the best joint event (assignment.hpp). That event and each
///      part of it then weighs 1 and no pair weighs more, so nothing that matters underflows, however small
///      the likelihoods and however many are multiplied.
///   4. The recursion runs over subsets of the smaller side (tracks or shared measurements), one step for
///   each
///      element of the other side.
/// A cluster past the capacity below is solved by loopy belief propagation instead (Williams and Lau 2014):
/// approximate, with a fixed number of sweeps, and counted.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

#include "tracking/assignment.hpp"
#include "tracking/association.hpp"
#include "tracking/scalar.hpp"
#include "tracking/track.hpp"
#include "tracking/wide_sum.hpp"

namespace tracking {

/// How large a cluster is still solved exactly; it costs memory and bounds the work.
struct JpdaCapacity {
    int items = 8;  ///< subsets are taken of at most this many tracks or measurements
    /// steps * 2^items may not exceed this. 3072: 8 tracks with 12 shared measurements, 7 with 24, 6 with 48,
    /// 5 with any.
    int table = 3072;

    [[nodiscard]] constexpr std::size_t sets() const { return std::size_t{1} << items; }
    /// steps * items at most.
    [[nodiscard]] constexpr std::size_t pairs() const {
        int most = 0;
        for (int i = 1; i <= items; ++i) {
            const int steps = (table >> i) < kMaxMeasurements ? table >> i : kMaxMeasurements;
            if (steps * i > most) most = steps * i;
        }
        return static_cast<std::size_t>(most);
    }
};
/// Sweeps of belief propagation over a cluster that does not fit.
inline constexpr int kBeliefSweeps = 12;

/// What was done, for health counters.
struct JpdaStatus {
    int clusters = 0;      ///< that share at least one measurement
    int approximated = 0;  ///< of these, solved by belief propagation
    int largest = 0;       ///< tracks in the largest
};

/// A bipartite graph of weights: `steps` elements of one side, `items` of the other.
template <class S, JpdaCapacity Capacity>
struct JpdaGraph {
    int steps = 0;
    int items = 0;
    std::array<S, Capacity.pairs()> pair{};  ///< [step * items + item]; in: weight, out: probability
    std::array<std::uint16_t, kMaxMeasurements> adjacent{};  ///< per step, items with a pair, as bits
    std::array<S, kMaxMeasurements> step_alone{};            ///< in: weight unmatched, out: probability
    std::array<S, static_cast<std::size_t>(Capacity.items)> item_alone{};
};

/// Scratch memory of jpda, sizeof(JpdaWorkspace<dsp::Real>) = 15.6 KiB, static on the targets.
template <class S, JpdaCapacity Capacity = JpdaCapacity{}>
struct JpdaWorkspace {
    static_assert(Capacity.items <= 16, "adjacent holds them as bits");
    static_assert(std::floating_point<S> || Capacity.items <= 8, "sums over all sets must fit a WideSum");
    static_assert(Capacity.table >= kMaxTracks * kMaxGated, "belief propagation uses it too");
    static constexpr JpdaCapacity kCapacity = Capacity;

    JpdaGraph<S, Capacity> graph;
    Assignment<S> best;
    std::array<S, static_cast<std::size_t>(Capacity.table)> table;  ///< backward weights, [step][set]
    std::array<S, Capacity.sets()> used;                ///< forward weights of the sets of used items
    std::array<S, kMaxTracks> own_weight;               ///< of "missed or a private measurement"
    std::array<S, kMaxTracks> missed_weight;            ///< its part that is "missed", in the same scale
    std::array<std::uint32_t, kMaxMeasurements> users;  ///< rows that have the measurement, as bits
};

namespace detail {

/// Weights this far below a row's best, in nats, are raised to it: past what S can tell from zero, and it
/// keeps sums of prices along a chain of tracks inside the range of S.
template <class S>
S log_floor() {
    return std::floating_point<S> ? S(-600) : S(-48);
}

/// Inputs without end, certain detection or no clutter at all, are taken as very large.
template <class S>
S bounded(S log_weight) {
    const S end = std::floating_point<S> ? S(600) : S(500);
    return log_weight > end ? end : (log_weight < -end ? -end : log_weight);
}

template <class S>
S floored(S log_weight, S top) {
    // The difference itself may saturate.
    return log_weight > top + log_floor<S>() ? log_weight - top : log_floor<S>();
}

/// Divides by 16 until all are at most 32, so that a step cannot saturate and products of two tables fit a
/// WideSum. Only ratios within one table matter.
template <class S>
void rescale(std::span<S> weights) {
    S top = S(0);
    for (const S w : weights)
        if (w > top) top = w;
    for (; top > S(32); top *= constant<S>(1, 16))
        for (S& w : weights) w *= constant<S>(1, 16);
}

/// Replaces the weights of `graph` by marginal probabilities. False if every joint event underflowed.
/// Cost about 3 * 2^items * pairs / 2 multiply-adds.
template <class S, JpdaCapacity Capacity>
bool exact_marginals(JpdaGraph<S, Capacity>& graph, std::span<S> table, std::span<S> used) {
    const int items = graph.items;
    const int steps = graph.steps;
    const std::size_t sets = std::size_t{1} << items;
    const auto backward = [&](int step) {
        return table.subspan(static_cast<std::size_t>(step) * sets, sets);
    };
    const auto weight = [&](int step, int item) -> S& {
        return graph.pair[static_cast<std::size_t>(step * items + item)];
    };

    // backward(k)[U]: weight of everything after step k when the items of U are used.
    std::span<S> last = backward(steps - 1);
    last[sets - 1] = S(1);
    for (std::size_t set = sets - 1; set-- > 0;) {
        const int item = std::countr_one(set);
        last[set] = last[set | (std::size_t{1} << item)] * graph.item_alone[static_cast<std::size_t>(item)];
    }
    for (int k = steps - 1; k > 0; --k) {
        const std::span<S> next = backward(k);
        const std::span<S> here = backward(k - 1);
        const S alone = graph.step_alone[static_cast<std::size_t>(k)];
        for (std::size_t set = 0; set < sets; ++set) {
            WideSum<S> sum;
            sum.add_product(next[set], alone);
            for (std::size_t left = graph.adjacent[static_cast<std::size_t>(k)] & ~set; left != 0;
                 left &= left - 1)
                sum.add_product(next[set | (left & (~left + 1))], weight(k, std::countr_zero(left)));
            here[set] = sum.value();
        }
        rescale(here);
    }

    // used[U]: weight of everything up to step k with exactly U used. Each step's shares are taken of its own
    // total, so the scales of the tables cancel.
    used = used.first(sets);
    used[0] = S(1);
    for (std::size_t set = 1; set < sets; ++set) used[set] = S(0);
    for (int k = 0; k < steps; ++k) {
        const std::span<S> after = backward(k);
        const auto step = static_cast<std::size_t>(k);
        const S alone = graph.step_alone[step];
        const std::size_t adjacent = graph.adjacent[step];
        std::array<S, static_cast<std::size_t>(Capacity.items)> w;
        std::array<WideSum<S>, static_cast<std::size_t>(Capacity.items)> through;
        for (std::size_t left = adjacent; left != 0; left &= left - 1) {
            const auto item = static_cast<std::size_t>(std::countr_zero(left));
            w[item] = weight(k, static_cast<int>(item));
            through[item] = WideSum<S>();
        }
        WideSum<S> past;
        // Descending, so that the sets a set is built from are still those of the step before.
        for (std::size_t set = sets; set-- > 0;) {
            const S next = after[set];
            const S here = used[set];
            WideSum<S> sum;
            sum.add_product(here, alone);
            past.add_product(here, next);
            for (std::size_t left = adjacent & set; left != 0; left &= left - 1) {
                const auto item = static_cast<std::size_t>(std::countr_zero(left));
                const S before = used[set ^ (std::size_t{1} << item)];
                sum.add_product(before, w[item]);
                through[item].add_product(before, next);
            }
            used[set] = sum.value();
        }
        rescale(used);

        past = past.scaled(alone);
        WideSum<S> total = past;
        for (std::size_t left = adjacent; left != 0; left &= left - 1) {
            const auto item = static_cast<std::size_t>(std::countr_zero(left));
            through[item] = through[item].scaled(w[item]);
            total += through[item];
        }
        if (!total.positive()) return false;
        const typename WideSum<S>::Whole whole(total);
        graph.step_alone[step] = past.share(whole);
        for (std::size_t left = adjacent; left != 0; left &= left - 1) {
            const auto item = static_cast<std::size_t>(std::countr_zero(left));
            weight(k, static_cast<int>(item)) = through[item].share(whole);
        }
    }

    std::array<WideSum<S>, static_cast<std::size_t>(Capacity.items)> unused{};
    WideSum<S> total;
    for (std::size_t set = 0; set < sets; ++set) {
        if (used[set] == S(0)) continue;
        WideSum<S> w;
        w.add_product(used[set], last[set]);
        total += w;
        for (std::size_t left = ~set & (sets - 1); left != 0; left &= left - 1)
            unused[static_cast<std::size_t>(std::countr_zero(left))] += w;
    }
    if (!total.positive()) return false;
    const typename WideSum<S>::Whole whole(total);
    for (std::size_t item = 0; item < static_cast<std::size_t>(items); ++item)
        graph.item_alone[item] = unused[item].share(whole);
    return true;
}

/// Belief propagation on the rows of one cluster. In: the beta of shared candidates and `missed` hold
/// weights, `alone` the weight of a measurement nobody takes. Out: probabilities. Every sweep lets each track
/// tell each shared measurement how strongly it claims it against its alternatives, and hear how free of
/// others' claims the measurement is.
template <class S>
void approximate_marginals(std::span<AssociationRow<S>> rows, std::uint32_t cluster,
                           std::uint64_t measurements, const std::array<S, kMaxMeasurements>& alone,
                           std::span<S> claim) {
    const auto is_private = [&](const Candidate<S>& item) {
        return (measurements >> item.measurement & 1) == 0;
    };
    const auto claim_of = [&](std::size_t t, std::size_t c) -> S& { return claim[t * kMaxGated + c]; };
    std::array<WideSum<S>, kMaxMeasurements> claims{};
    for (std::uint32_t left = cluster; left != 0; left &= left - 1) {
        const auto t = static_cast<std::size_t>(std::countr_zero(left));
        for (std::size_t c = 0; c < kMaxGated; ++c) claim_of(t, c) = S(0);
    }
    for (int sweep = 0; sweep <= kBeliefSweeps; ++sweep) {
        std::array<WideSum<S>, kMaxMeasurements> next_claims{};
        for (std::uint32_t left = cluster; left != 0; left &= left - 1) {
            const auto t = static_cast<std::size_t>(std::countr_zero(left));
            AssociationRow<S>& row = rows[t];
            std::array<S, kMaxGated> wish;
            WideSum<S> total(row.missed);
            for (std::size_t c = 0; c < static_cast<std::size_t>(row.count); ++c) {
                const Candidate<S>& item = row.item[c];
                wish[c] = S(0);
                if (is_private(item) || item.beta == S(0)) continue;
                WideSum<S> taken(alone[item.measurement]);
                taken += claims[item.measurement];
                taken -= WideSum<S>(claim_of(t, c));
                wish[c] = item.beta * reciprocal(taken.value());
                total.add(wish[c]);
            }
            if (sweep == kBeliefSweeps) {
                const typename WideSum<S>::Whole whole(total);
                for (std::size_t c = 0; c < static_cast<std::size_t>(row.count); ++c)
                    if (!is_private(row.item[c])) row.item[c].beta = WideSum<S>(wish[c]).share(whole);
                row.missed = WideSum<S>(row.missed).share(whole);
                continue;
            }
            for (std::size_t c = 0; c < static_cast<std::size_t>(row.count); ++c) {
                if (wish[c] == S(0)) continue;
                WideSum<S> rest = total;
                rest -= WideSum<S>(wish[c]);
                claim_of(t, c) = row.item[c].beta * reciprocal(rest.value());
                next_claims[row.item[c].measurement].add(claim_of(t, c));
            }
        }
        claims = next_claims;
    }
}

/// Turns the floored log weights of one cluster (beta of shared candidates, `missed`) into probabilities,
/// using the prices in work.best. False if the result is approximate.
template <class S, JpdaCapacity Capacity>
bool solve_cluster(std::span<AssociationRow<S>> rows, std::uint32_t cluster, std::uint64_t measurements,
                   JpdaWorkspace<S, Capacity>& work) {
    // Weights against the best joint event: at most 1 each, and 1 along that event.
    std::array<S, kMaxMeasurements> alone;
    for (std::uint64_t m = measurements; m != 0; m &= m - 1) {
        const auto j = static_cast<std::size_t>(std::countr_zero(m));
        alone[j] = exp(-work.best.measurement_price[j]);
    }
    for (std::uint32_t c = cluster; c != 0; c &= c - 1) {
        const auto t = static_cast<std::size_t>(std::countr_zero(c));
        AssociationRow<S>& row = rows[t];
        row.missed = exp(row.missed - work.best.row_price[t]);
        for (Candidate<S>& item : row.candidates()) {
            const std::uint16_t j = item.measurement;
            if ((measurements >> j & 1) != 0)
                item.beta = exp(item.beta - work.best.row_price[t] - work.best.measurement_price[j]);
        }
    }

    const int tracks = std::popcount(cluster);
    const int shared = std::popcount(measurements);
    const bool items_are_tracks = tracks <= shared;
    JpdaGraph<S, Capacity>& graph = work.graph;
    graph.items = items_are_tracks ? tracks : shared;
    graph.steps = items_are_tracks ? shared : tracks;
    if (graph.items > Capacity.items || (graph.steps << graph.items) > Capacity.table) {
        approximate_marginals<S>(rows, cluster, measurements, alone, work.table);
        return false;
    }

    // Position of a track or measurement within the cluster: how many come before it.
    const auto position_of = [&](std::uint16_t j) {
        return static_cast<std::size_t>(std::popcount(measurements & ((std::uint64_t{1} << j) - 1)));
    };
    const auto for_each_pair = [&](auto&& visit) {
        std::size_t track = 0;
        for (std::uint32_t c = cluster; c != 0; c &= c - 1, ++track) {
            for (Candidate<S>& item : rows[static_cast<std::size_t>(std::countr_zero(c))].candidates()) {
                if ((measurements >> item.measurement & 1) == 0) continue;
                const std::size_t m = position_of(item.measurement);
                visit(item, items_are_tracks ? m : track, items_are_tracks ? track : m);
            }
        }
    };
    const auto for_each_track = [&](auto&& visit) {
        std::size_t track = 0;
        for (std::uint32_t c = cluster; c != 0; c &= c - 1, ++track)
            visit(rows[static_cast<std::size_t>(std::countr_zero(c))].missed,
                  items_are_tracks ? graph.item_alone[track] : graph.step_alone[track]);
    };
    for (int k = 0; k < graph.steps; ++k) graph.adjacent[static_cast<std::size_t>(k)] = 0;
    for_each_pair([&](const Candidate<S>& item, std::size_t k, std::size_t i) {
        graph.pair[k * static_cast<std::size_t>(graph.items) + i] = item.beta;
        graph.adjacent[k] = static_cast<std::uint16_t>(graph.adjacent[k] | 1U << i);
    });
    for_each_track([](S row_alone, S& in_graph) { in_graph = row_alone; });
    std::size_t position = 0;
    for (std::uint64_t m = measurements; m != 0; m &= m - 1, ++position) {
        const auto j = static_cast<std::size_t>(std::countr_zero(m));
        (items_are_tracks ? graph.step_alone[position] : graph.item_alone[position]) = alone[j];
    }
    if (!exact_marginals<S>(graph, work.table, work.used)) {
        approximate_marginals<S>(rows, cluster, measurements, alone, work.table);
        return false;
    }
    for_each_pair([&](Candidate<S>& item, std::size_t k, std::size_t i) {
        item.beta = graph.pair[k * static_cast<std::size_t>(graph.items) + i];
    });
    for_each_track([](S& row_alone, S in_graph) { row_alone = in_graph; });
    return true;
}

}  // namespace detail

/// Fills beta, missed and the weights of every row with the JPDA marginals of log_ratio and log_missed.
///
/// Double: within 1e-12 of listing all events. dsp::Real: within 2e-3, rows sum to 1 within 1e-3. Certain
/// detection (log_missed = -inf, or the smallest S) and any likelihood are allowed.
/// At most kMaxTracks rows; measurement indices below kMaxMeasurements, ascending within a row.
/// Cost a cluster: exact at most 3 * table * items / 2 of the capacity, by default about 37,000,
/// multiply-adds; approximated 2 * kBeliefSweeps = 24 divisions a pair, at most 12,300 for all 32 x 16 pairs.
template <class S, JpdaCapacity Capacity>
JpdaStatus jpda(std::span<AssociationRow<S>> rows, JpdaWorkspace<S, Capacity>& work) {
    JpdaStatus status;
    work.users.fill(0);
    for (std::size_t t = 0; t < rows.size(); ++t)
        for (const Candidate<S>& c : rows[t].candidates()) work.users[c.measurement] |= std::uint32_t{1} << t;
    const auto is_shared = [&](const Candidate<S>& c) {
        const std::uint32_t users = work.users[c.measurement];
        return (users & (users - 1)) != 0;
    };

    // "Own": what a row can have without asking anybody, missed or one of its private measurements.
    for (std::size_t t = 0; t < rows.size(); ++t) {
        AssociationRow<S>& row = rows[t];
        const S missed = detail::bounded(row.log_missed);
        S own_top = missed;
        S top = missed;
        for (Candidate<S>& c : row.candidates()) {
            c.beta = detail::bounded(c.log_ratio);
            if (c.beta > top) top = c.beta;
            if (!is_shared(c) && c.beta > own_top) own_top = c.beta;
        }
        work.missed_weight[t] = exp(missed - own_top);
        S own = work.missed_weight[t];
        for (Candidate<S>& c : row.candidates()) {
            if (is_shared(c)) {
                c.beta = detail::floored(c.beta, top);
            } else {
                c.beta = exp(c.beta - own_top);
                own += c.beta;
            }
        }
        work.own_weight[t] = own;
        row.missed = detail::floored(own_top + ln(own), top);
    }

    assign_best(
        std::span<const AssociationRow<S>>(rows),
        [&](int t, int c) {
            const Candidate<S>& item = rows[static_cast<std::size_t>(t)].item[static_cast<std::size_t>(c)];
            return is_shared(item) ? item.beta : detail::log_floor<S>();
        },
        [&](int t) { return rows[static_cast<std::size_t>(t)].missed; }, work.best);

    std::uint32_t left = rows.empty() ? 0 : ~std::uint32_t{0} >> (32 - rows.size());
    while (left != 0) {
        // Everybody reachable from the first track left through shared measurements.
        std::uint32_t cluster = 0;
        std::uint64_t measurements = 0;
        std::uint32_t reached = left & (~left + 1);
        while (reached != 0) {
            const auto t = static_cast<std::size_t>(std::countr_zero(reached));
            cluster |= std::uint32_t{1} << t;
            for (const Candidate<S>& c : rows[t].candidates()) {
                if (!is_shared(c)) continue;
                measurements |= std::uint64_t{1} << c.measurement;
                reached |= work.users[c.measurement];
            }
            reached &= ~cluster;
        }
        left &= ~cluster;
        if (measurements == 0) {
            rows[static_cast<std::size_t>(std::countr_zero(cluster))].missed = S(1);
            continue;
        }
        ++status.clusters;
        const int size = std::popcount(cluster);
        if (size > status.largest) status.largest = size;
        if (!detail::solve_cluster(rows, cluster, measurements, work)) ++status.approximated;
    }

    // Split "own" into its parts again.
    for (std::size_t t = 0; t < rows.size(); ++t) {
        AssociationRow<S>& row = rows[t];
        const S own = row.missed * reciprocal(work.own_weight[t]);
        row.missed = own * work.missed_weight[t];
        for (Candidate<S>& c : row.candidates())
            if (!is_shared(c)) c.beta *= own;
        use_betas_as_weights(row);
    }
    return status;
}

}  // namespace tracking
