/// Tapers for the two transforms, made at compile time.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "dsp/sine.hpp"

namespace dsp {

inline constexpr int kWindowLength = 64;

/// Q15, scaled by 32767/32768 so that a coefficient of one fits.
using Window = std::array<std::int16_t, kWindowLength>;

/// All periodic (the DFT-even form): the spectrum of a Hann window is then exactly three cells wide.
/// Trade-off: main lobe width against sidelobes (highest: -13, -31, -43, -58 dB).
enum class WindowKind : std::uint8_t { rectangular, hann, hamming, blackman };

/// sum_j (-1)^j a_j cos(2 pi j n / 64) with a_j in parts per 10,000.
constexpr Window make_window(WindowKind kind) {
    constexpr std::array<std::array<int, 3>, 4> kCosines{
        {{10000, 0, 0}, {5000, 5000, 0}, {5400, 4600, 0}, {4200, 5000, 800}}};
    const auto& a = kCosines[static_cast<std::size_t>(kind)];
    Window window{};
    for (int n = 0; n < kWindowLength; ++n) {
        const std::int64_t sum = a[0] * (std::int64_t{1} << 30) -
                                 a[1] * std::int64_t{cosine_q30(n, kWindowLength)} +
                                 a[2] * std::int64_t{cosine_q30(2 * n, kWindowLength)};
        window[static_cast<std::size_t>(n)] = static_cast<std::int16_t>(
            round_divide<std::int64_t>(round_shift(sum, 10) * 32767, 10000 * (std::int64_t{1} << 20)));
    }
    return window;
}

/// By WindowKind.
inline constexpr std::array<Window, 4> kWindows{
    make_window(WindowKind::rectangular), make_window(WindowKind::hann), make_window(WindowKind::hamming),
    make_window(WindowKind::blackman)};

constexpr const Window& window(WindowKind kind) {
    return kWindows[static_cast<std::size_t>(kind)];
}

}  // namespace dsp
