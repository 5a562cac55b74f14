#include "dsp/dc_removal.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>

#include "dsp/fixed_point.hpp"
#include "dsp/packed.hpp"
#include "dsp/unrolled.hpp"

namespace dsp {

namespace {

constexpr int kCommonScale = 2;  ///< bits that a pair gives up for a scale common to the frame

}  // namespace

void share_exponent(std::span<std::int16_t, kChirps / 2> exponent) {
    const std::int16_t highest = *std::ranges::max_element(exponent);
    for (std::int16_t& e : exponent) {
        if (highest - e <= kCommonScale) e = highest;
    }
}

}  // namespace dsp
