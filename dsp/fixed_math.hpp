/// Division, exponential, logarithm and square root of fixed-point numbers. Integers only, no 64-bit
/// division, no tables, every loop bounded; usable at compile time. The same bits on every machine.
///
/// Errors are stated in steps (LSB) of the format and are proven against double precision over dense sweeps
/// in tests/dsp/fixed_math_test.cpp.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "dsp/fixed_point.hpp"

namespace dsp {

namespace detail {
constexpr std::uint32_t high_product(std::uint32_t a, std::uint32_t b) {
    return static_cast<std::uint32_t>(static_cast<std::uint64_t>(a) * b >> 32);
}
}  // namespace detail

/// 1/d, kept as a normalised mantissa and a power of two so that small and large divisors are equally
/// precise: dividing several numbers by the same one costs one multiplication each.
///
/// `a * Reciprocal(d)` is a/d within 1/2 LSB + |a/d| 2^-29, saturated; a/0 saturates to the end of the range
/// with the sign of a (0/0 = 0), as Fixed's own operator/ does.
template <int F>
class Reciprocal {
  public:
    constexpr explicit Reciprocal(Fixed<F> d) {
        const auto bits = static_cast<std::uint32_t>(d.raw());
        const bool negative = d.raw() < 0;
        const std::uint32_t magnitude = negative ? 0U - bits : bits;
        if (magnitude == 0) return;
        const int zeros = std::countl_zero(magnitude);
        const std::uint32_t m = magnitude << zeros;  // m / 2^32 in [1/2, 1)
        // Newton's x <- x + x (1 - m x) from the best straight line 48/17 - 32/17 m (error 1/17, squared each
        // time: three steps reach 2^-32). x has 30 fraction bits and lies in (1, 2].
        std::uint32_t x = 3'031'741'620U - detail::high_product(m, 2'021'161'080U);
        for (int step = 0; step < 3; ++step) {
            const auto error = static_cast<std::int32_t>((1U << 30) - detail::high_product(m, x));
            x += static_cast<std::uint32_t>(
                static_cast<std::int32_t>((static_cast<std::int64_t>(x) * error) >> 30));
        }
        const auto mantissa = static_cast<std::int32_t>(x > kLargest ? kLargest : x);
        mantissa_ = negative ? -mantissa : mantissa;
        shift_ = 62 - F - zeros;
    }

    friend constexpr Fixed<F> operator*(Fixed<F> a, const Reciprocal& r) {
        if (r.mantissa_ == 0)
            return a.raw() > 0 ? Fixed<F>::max() : (a.raw() < 0 ? Fixed<F>::min() : Fixed<F>{});
        const std::int64_t product = static_cast<std::int64_t>(a.raw()) * r.mantissa_;
        return Fixed<F>::from_raw(saturate32(round_shift(product, r.shift_)));
    }

  private:
    static constexpr std::uint32_t kLargest = 0x7FFF'FFFFU;
    std::int32_t mantissa_ = 0;  // 0: the divisor was zero
    int shift_ = 0;
};

/// a/b within 1/2 LSB + |a/b| 2^-29, saturated; about a third of the cost of operator/, which is exact.
template <int F>
constexpr Fixed<F> divide(Fixed<F> a, Fixed<F> b) {
    return a * Reciprocal<F>(b);
}

/// e^x within 1/2 LSB + e^x 2^-26. Saturates to the largest number; below half an LSB it is 0.
template <int F>
constexpr Fixed<F> exp(Fixed<F> x) {
    // e^x = 2^n 2^u: n integer, u in [0, 1) with 32 fraction bits.
    constexpr std::int64_t kLog2E = 3'098'164'009;  // 31 fraction bits
    if (x.raw() > (std::int64_t{23} << F)) return Fixed<F>::max();
    if (x.raw() < -(std::int64_t{23} << F)) return Fixed<F>{};
    const std::int64_t y = x.raw() * kLog2E >> (F - 1);  // 32 fraction bits
    const auto n = static_cast<int>(y >> 32);
    const auto u = static_cast<std::uint32_t>(y & 0xFFFF'FFFF);
    // (2^u - 1) / u, Chebyshev interpolation of degree 6, error 2.3e-10. 32 fraction bits.
    constexpr std::array<std::uint32_t, 7> kCoefficient{2'977'044'473, 1'031'764'902, 238'389'752, 41'301'092,
                                                        5'750'554,     627'479,       89'043};
    std::uint32_t sum = kCoefficient.back();
    for (std::size_t i = kCoefficient.size() - 1; i-- > 0;) {
        sum = kCoefficient[i] + detail::high_product(sum, u);
    }
    const std::int64_t power = (std::int64_t{1} << 31) + (detail::high_product(sum, u) >> 1);  // 2^u, 31 bits
    const int shift = 31 - F - n;
    if (shift < 0) return Fixed<F>::max();
    if (shift > 33) return Fixed<F>{};
    return Fixed<F>::from_raw(saturate32(round_shift(power, shift)));
}

/// Natural logarithm within 1/2 LSB + 2^-26. ln of zero or a negative number is the most negative number.
template <int F>
constexpr Fixed<F> ln(Fixed<F> x) {
    if (x.raw() <= 0) return Fixed<F>::min();
    constexpr std::int64_t kLn2 = 744'261'118;  // 30 fraction bits
    // x = 2^n (1 + u), u in [0, 1) with 31 fraction bits.
    const auto bits = static_cast<std::uint32_t>(x.raw());
    const int zeros = std::countl_zero(bits);
    const int n = 31 - zeros - F;
    const auto u = static_cast<std::int32_t>((bits << zeros) & 0x7FFF'FFFFU);
    // ln(1 + u) / u, Chebyshev interpolation of degree 10, error 8.3e-10. 30 fraction bits.
    constexpr std::array<std::int32_t, 11> kCoefficient{
        1'073'741'823, -536'870'692, 357'904'967, -268'290'463, 213'522'369, -172'739'537,
        132'907'719,   -87'918'420,  44'030'473,  -14'160'321,  2'133'199};
    std::int32_t sum = kCoefficient.back();
    for (std::size_t i = kCoefficient.size() - 1; i-- > 0;) {
        sum = static_cast<std::int32_t>(kCoefficient[i] + (static_cast<std::int64_t>(sum) * u >> 31));
    }
    const std::int64_t y = n * kLn2 + (static_cast<std::int64_t>(sum) * u >> 31);
    if constexpr (F > 30) {
        return Fixed<F>::from_raw(saturate32(y << (F - 30)));
    } else {
        return Fixed<F>::from_raw(saturate32(round_shift(y, 30 - F)));
    }
}

/// Square root rounded to nearest; of a negative number 0. One result bit a step, at most 31 steps.
template <int F>
constexpr Fixed<F> sqrt(Fixed<F> x) {
    if (x.raw() <= 0) return Fixed<F>{};
    const std::uint64_t square = static_cast<std::uint64_t>(x.raw()) << F;
    std::uint64_t rest = square;
    std::uint64_t root = 0;
    for (std::uint64_t bit = std::uint64_t{1} << 60; bit != 0; bit >>= 2) {
        if (rest >= root + bit) {
            rest -= root + bit;
            root = (root >> 1) + bit;
        } else {
            root >>= 1;
        }
    }
    if (rest > root) ++root;  // square - root^2 > root <=> sqrt(square) > root + 1/2
    return Fixed<F>::from_raw(saturate32(static_cast<std::int64_t>(root)));
}

}  // namespace dsp
