#include "dsp/range_doppler.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>

#include "dsp/fixed_point.hpp"
#include "dsp/log2.hpp"

namespace dsp {

namespace {
constexpr int kWindowBits = 15;
}

void range_transform(const BeatFrame& frame, const DcLevels& levels, const Window& window,
                     Spectrum& spectrum) {
    for (std::size_t pair = 0; pair < kChirps / 2; ++pair) {
        std::array<std::array<std::int16_t, kSamples>, 2> samples;
        for (std::size_t i = 0; i < 2; ++i) {
            const std::size_t chirp = 2 * pair + i;
            remove_dc(frame.chirp[chirp], levels.sum[chirp], levels.exponent[pair], samples[i]);
        }
        Spectrum64 z;
        for (std::size_t n = 0; n < kSamples; ++n) {
            z[n] = {static_cast<std::int16_t>(round_shift(samples[0][n] * window[n], kWindowBits)),
                    static_cast<std::int16_t>(round_shift(samples[1][n] * window[n], kWindowBits))};
        }
        std::array<Complex16, kRangeCells> even;
        std::array<Complex16, kRangeCells> odd;
        const int exponent = fft64_real_pair(z, even, odd);
        spectrum.chirp_exponent[pair] = static_cast<std::int16_t>(exponent + levels.exponent[pair]);
        for (std::size_t r = 0; r < kRangeCells; ++r) {
            spectrum.row[r][2 * pair] = even[r];
            spectrum.row[r][2 * pair + 1] = odd[r];
        }
    }
}

void doppler_transform(Spectrum& spectrum, const Window& window, int range_cell) {
    auto& row = spectrum.row[static_cast<std::size_t>(range_cell)];
    std::int16_t& row_exponent = spectrum.row_exponent[static_cast<std::size_t>(range_cell)];
    const int highest = *std::ranges::max_element(spectrum.chirp_exponent);

    // Q15 products at the common exponent, then as many bits as the row's largest allows.
    struct Product {
        std::int32_t re;
        std::int32_t im;
    };
    std::array<Product, kChirps> product;
    std::uint32_t magnitude = 0;
    for (std::size_t k = 0; k < kChirps; ++k) {
        const int down = std::min(highest - spectrum.chirp_exponent[k / 2], 31);
        product[k] = {round_shift(row[k].re * window[k], down), round_shift(row[k].im * window[k], down)};
        magnitude |= static_cast<std::uint32_t>(product[k].re ^ (product[k].re >> 31));
        magnitude |= static_cast<std::uint32_t>(product[k].im ^ (product[k].im >> 31));
    }
    const int shift = std::max(static_cast<int>(std::bit_width(magnitude)) - 15, 0);
    for (std::size_t k = 0; k < kChirps; ++k) {
        row[k] = {saturate16(round_shift(product[k].re, shift)),
                  saturate16(round_shift(product[k].im, shift))};
    }
    row_exponent = static_cast<std::int16_t>(fft64(row) + shift - kWindowBits + highest);
}

void log_power(std::span<const Complex16, kDopplerCells> row, int exponent,
               std::span<std::uint16_t, kDopplerCells> power) {
    for (std::size_t d = 0; d < kDopplerCells; ++d) {
        const std::int32_t re = row[d].re;
        const std::int32_t im = row[d].im;
        const auto square = static_cast<std::uint32_t>(re * re) + static_cast<std::uint32_t>(im * im);
        const std::int32_t level = square == 0 ? 0 : log2_q10(square) + 2 * exponent * kLogOne;
        power[d] = static_cast<std::uint16_t>(std::max<std::int32_t>(level, 0));
    }
}

void range_doppler(const BeatFrame& frame, WindowKind range_window, WindowKind doppler_window,
                   Spectrum& spectrum, PowerMap& map) {
    range_transform(frame, dc_levels(frame), window(range_window), spectrum);
    for (std::size_t r = 0; r < kRangeCells; ++r) {
        doppler_transform(spectrum, window(doppler_window), static_cast<int>(r));
        log_power(spectrum.row[r], spectrum.row_exponent[r], map.cell[r]);
    }
}

}  // namespace dsp
