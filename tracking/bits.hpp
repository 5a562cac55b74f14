/// Sets of small numbers as bits.
#pragma once

#include <bit>
#include <cstdint>

namespace tracking {

/// Calls visit(i) for every bit i of `set`, ascending. By halves: a 64-bit count of zeros is a library call
/// on the targets.
template <class Visit>
constexpr void for_each_bit(std::uint64_t set, Visit&& visit) {
    for (std::uint32_t half = 0; half < 2; ++half) {
        for (auto left = static_cast<std::uint32_t>(set >> 32 * half); left != 0; left &= left - 1)
            visit(static_cast<std::uint32_t>(std::countr_zero(left)) + 32 * half);
    }
}

}  // namespace tracking
