#include "dsp/range_doppler.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <limits>

#include "dsp/fixed_point.hpp"
#include "dsp/frame_quality.hpp"
#include "dsp/log2.hpp"
#include "dsp/packed.hpp"
#include "dsp/packed_x86.hpp"
#include "dsp/range_fft.hpp"
#include "dsp/unrolled.hpp"

namespace dsp {

namespace {

using packed::Pair;

constexpr int kWindowBits = 15;
/// Rows scaled by 2^-1 or more find their numbers in the lower half of products, others in the upper half.
constexpr int kLowerHalf = 1;

/// Windows that add up to more than one over half their length (rectangular, Hamming) leave one bit less to
/// the data.
int guard_bits(const Window& window) {
    return window[0] + window[kWindowLength / 2] > (1 << kWindowBits) ? 1 : 0;
}

/// Of all numbers of a row.
int magnitude_bits(const Complex16* row) {
    using packed::spread;
    Pair spreads = 0;
    const Complex16* const end = row + kChirps;
    do {
        const auto [a, b, c, d, e, f, g, h] = packed::take_8(row);
        spreads |= spread(a) | spread(b) | spread(c) | spread(d);
        spreads |= spread(e) | spread(f) | spread(g) | spread(h);
    } while (row != end);
    return packed::magnitude_bits(spreads);
}

/// The same of chirps that are smaller by their number of bits; at least 1.
[[gnu::noinline]] int magnitude_bits(const Complex16* row, const std::uint8_t* smaller) {
    constexpr int kUp = 16;  // both lanes, one over the other, in the upper half: nothing is lost below
    std::uint32_t spreads = 2U << kUp;
    unrolled<kChirps, 2, 4>([row, smaller, &spreads](std::size_t k) {
        Pair x = 0;
        Pair y = 0;
        packed::load_pair(&row[k], x, y);
        const Pair spread = packed::spread(x) | packed::spread(y);
        spreads |= (spread | spread << kUp) >> smaller[k / 2];
    });
    return static_cast<int>(std::bit_width(spreads >> kUp)) - 1;
}

template <bool kUpperHalf>
Pair product(Pair x, Pair weight) {
    const std::int32_t re = packed::scale_0(static_cast<std::int32_t>(weight), x);
    const std::int32_t im = packed::scale_1(static_cast<std::int32_t>(weight), x);
    return kUpperHalf ? packed::pack_high(re, im) : packed::pack_low(re, im);
}

template <bool kUpperHalf>
inline void scale_four(Complex16*& row, const std::int32_t*& weight) {
    Pair a = 0;
    Pair b = 0;
    Pair c = 0;
    Pair d = 0;
    Pair wa = 0;
    Pair wb = 0;
    Pair wc = 0;
    Pair wd = 0;
    packed::take_four_beside(weight, wa, wb, wc, wd);
    packed::load_four(row, a, b, c, d);
    packed::put_four(row, product<kUpperHalf>(a, wa), product<kUpperHalf>(b, wb), product<kUpperHalf>(c, wc),
                     product<kUpperHalf>(d, wd));
}

/// row[k] = row[k] * weight[k] / 2^16, or / 2^32, rounded down.
template <bool kUpperHalf>
void scale(Complex16* row, const std::int32_t* weight) {
#if DSP_PACKED_FOUR
    if constexpr (!kUpperHalf) {
        for (std::size_t k = 0; k < kChirps; k += 4) {
            const packed::Quad cells = packed::load_quad(&row[k].re);
            packed::store_quad(&row[k].re, packed::scale_words(cells, packed::load_sums(&weight[k])));
        }
        return;
    }
#endif
    const std::int32_t* const end = packed::in_register(weight + kChirps);
    do {
        scale_four<kUpperHalf>(row, weight);
        scale_four<kUpperHalf>(row, weight);
        if constexpr (kUpperHalf) continue;  // seldom
        scale_four<kUpperHalf>(row, weight);
        scale_four<kUpperHalf>(row, weight);
    } while (weight != end);
}

/// to[k] = from[k] / 2^shift, rounded down; none is negative.
[[gnu::noinline]] void shift_right(const std::int32_t* from, int shift, std::int32_t* to) {
    const std::int32_t* const end = from + kChirps;
    do {
        Pair a = 0;
        Pair b = 0;
        Pair c = 0;
        Pair d = 0;
        packed::take_four(from, a, b, c, d);
        packed::put_four(to, a >> shift, b >> shift, c >> shift, d >> shift);
    } while (from != end);
}

inline void log_power_of_four(const Complex16*& from, Pair bias, std::uint16_t*& to) {
    Pair a = 0;
    Pair b = 0;
    Pair c = 0;
    Pair d = 0;
    packed::take_four(from, a, b, c, d);
    const auto square = [](Pair x) { return static_cast<std::uint32_t>(packed::dot(x, x, 0)); };  // <= 2^31
    const Pair first = log2_coarse_q10(square(a), square(b), bias);
    packed::put_pair(to, first, log2_coarse_q10(square(c), square(d), bias));
}

}  // namespace

static_assert(kChirps == kFftLength);

void range_transform(const BeatFrame& frame, const DcLevels& levels, const Window& window,
                     Spectrum& spectrum) {
    const int guard = guard_bits(window);
    for (std::size_t first = 0; first < kChirps;) {
        // As many as share an exponent: all of them, as a rule.
        const std::int16_t deviation = levels.exponent[first / 2];
        const RangeWindow weights(window, deviation + guard);
        std::size_t end = first;
        do {
            spectrum.chirp_exponent[end / 2] =
                static_cast<std::int16_t>(weights.exponent() + kRangeFftExponent);
            end += 2;
        } while (end < kChirps && levels.exponent[end / 2] == deviation);
        range_fft(frame.chirp[first].data(), {&levels.sum[first], end - first}, weights,
                  &spectrum.row[0][first]);
        first = end;
    }
}

ChirpTaper::ChirpTaper(const Window& window, const std::array<std::int16_t, kChirps / 2>& exponent)
    : guard_(guard_bits(window)) {
    int highest = exponent[0];
    for (const int e : exponent) highest = std::max(highest, e);
    int any = 0;
    std::uint8_t* smaller_to = smaller_.data();
    std::int32_t* weight_to = weight_.data();
    const std::int16_t* two = window.data();
    for (const int e : exponent) {
        const int smaller = highest - e;
        any |= smaller;
        *smaller_to++ = static_cast<std::uint8_t>(smaller);
        const Pair weights = packed::load(two);
        packed::store_pair(weight_to, weights << 16 >> smaller, (weights & 0xFFFF0000U) >> smaller);
        two += 2;
        weight_to += 2;
    }
    highest_ = highest;
    even_ = any == 0;
}

int ChirpTaper::apply(std::array<Complex16, kChirps>& row) const {
    const int bits = even_ ? magnitude_bits(row.data()) : magnitude_bits(row.data(), smaller_.data());
    const int down = bits - kFftInputBits + guard_;
    const std::size_t place = static_cast<std::size_t>(down) % kScaled;
    Weights& weight = scaled_[place];
    const bool lower_half = down <= kLowerHalf;
    if (scaled_down_[place] != down) {
        scaled_down_[place] = down;
        shift_right(weight_.data(), lower_half ? kWindowBits + down : down - 1, weight.data());
    }
    if (lower_half) {
        scale<false>(row.data(), weight.data());
    } else {
        scale<true>(row.data(), weight.data());
    }
    return highest_ + down;
}

void doppler_transform(Spectrum& spectrum, const ChirpTaper& taper, int first_range_cell) {
    const auto first = static_cast<std::size_t>(first_range_cell);
    const std::span<Spectrum64, kFftRows> rows(&spectrum.row[first], kFftRows);
    for (std::size_t i = 0; i < kFftRows; ++i) {
        spectrum.row_exponent[first + i] = static_cast<std::int16_t>(taper.apply(rows[i]) + kFftExponent);
    }
    fft64_rows(rows);
    // The taper rounds down: half a step in each of 64 chirps, in standstill alone.
    constexpr std::uint16_t kBias = kFftLength / 2 >> kFftExponent;
    for (Spectrum64& row : rows) {
        row[0] = std::bit_cast<Complex16>(packed::add(std::bit_cast<Pair>(row[0]), packed::both(kBias)));
    }
}

void log_power(std::span<const Complex16, kDopplerCells> row, int exponent,
               std::span<std::uint16_t, kDopplerCells> power) {
    const Pair bias = log2_bias(2 * exponent * kLogOne);
    const Complex16* from = row.data();
    std::uint16_t* to = power.data();
    for (const Complex16* const end = from + kDopplerCells; from != end;) {
        log_power_of_four(from, bias, to);
        log_power_of_four(from, bias, to);
    }
}

void range_doppler(const BeatFrame& frame, const DcLevels& levels, WindowKind range_window,
                   WindowKind doppler_window, Spectrum& spectrum, PowerMap& map) {
    range_transform(frame, levels, window(range_window), spectrum);
    const ChirpTaper taper(window(doppler_window), spectrum.chirp_exponent);
    for (std::size_t r = 0; r < kRangeCells; ++r) {
        if (r % kFftRows == 0) doppler_transform(spectrum, taper, static_cast<int>(r));
        log_power(spectrum.row[r], spectrum.row_exponent[r], map.cell[r]);
    }
}

void range_doppler(const BeatFrame& frame, WindowKind range_window, WindowKind doppler_window,
                   Spectrum& spectrum, PowerMap& map) {
    DcLevels levels;
    (void)inspect(frame, std::numeric_limits<std::int16_t>::max(), levels);
    range_doppler(frame, levels, range_window, doppler_window, spectrum, map);
}

}  // namespace dsp
