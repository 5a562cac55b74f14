#include "dsp/fft64.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>

#include "dsp/fixed_point.hpp"
#include "dsp/sine.hpp"

namespace dsp {

namespace {

struct Complex32 {
    std::int32_t re = 0;
    std::int32_t im = 0;
};

constexpr Complex32 operator+(Complex32 a, Complex32 b) {
    return {a.re + b.re, a.im + b.im};
}
constexpr Complex32 operator-(Complex32 a, Complex32 b) {
    return {a.re - b.re, a.im - b.im};
}
/// -j a
constexpr Complex32 turn_back(Complex32 a) {
    return {a.im, -a.re};
}

/// x * c, c in Q30, rounded.
constexpr std::int32_t scale_q30(std::int32_t x, std::int32_t c) {
    return static_cast<std::int32_t>((static_cast<std::int64_t>(x) * c + (std::int64_t{1} << 29)) >> 30);
}

/// a * w, w in Q30, |w| <= 1.
constexpr Complex32 rotate(Complex32 a, Complex32 w) {
    const auto product = [](std::int32_t x, std::int32_t y) { return static_cast<std::int64_t>(x) * y; };
    constexpr std::int64_t kHalf = std::int64_t{1} << 29;
    return {static_cast<std::int32_t>((product(a.re, w.re) - product(a.im, w.im) + kHalf) >> 30),
            static_cast<std::int32_t>((product(a.re, w.im) + product(a.im, w.re) + kHalf) >> 30)};
}

/// exp(-j 2 pi i / 64) in Q30 for i = n k, n and k in 1..7.
constexpr auto kTwiddles = [] {
    std::array<std::array<Complex32, 8>, 8> table{};
    for (int n = 0; n < 8; ++n) {
        for (int k = 0; k < 8; ++k) {
            table[static_cast<std::size_t>(n)][static_cast<std::size_t>(k)] = {cosine_q30(n * k, kFftLength),
                                                                               -sine_q30(n * k, kFftLength)};
        }
    }
    return table;
}();

constexpr std::int32_t kSqrtHalfQ30 = cosine_q30(1, 8);

/// 8-point transform in place, natural order, radix-2 decimation in time written out.
constexpr void fft8(std::array<Complex32, 8>& x) {
    const Complex32 a0 = x[0] + x[4];
    const Complex32 a1 = x[0] - x[4];
    const Complex32 a2 = x[2] + x[6];
    const Complex32 a3 = turn_back(x[2] - x[6]);
    const Complex32 b0 = x[1] + x[5];
    const Complex32 b1 = x[1] - x[5];
    const Complex32 b2 = x[3] + x[7];
    const Complex32 b3 = turn_back(x[3] - x[7]);

    const Complex32 even0 = a0 + a2;
    const Complex32 even1 = a1 + a3;
    const Complex32 even2 = a0 - a2;
    const Complex32 even3 = a1 - a3;
    const Complex32 odd0 = b0 + b2;
    const Complex32 odd1 = b1 + b3;
    const Complex32 odd2 = turn_back(b0 - b2);
    const Complex32 odd3 = b1 - b3;
    // exp(-j pi/4) (re + j im) = sqrt(1/2) ((re + im) + j (im - re)); exp(-j 3 pi/4) likewise.
    const Complex32 turned1{scale_q30(odd1.re + odd1.im, kSqrtHalfQ30),
                            scale_q30(odd1.im - odd1.re, kSqrtHalfQ30)};
    const Complex32 turned3{scale_q30(odd3.im - odd3.re, kSqrtHalfQ30),
                            scale_q30(-odd3.re - odd3.im, kSqrtHalfQ30)};

    x[0] = even0 + odd0;
    x[4] = even0 - odd0;
    x[1] = even1 + turned1;
    x[5] = even1 - turned1;
    x[2] = even2 + odd2;
    x[6] = even2 - odd2;
    x[3] = even3 + turned3;
    x[7] = even3 - turned3;
}

/// 2^15 * 2^9 * 64 * sqrt 2 < 2^31: the widest that cannot overflow, even for full-scale corners.
constexpr int kGuardBits = 9;
constexpr int kLowestExponent = -15;

}  // namespace

int fft64(std::span<Complex16, kFftLength> data, int bits) {
    std::array<std::array<Complex32, 8>, 8> work;
    for (std::size_t n = 0; n < 8; ++n) {
        std::array<Complex32, 8>& column = work[n];
        for (std::size_t m = 0; m < 8; ++m) {
            const Complex16 x = data[8 * m + n];
            column[m] = {x.re * (1 << kGuardBits), x.im * (1 << kGuardBits)};
        }
        fft8(column);
        for (std::size_t k = 1; k < 8; ++k) column[k] = rotate(column[k], kTwiddles[n][k]);
    }
    std::uint32_t magnitude = 0;  // or of all magnitudes: as wide as the largest
    for (std::size_t k = 0; k < 8; ++k) {
        std::array<Complex32, 8> row;
        for (std::size_t n = 0; n < 8; ++n) row[n] = work[n][k];
        fft8(row);
        for (std::size_t n = 0; n < 8; ++n) {
            magnitude |= static_cast<std::uint32_t>(row[n].re ^ (row[n].re >> 31));
            magnitude |= static_cast<std::uint32_t>(row[n].im ^ (row[n].im >> 31));
            work[n][k] = row[n];
        }
    }
    if (magnitude == 0) {
        std::ranges::fill(data, Complex16{});
        return kLowestExponent;
    }
    const auto width = static_cast<int>(std::bit_width(magnitude));
    const int shift = width - bits;
    for (std::size_t i = 0; i < kFftLength; ++i) {
        const Complex32 x = work[i / 8][i % 8];
        if (shift > 0) {
            // Rounding up from the very top would need one bit more: it saturates, less than one step low.
            const std::int32_t top = (1 << bits) - 1;
            data[i] = {static_cast<std::int16_t>(std::min(round_shift(x.re, shift), top)),
                       static_cast<std::int16_t>(std::min(round_shift(x.im, shift), top))};
        } else {
            data[i] = {static_cast<std::int16_t>(x.re * (1 << -shift)),
                       static_cast<std::int16_t>(x.im * (1 << -shift))};
        }
    }
    return shift - kGuardBits;
}

int fft64_real_pair(std::span<Complex16, kFftLength> z, std::span<Complex16, kFftLength / 2> a,
                    std::span<Complex16, kFftLength / 2> b) {
    const int exponent = fft64(z, 14);
    for (std::size_t k = 0; k < kFftLength / 2; ++k) {
        const Complex16 p = z[k];
        const Complex16 q = z[(kFftLength - k) % kFftLength];
        const auto narrow = [](int v) { return static_cast<std::int16_t>(v); };
        a[k] = {narrow(p.re + q.re), narrow(p.im - q.im)};
        b[k] = {narrow(p.im + q.im), narrow(q.re - p.re)};
    }
    return exponent - 1;
}

}  // namespace dsp
