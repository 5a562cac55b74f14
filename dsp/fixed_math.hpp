/// Division, exponential, logarithm and square root of fixed-point numbers. Integers only, no 64-bit
/// division, every loop bounded; usable at compile time. The same bits on every machine.
///
/// Errors are stated in steps (LSB) of the format and are proven against double precision over dense sweeps
/// in tests/dsp/fixed_math_test.cpp.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "dsp/fixed_point.hpp"

namespace dsp {

namespace detail {
/// The upper half of a product.
constexpr std::uint32_t high_product(std::uint32_t a, std::uint32_t b) {
#ifdef __arm__
    if (!std::is_constant_evaluated()) {
        std::uint32_t low = 0;
        std::uint32_t high = 0;
        asm("umull %0, %1, %2, %3" : "=r"(low), "=r"(high) : "r"(a), "r"(b));
        return high;
    }
#endif
    return static_cast<std::uint32_t>(static_cast<std::uint64_t>(a) * b >> 32);
}
constexpr std::int32_t high_product(std::int32_t a, std::int32_t b) {
#ifdef __arm__
    if (!std::is_constant_evaluated()) {
        std::int32_t high = 0;
        asm("smmul %0, %1, %2" : "=r"(high) : "r"(a), "r"(b));
        return high;
    }
#endif
    return static_cast<std::int32_t>(product(a, b) >> 32);
}

/// 2^62 / m for m >= 2^31, within a relative 2^-29, at most 2^31 - 1. One 32-bit division for the upper half
/// of the digits, one step of Newton for the lower.
constexpr std::uint32_t inverse(std::uint32_t m) {
    const std::uint32_t upper = (m >> 16) + (m >> 15 & 1);
    std::uint32_t x = (0xFFFF'FFFFU / upper) << 14;
    const auto error = static_cast<std::int32_t>((1U << 30) - high_product(m, x));
    x += static_cast<std::uint32_t>(product(static_cast<std::int32_t>(x), error) >> 30);
    return x > 0x7FFF'FFFFU ? 0x7FFF'FFFFU : x;
}

/// 2^((i + 1/2) / 32), 31 fraction bits.
inline constexpr std::array<std::uint32_t, 32> kPowers{
    2'170'868'212U, 2'218'404'036U, 2'266'980'759U, 2'316'621'173U, 2'367'348'571U, 2'419'186'755U,
    2'472'160'047U, 2'526'293'303U, 2'581'611'923U, 2'638'141'863U, 2'695'909'648U, 2'754'942'382U,
    2'815'267'765U, 2'876'914'102U, 2'939'910'317U, 3'004'285'971U, 3'070'071'267U, 3'137'297'074U,
    3'205'994'934U, 3'276'197'082U, 3'347'936'457U, 3'421'246'719U, 3'496'162'267U, 3'572'718'252U,
    3'650'950'594U, 3'730'896'002U, 3'812'591'987U, 3'896'076'880U, 3'981'389'855U, 4'068'570'940U,
    4'157'661'043U, 4'248'701'965U};
/// 1 / c for c = 1 + (i + 1/2) / 32, 32 fraction bits, and -ln of it, 30 fraction bits.
inline constexpr std::array<std::uint32_t, 32> kInverses{
    4'228'890'876U, 4'102'655'328U, 3'983'737'782U, 3'871'519'816U, 3'765'450'780U, 3'665'038'759U,
    3'569'842'947U, 3'479'467'177U, 3'393'554'407U, 3'311'782'011U, 3'233'857'729U, 3'159'516'172U,
    3'088'515'808U, 3'020'636'340U, 2'955'676'419U, 2'893'451'652U, 2'833'792'855U, 2'776'544'515U,
    2'721'563'435U, 2'668'717'543U, 2'617'884'828U, 2'568'952'401U, 2'521'815'660U, 2'476'377'540U,
    2'432'547'849U, 2'390'242'669U, 2'349'383'820U, 2'309'898'378U, 2'271'718'239U, 2'234'779'731U,
    2'199'023'256U, 2'164'392'968U};
inline constexpr std::array<std::int32_t, 32> kLogarithms{
    16'647'494,  49'187'615,  80'770'533,  111'450'959, 141'279'038, 170'300'854, 198'558'849, 226'092'199,
    252'937'143, 279'127'267, 304'693'756, 329'665'621, 354'069'895, 377'931'807, 401'274'939, 424'121'372,
    446'491'803, 468'405'661, 489'881'214, 510'935'650, 531'585'167, 551'845'048, 571'729'724, 591'252'841,
    610'427'312, 629'265'371, 647'778'619, 665'978'069, 683'874'180, 701'476'900, 718'795'691, 735'839'570};

/// ln(m / 2^31) for m >= 2^31, 30 fraction bits, within 2^-28: from the nearest of 32 points by three terms.
constexpr std::int32_t ln_of_mantissa(std::uint32_t m) {
    const std::uint32_t i = m >> 26 & 31;
    // ln(1 + r) for |r| <= 1/64, r with 32 fraction bits. The fourth term is near a parabola, which is added
    // to the second: 1/2 + 1/4 (1/64)^2.
    const auto r = static_cast<std::int32_t>(
        static_cast<std::uint32_t>(static_cast<std::uint64_t>(m) * kInverses[i] >> 31));
    const std::int32_t r2 = high_product(r, r);
    const std::int32_t r3 = high_product(r2, r);
    constexpr std::int32_t kThird = 1'431'655'765;
    return kLogarithms[i] + ((r - (r2 >> 1) - (r2 >> 14) + high_product(r3, kThird) + 2) >> 2);
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
        const auto mantissa = static_cast<std::int32_t>(detail::inverse(m));
        mantissa_ = negative ? -mantissa : mantissa;
        shift_ = 62 - F - zeros;
    }

    friend constexpr Fixed<F> operator*(Fixed<F> a, const Reciprocal& r) {
        if (r.mantissa_ == 0)
            return a.raw() > 0 ? Fixed<F>::max() : (a.raw() < 0 ? Fixed<F>::min() : Fixed<F>{});
        return Fixed<F>::from_raw(saturate32(((product(a.raw(), r.mantissa_) >> (r.shift_ - 1)) + 1) >> 1));
    }

    /// The same, bit for bit, for 0 <= part <= d, in five instructions.
    [[nodiscard]] constexpr Fixed<F> share(Fixed<F> part) const {
        static_assert(F <= 28);
        const int zeros = 62 - F - shift_;
        // Shifted as far left as d can be, the product needs the same shift to the right whatever d is.
        const std::int32_t high = detail::high_product(part.raw() << (zeros - 1), mantissa_);
        return Fixed<F>::from_raw((high + (1 << (28 - F))) >> (29 - F));
    }

  private:
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
    constexpr std::int64_t kTwo32 = std::int64_t{1} << 32;
    const std::int64_t y =
        (product(x.raw(), static_cast<std::int32_t>(kLog2E - kTwo32)) + x.raw() * kTwo32) >>
        (F - 1);  // 32 fraction bits
    const auto n = static_cast<int>(y >> 32);
    const auto u = static_cast<std::uint32_t>(y & 0xFFFF'FFFF);
    // 2^u from the nearest of 32 points, by e^t = 1 + t + t^2/2 + t^3/6 for |t| <= ln 2 / 64, error 6e-10.
    constexpr std::int32_t kHalfLn2 = 1'488'522'236;  // of ln 2 / 2, 32 fraction bits
    constexpr std::int32_t kSixth = 715'827'883;
    const std::uint32_t point = detail::kPowers[u >> 27];
    const auto from_point = static_cast<std::int32_t>(u & 0x7FF'FFFF) - (1 << 26);
    const std::int32_t t = detail::high_product(from_point << 1, kHalfLn2);
    const std::int32_t t2 = detail::high_product(t, t);
    const std::int32_t step = t + (t2 >> 1) + detail::high_product(detail::high_product(t2, t), kSixth);
    const std::uint32_t near_power = (point >> 1) + static_cast<std::uint32_t>(detail::high_product(
                                                        static_cast<std::int32_t>(point >> 1), step));
    const std::uint32_t power = near_power < 0x7FFF'FFFFU ? near_power : 0x7FFF'FFFFU;  // 30 fraction bits
    const int shift = 30 - F - n;
    if (static_cast<unsigned>(shift) > 31) return shift < 0 ? Fixed<F>::max() : Fixed<F>{};
    return Fixed<F>::from_raw(static_cast<std::int32_t>((power + (1U << shift >> 1)) >> shift));
}

/// Natural logarithm within 1/2 LSB + 2^-26. ln of zero or a negative number is the most negative number.
template <int F>
constexpr Fixed<F> ln(Fixed<F> x) {
    if (x.raw() <= 0) return Fixed<F>::min();
    constexpr std::int64_t kLn2 = 744'261'118;  // 30 fraction bits
    // x = 2^n m, m in [1, 2).
    const auto bits = static_cast<std::uint32_t>(x.raw());
    const int zeros = std::countl_zero(bits);
    const int n = 31 - zeros - F;
    const std::int64_t y = n * kLn2 + detail::ln_of_mantissa(bits << zeros);
    if constexpr (F > 30) {
        return Fixed<F>::from_raw(saturate32(y << (F - 30)));
    } else {
        return Fixed<F>::from_raw(saturate32(round_shift(y, 30 - F)));
    }
}

namespace detail {
/// floor(sqrt(v)) for v >= 2^30: Newton's steps from a line within 4 %.
constexpr std::uint32_t root_of_upper(std::uint32_t v) {
    std::uint32_t y = high_product(v, 43'691U) + 22'992U;  // (x / 3 + 0.70) 2^15 for v = x 2^30
    y = (y + v / y) / 2;
    y = (y + v / y) / 2;  // within 0.02, rounded down
    y = y > 0xFFFFU ? 0xFFFFU : y;
    return y * y > v ? y - 1 : y;
}
}  // namespace detail

/// Square root rounded to nearest; of a negative number 0. Three 32-bit divisions: two for the upper half of
/// the digits, one, as on paper, for the lower (Zimmermann 1999).
template <int F>
constexpr Fixed<F> sqrt(Fixed<F> x) {
    if (x.raw() <= 0) return Fixed<F>{};
    const std::uint64_t square = static_cast<std::uint64_t>(x.raw()) << F;
    const int up = std::countl_zero(square) & ~1;
    const auto upper = static_cast<std::uint32_t>(square << up >> 32);
    const auto lower = static_cast<std::uint32_t>(square << up);
    const std::uint32_t y = detail::root_of_upper(upper);
    const std::uint32_t rest_of_upper = upper - y * y;  // at most 2 y
    const std::uint64_t digits = (rest_of_upper << 15 | lower >> 17) / y;
    std::uint64_t root =
        ((std::uint64_t{y} << 16) + digits) >> up / 2;  // never too small, at most one too large
    if (root * root > square) --root;
    if (square - root * root > root) ++root;  // <=> sqrt(square) > root + 1/2
    return Fixed<F>::from_raw(saturate32(static_cast<std::int64_t>(root)));
}

}  // namespace dsp
