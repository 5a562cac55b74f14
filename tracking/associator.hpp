/// The data association methods of the radar behind one call, and their names.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <type_traits>

#include "tracking/association.hpp"
#include "tracking/existence.hpp"
#include "tracking/ihpda.hpp"
#include "tracking/ijipda.hpp"
#include "tracking/ipda.hpp"
#include "tracking/jipda.hpp"
#include "tracking/jpda.hpp"
#include "tracking/lm_ipda.hpp"
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
    // Those below weigh every track by the probability that its target exists.
    ipda,      ///< integrated PDA, each track for itself
    lm_ipda,   ///< linear multi-target IPDA: the others' measurements are clutter
    jipda,     ///< joint integrated PDA, exact
    ijipda,    ///< iterative JIPDA, between IPDA and JIPDA by level
    ihpda,     ///< integrated highest probability data association, each track for itself
    jihpda,    ///< IHPDA with the optimal assignment
    lm_ihpda,  ///< IHPDA with the linear multi-target betas and greedy assignment
    imm_pdaf,  ///< interacting multiple models with PDA, each track for itself; done by the tracker
};

/// By the value of Associator.
inline constexpr std::array<std::string_view, 13> kAssociatorNames{
    "nn",    "pda",    "ospda", "jpda",   "osjpda",   "ipda",    "lm-ipda",
    "jipda", "ijipda", "ihpda", "jihpda", "lm-ihpda", "imm-pdaf"};

/// The associators of this program are those up to kLastAssociator. A build for a small memory leaves out the
/// ones behind it, their code and their scratch memory, by the macro.
#ifdef RADAR_LAST_ASSOCIATOR
inline constexpr Associator kLastAssociator = Associator::RADAR_LAST_ASSOCIATOR;
#else
inline constexpr auto kLastAssociator = static_cast<Associator>(kAssociatorNames.size() - 1);
#endif
inline constexpr bool kHasJoint = kLastAssociator >= Associator::jpda;
inline constexpr bool kHasExistence = kLastAssociator >= Associator::ipda;
inline constexpr bool kHasModes = kLastAssociator >= Associator::imm_pdaf;

/// Needs signal strengths and RankInput.
constexpr bool uses_rank(Associator a) {
    return kHasExistence && (a == Associator::ihpda || a == Associator::jihpda || a == Associator::lm_ihpda);
}

constexpr std::string_view name_of(Associator a) {
    return kAssociatorNames[static_cast<std::size_t>(a)];
}

constexpr std::optional<Associator> associator_named(std::string_view name) {
    for (std::size_t i = 0; i < kAssociatorNames.size(); ++i) {
        if (kAssociatorNames[i] == name) return static_cast<Associator>(i);
    }
    return std::nullopt;
}

/// As on a command line: a name, and for ijipda the level after a colon, `ijipda:2`.
struct AssociatorChoice {
    Associator associator = Associator::ospda;
    std::optional<int> level;
};
constexpr std::optional<AssociatorChoice> associator_chosen(std::string_view text) {
    const std::size_t colon = text.find(':');
    std::string_view name = text;  // substr() can throw, and images hold no exceptions
    if (colon != std::string_view::npos) name.remove_suffix(text.size() - colon);
    const std::optional<Associator> associator = associator_named(name);
    if (!associator) return std::nullopt;
    if (colon == std::string_view::npos) return AssociatorChoice{*associator, std::nullopt};
    if (*associator != Associator::ijipda) return std::nullopt;
    int level = 0;
    std::string_view digits = text;
    digits.remove_prefix(colon + 1);
    if (digits.empty() || digits.size() > 2) return std::nullopt;
    for (const char c : digits) {
        if (c < '0' || c > '9') return std::nullopt;
        level = 10 * level + (c - '0');
    }
    if (level > kMaxLevel) return std::nullopt;
    return AssociatorChoice{*associator, level};
}

