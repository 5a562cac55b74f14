#include "dsp/range_doppler.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>

#include "dsp/fixed_point.hpp"
#include "dsp/log2.hpp"
#include "dsp/packed.hpp"
#include "dsp/unrolled.hpp"

namespace dsp {

namespace {

using packed::Pair;

constexpr int kWindowBits = 15;

/// Windows that add up to more than one over half their length (rectangular, Hamming) leave one bit less to
/// the data.
int guard_bits(const Window& window) {
    return window[0] + window[kWindowLength / 2] > (1 << kWindowBits) ? 1 : 0;
}

int magnitude_bits(std::span<const Complex16, kChirps> row) {
    Pair spreads = 0;
    unrolled<kChirps, 1, 8>([&](std::size_t k) { spreads |= packed::spread(std::bit_cast<Pair>(row[k])); });
    return packed::magnitude_bits(spreads);
}

/// The window, and `down` bits less, for chirps of the same exponent.
void taper(std::span<Complex16, kChirps> row, const Window& window, int down) {
    const int shift = kWindowBits + down;  // at least 4: a row has at least one bit
    const std::int32_t rounding = (1 << shift) >> 1;
    unrolled<kChirps, 2, 2>([&](std::size_t k) {
        const Pair x = std::bit_cast<Pair>(row[k]);
        const Pair y = std::bit_cast<Pair>(row[k + 1]);
        const Pair w = packed::load(&window[k]);
        row[k] = std::bit_cast<Complex16>(packed::pack_low(packed::multiply_00(x, w, rounding) >> shift,
                                                           packed::multiply_10(x, w, rounding) >> shift));
        row[k + 1] = std::bit_cast<Complex16>(packed::pack_low(packed::multiply_01(y, w, rounding) >> shift,
                                                               packed::multiply_11(y, w, rounding) >> shift));
    });
}

/// Whether no chirp has an exponent of its own.
bool even(const std::array<std::int16_t, kChirps / 2>& exponent) {
    const Pair first = packed::both(static_cast<std::uint16_t>(exponent[0]));
    Pair different = 0;
    unrolled<kChirps / 2, 2, 8>([&](std::size_t i) { different |= packed::load(&exponent[i]) ^ first; });
    return different == 0;
}

/// The same for chirps of different exponents, value = row * 2^exponent: as many bits as the row's largest
/// allows. Returns by how many bits the row became smaller, relative to 2^highest.
int taper_uneven(std::span<Complex16, kChirps> row, const std::array<std::int16_t, kChirps / 2>& exponent,
                 int highest, const Window& window, int guard) {
    constexpr int kExtraBits =
        15;  // a small chirp beside a burst keeps its own precision until the scale is known
    const auto down_of = [&](std::size_t k) { return std::min(highest - exponent[k / 2], 31); };
    std::uint32_t magnitude = 1;
    for (std::size_t k = 0; k < kChirps; ++k) {
        for (const std::int32_t x : {row[k].re, row[k].im}) {
            magnitude |= static_cast<std::uint32_t>(x ^ (x >> 31)) << kExtraBits >> down_of(k);
        }
    }
    const int down = static_cast<int>(std::bit_width(magnitude)) - kExtraBits - kFftInputBits + guard;
    for (std::size_t k = 0; k < kChirps; ++k) {
        const int shift = kWindowBits + down_of(k) + down;
        const auto scale = [&](std::int32_t x) {
            const std::int64_t product = std::int64_t{x} * window[k];
            return static_cast<std::int16_t>(shift >= 0 ? round_shift(product, std::min(shift, 62))
                                                        : product * (std::int64_t{1} << -shift));
        };
        row[k] = {scale(row[k].re), scale(row[k].im)};
    }
    return down;
}

}  // namespace

static_assert(kChirps == kFftLength);

void range_transform(const BeatFrame& frame, const DcLevels& levels, const Window& window,
                     Spectrum& spectrum) {
    const int guard = guard_bits(window);
    for (std::size_t pair = 0; pair < kChirps / 2; ++pair) {
        const std::size_t k = 2 * pair;
        const int exponent = levels.exponent[pair] + guard;
        Spectrum64 z;
        remove_dc(frame.chirp[k], levels.sum[k], frame.chirp[k + 1], levels.sum[k + 1], exponent, window, z);
        fft64_real_pair(z, &spectrum.row[0][k]);
        // remove_dc rounds down: half a step in each of 64 samples is eight in the sum, and in cell 0 alone.
        for (std::size_t i = k; i < k + 2; ++i) {
            spectrum.row[0][i].re = static_cast<std::int16_t>(spectrum.row[0][i].re + 8);
        }
        spectrum.chirp_exponent[pair] = static_cast<std::int16_t>(exponent + kFftPairExponent);
    }
}

void doppler_transform(Spectrum& spectrum, const Window& window, int range_cell) {
    auto& row = spectrum.row[static_cast<std::size_t>(range_cell)];
    const int guard = guard_bits(window);
    int highest = spectrum.chirp_exponent[0];
    int down = 0;
    if (even(spectrum.chirp_exponent)) {
        down = magnitude_bits(row) - kFftInputBits + guard;
        taper(row, window, down);
    } else {
        highest = *std::ranges::max_element(spectrum.chirp_exponent);
        down = taper_uneven(row, spectrum.chirp_exponent, highest, window, guard);
    }
    fft64(row);
    spectrum.row_exponent[static_cast<std::size_t>(range_cell)] =
        static_cast<std::int16_t>(highest + down + kFftExponent);
}

void log_power(std::span<const Complex16, kDopplerCells> row, int exponent,
               std::span<std::uint16_t, kDopplerCells> power) {
    const std::int32_t scale = 2 * exponent * kLogOne;
    unrolled<kDopplerCells, 1, 4>([&](std::size_t d) {
        const Pair x = std::bit_cast<Pair>(row[d]);
        const auto square = static_cast<std::uint32_t>(packed::dot(x, x, 0));  // at most 2^31
        power[d] = static_cast<std::uint16_t>(std::max<std::int32_t>(log2_coarse_q10(square, scale), 0));
    });
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
