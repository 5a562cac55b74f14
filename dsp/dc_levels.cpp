#include "dsp/dc_levels.hpp"

namespace dsp {

void share_exponent(std::span<std::int16_t, kChirps / 2> exponent) {
    constexpr int kCommonScale = 2;  // bits that a pair gives up for a scale common to many
    std::int16_t lowest = exponent[0];
    std::int16_t highest = lowest;
    for (const std::int16_t e : exponent) {
        lowest = std::min(lowest, e);
        highest = std::max(highest, e);
    }
    while (highest - lowest > kCommonScale) {
        const int shared = highest - kCommonScale;
        std::int16_t next = lowest;
        for (std::int16_t& e : exponent) {
            if (e > highest) continue;  // shared already
            if (e >= shared) {
                e = highest;
            } else {
                next = std::max(next, e);
            }
        }
        highest = next;
    }
    for (std::int16_t& e : exponent) e = std::max(e, highest);
}

}  // namespace dsp