/// From log ratios to betas, weights and evidence of all rows, of the associators that need no existence.
/// `work`, JpdaWorkspace<S>, is touched by jpda and osjpda only; without them it may be anything.
template <class S, class Workspace>
JpdaStatus associate(std::span<AssociationRow<S>> rows, Associator associator,
                     const OrderStatisticsConfig<S>& order, Workspace& work) {
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
            if constexpr (kHasJoint) status = jpda(rows, work);
            break;
        case Associator::osjpda:
            if constexpr (kHasJoint) status = jpda(rows, work);
            order_statistics(rows, order);
            break;
        default:
            break;
    }
    return status;
}

/// What the rows alone do not say.
template <class S>
struct AssociationInput {
    std::span<S> existence;              ///< one a row; predicted, becomes updated
    std::span<const S> strength;         ///< one a measurement, if uses_rank()
    std::span<const RankInput<S>> rank;  ///< one a row, if uses_rank()
};

/// Scratch memory of associate(), sizeof(AssociatorWorkspace<dsp::Real>) = 34 KiB, static on the targets.
template <class S>
struct AssociatorWorkspace {
    struct None {};
    std::conditional_t<kHasJoint, JpdaWorkspace<S>, None> jpda;
    std::conditional_t<kHasExistence, IjipdaWorkspace<S>, None> ijipda;
    std::conditional_t<kHasExistence, IhpdaWorkspace<S>, None> ihpda;
};

struct AssociationStatus {
    int approximated = 0;  ///< clusters too large for exact JPDA or JIPDA
    int limited = 0;       ///< rows that did not reach the level of iterative JIPDA asked for
};

/// Those of associate() that weigh by existence.
template <class S>
AssociationStatus associate_by_existence(std::span<AssociationRow<S>> rows, const AssociationInput<S>& input,
                                         Associator associator, const IjipdaConfig& iterative,
                                         AssociatorWorkspace<S>& work) {
    AssociationStatus status;
    switch (associator) {
        case Associator::ipda:
        case Associator::imm_pdaf:
            ipda(rows, input.existence);
            break;
        case Associator::lm_ipda:
            lm_ipda(rows, input.existence, work.ihpda.linear);
            break;
        case Associator::jipda:
            status.approximated = jipda(rows, input.existence, work.jpda).approximated;
            break;
        case Associator::ijipda:
            status.limited = ijipda(rows, input.existence, iterative, work.ijipda).limited;
            break;
        case Associator::ihpda:
            ihpda(rows, input.existence, input.strength, input.rank, {.sharing = Sharing::ignored},
                  work.ihpda);
            break;
        case Associator::jihpda:
            ihpda(rows, input.existence, input.strength, input.rank, {.sharing = Sharing::optimal},
                  work.ihpda);
            break;
        case Associator::lm_ihpda:
            ihpda(rows, input.existence, input.strength, input.rank,
                  {.sharing = Sharing::greedy, .modulated = true}, work.ihpda);
            break;
        default:
            break;
    }
    return status;
}

/// From log ratios to betas and weights of all rows, and their existence. Any associator; imm_pdaf is PDA
/// here.
template <class S>
AssociationStatus associate(std::span<AssociationRow<S>> rows, const AssociationInput<S>& input,
                            Associator associator, const OrderStatisticsConfig<S>& order,
                            const IjipdaConfig& iterative, AssociatorWorkspace<S>& work) {
    if constexpr (kHasExistence) {
        if (associator >= Associator::ipda)
            return associate_by_existence(rows, input, associator, iterative, work);
    }
    AssociationStatus status;
    status.approximated = associate(rows, associator, order, work.jpda).approximated;
    for (std::size_t t = 0; t < rows.size(); ++t)
        input.existence[t] = updated_existence(input.existence[t], rows[t].log_evidence);
    return status;
}

/// The one the firmware uses is compiled once, in associator.cpp.
extern template AssociationStatus associate(std::span<AssociationRow<dsp::Real>>,
                                            const AssociationInput<dsp::Real>&, Associator,
                                            const OrderStatisticsConfig<dsp::Real>&, const IjipdaConfig&,
                                            AssociatorWorkspace<dsp::Real>&);

}  // namespace tracking
