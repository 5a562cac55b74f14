/// The best one-to-one assignment of measurements to tracks, each track free to stay without one.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "tracking/association.hpp"
#include "tracking/scratch.hpp"
#include "tracking/track.hpp"

namespace tracking {

static_assert(kMaxMeasurements <= 64 && kMaxTracks <= 32, "sets of them are held as bits");

/// Which measurement each track gets. `owner` means something for measurements that are candidates of a row.
struct Matching {
    static constexpr int kNone = -1;

    std::array<std::int8_t, kMaxTracks> candidate;    ///< of every row, index into its candidates, or kNone
    std::array<std::int8_t, kMaxMeasurements> owner;  ///< row that got the measurement, or kNone

    /// Nobody gets anything.
    template <class S>
    void clear(std::span<const AssociationRow<S>> rows) {
        for (std::size_t t = 0; t < rows.size(); ++t) {
            candidate[t] = kNone;
            for (const Candidate<S>& c : rows[t].candidates()) owner[c.measurement] = kNone;
        }
    }
    template <class S>
    void claim(std::size_t row, int item, const AssociationRow<S>& r) {
        candidate[row] = static_cast<std::int8_t>(item);
        owner[r.item[static_cast<std::size_t>(item)].measurement] = static_cast<std::int8_t>(row);
    }
};

/// And the prices that prove it optimal: for every row t and candidate c of measurement j
///     weight(t, c) <= row_price[t] + measurement_price[j],   missed_weight(t) <= row_price[t],
/// with equality on the pairs of the assignment, measurement_price >= 0, and 0 for what nobody got.
template <class S>
struct Assignment : Matching {
    Scratch<S, kMaxTracks> row_price;
    Scratch<S, kMaxMeasurements> measurement_price;  ///< as for owner
};

/// Maximises the sum of `weight(t, c)` over the assigned pairs plus `missed_weight(t)` over the other rows.
///
/// Successive shortest augmenting paths with prices (the Hungarian method), rows in order; a tie goes to the
/// lower measurement index. Fixed point is exact while the weights along a chain of competing tracks sum up
/// inside the range of S; past that the result is still one-to-one but may not be the best.
/// At most kMaxTracks rows, measurement indices below kMaxMeasurements. Cost: a row whose best measurement is
/// free is one pass over its candidates; otherwise one more such pass for every track it competes with.
template <class S, class Weight, class MissedWeight>
void assign_best(std::span<const AssociationRow<S>> rows, Weight weight, MissedWeight missed_weight,
                 Assignment<S>& out) {
    constexpr auto kNone = static_cast<std::int8_t>(Matching::kNone);
    struct Reached {
        S loss;                 ///< by the best chain of rows that give way and end in this measurement
        std::int8_t row;        ///< last row of that chain
        std::int8_t candidate;  ///< which of its candidates the measurement is
        bool settled;           ///< its owner was asked to give way
        std::int8_t for_row;    ///< the new row for which all this was written
    };
    Scratch<Reached, kMaxMeasurements> reached;
    std::array<std::uint8_t, kMaxMeasurements> open;  // measurements reached, in the order they were

    for (std::size_t t = 0; t < rows.size(); ++t) {
        out.candidate[t] = kNone;
        for (const Candidate<S>& c : rows[t].candidates()) {
            const std::uint16_t j = c.measurement;  // bytes may alias it
            out.owner[j] = kNone;
            out.measurement_price[j] = S(0);
            reached[j].for_row = kNone;
        }
    }
    const auto measurement_of = [&](int row, int c) {
        return rows[static_cast<std::size_t>(row)].item[static_cast<std::size_t>(c)].measurement;
    };

    const int row_count = static_cast<int>(rows.size());
    for (int start = 0; start < row_count; ++start) {
        const S missed = missed_weight(start);
        const int count = rows[static_cast<std::size_t>(start)].count;
        const auto gain = [&](int c) {
            return S(weight(start, c) - out.measurement_price[measurement_of(start, c)]);
        };
        int favourite = 0;
        S price = count > 0 ? gain(0) : missed;
        for (int c = 1; c < count; ++c) {
            const S other = gain(c);
            if (!(other > price)) continue;
            favourite = c;
            price = other;
        }
        if (count == 0 || price < missed) {
            out.row_price[static_cast<std::size_t>(start)] = missed;
            continue;
        }
        out.row_price[static_cast<std::size_t>(start)] = price;
        if (out.owner[measurement_of(start, favourite)] == kNone) {
            out.claim(static_cast<std::size_t>(start), favourite, rows[static_cast<std::size_t>(start)]);
            continue;
        }

        std::size_t open_count = 0;
        S loss = S(0);
        S loser_loss = S(0);
        int loser = kNone;  // the row that could go without at the least loss
        int row = start;
        int found = kNone;  // a measurement nobody owns
        while (found == kNone) {
            const auto t = static_cast<std::size_t>(row);
            const S without = loss + (out.row_price[t] - missed_weight(row));
            if (loser == kNone || without < loser_loss) {
                loser_loss = without;
                loser = row;
            }
            for (int c = 0; c < rows[t].count; ++c) {
                const std::uint16_t j = measurement_of(row, c);
                const bool known = reached[j].for_row == start;
                if (known && reached[j].settled) continue;
                const S next = loss + (out.row_price[t] + out.measurement_price[j] - weight(row, c));
                if (known && next >= reached[j].loss) continue;
                if (!known) open[open_count++] = static_cast<std::uint8_t>(j);
                reached[j] = {next, static_cast<std::int8_t>(row), static_cast<std::int8_t>(c), false,
                              static_cast<std::int8_t>(start)};
            }
            int cheapest = kNone;
            for (const std::uint8_t j : std::span(open).first(open_count)) {
                if (reached[j].settled) continue;
                if (cheapest != kNone) {
                    const S least = reached[static_cast<std::size_t>(cheapest)].loss;
                    if (reached[j].loss > least || (reached[j].loss == least && j > cheapest)) continue;
                }
                cheapest = j;
            }
            if (cheapest == kNone || loser_loss < reached[static_cast<std::size_t>(cheapest)].loss) break;
            loss = reached[static_cast<std::size_t>(cheapest)].loss;
            const int owner = out.owner[static_cast<std::size_t>(cheapest)];
            if (owner == kNone) {
                found = cheapest;
            } else {
                reached[static_cast<std::size_t>(cheapest)].settled = true;
                row = owner;
            }
        }
        const S end_loss = found == kNone ? loser_loss : loss;

        // The rows on the way accept less; what they compete for costs that much more.
        for (const std::uint8_t j : std::span(open).first(open_count)) {
            if (!reached[j].settled) continue;
            const S raise = end_loss - reached[j].loss;
            out.measurement_price[j] += raise;
            out.row_price[static_cast<std::size_t>(out.owner[j])] -= raise;
        }
        out.row_price[static_cast<std::size_t>(start)] -= end_loss;

        // Hand the measurements down the chain, from its end back to the new row.
        int next = found;
        const auto give_up = [&](int from) {
            const int c = out.candidate[static_cast<std::size_t>(from)];
            return c == kNone ? Matching::kNone : static_cast<int>(measurement_of(from, c));
        };
        if (found == kNone) {
            next = give_up(loser);
            out.candidate[static_cast<std::size_t>(loser)] = kNone;
        }
        while (next != kNone) {
            const Reached& at = reached[static_cast<std::size_t>(next)];
            const int freed = give_up(at.row);
            out.candidate[static_cast<std::size_t>(at.row)] = at.candidate;
            out.owner[static_cast<std::size_t>(next)] = at.row;
            next = freed;
        }
    }
}

}  // namespace tracking
