#include "dsp/dc_levels.hpp"

namespace dsp {

void share_exponent(std::span<std::int16_t, kChirps / 2> exponent) {
    constexpr int kCommonScale = 2;  // bits that a pair gives up for a scale common to the frame
    const std::int16_t highest = *std::ranges::max_element(exponent);
    for (std::int16_t& e : exponent) {
        if (highest - e <= kCommonScale) e = highest;
    }
}

}  // namespace dsp
