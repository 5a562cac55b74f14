/// The data association methods of the radar behind one call, and their names.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "tracking/association.hpp"
#include "tracking/jpda.hpp"
#include "tracking/nearest_neighbour.hpp"
#include "tracking/order_statistics.hpp"
#include "tracking/pda.hpp"

namespace tracking {

/// How measurements are shared out among tracks.
enum class Associator : std::uint8_t {
    nn,      ///< nearest neighbour, each track for itself
    pda,     ///< probabilistic data association, each track for itself
    ospda,   ///< order statistics over PDA
    jpda,    ///< joint probabilistic data association, exact
    osjpda,  ///< order statistics over JPDA
};

/// By the value of Associator.
inline constexpr std::array<std::string_view, 5> kAssociatorNames{"nn", "pda", "ospda", "jpda", "osjpda"};

constexpr std::string_view name_of(Associator a) {
    return kAssociatorNames[static_cast<std::size_t>(a)];
}

constexpr std::optional<Associator> associator_named(std::string_view name) {
    for (std::size_t i = 0; i < kAssociatorNames.size(); ++i) {
        if (kAssociatorNames[i] == name) return static_cast<Associator>(i);
    }
    return std::nullopt;
}

/// From log ratios to betas, weights and evidence of all rows. `work` is touched by jpda and osjpda only.
template <class S>
JpdaStatus associate(std::span<AssociationRow<S>> rows, Associator associator,
                     const OrderStatisticsConfig<S>& order, JpdaWorkspace<S>& work) {
    JpdaStatus status;
    pda(rows);
    switch (associator) {
        case Associator::nn:
            nearest_neighbour(rows);
            break;
        case Associator::pda:
            break;
        case Associator::ospda:
            order_statistics(rows, order);
            break;
        case Associator::jpda:
            status = jpda(rows, work);
            break;
        case Associator::osjpda:
            status = jpda(rows, work);
            order_statistics(rows, order);
            break;
    }
    return status;
}

}  // namespace tracking
