/// Fixed-point arithmetic: explicit formats, saturation, unbiased rounding. Integers only.
///
/// Notation: Q(m.n) is a two's complement number with n fraction bits. Every operation either is exact,
/// rounds half to even (so repeated rounding adds no bias), or saturates at the end of the format. Nothing
/// wraps.
#pragma once

#include <compare>
#include <concepts>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace dsp {

/// Clamps to the range of int32. Exact inside it.
constexpr std::int32_t saturate32(std::int64_t v) {
    constexpr std::int64_t kMax = std::numeric_limits<std::int32_t>::max();
    constexpr std::int64_t kMin = std::numeric_limits<std::int32_t>::min();
    return static_cast<std::int32_t>(v > kMax ? kMax : (v < kMin ? kMin : v));
}

// On the targets one instruction each, with the same bits as the plain C++ beside it; every scenario replayed
// on a board against the PC compares them.

/// v / 2^Down, rounded down, clamped to the range of int16; 0 <= Down <= 31.
template <int Down = 0>
constexpr std::int32_t saturate16(std::int32_t v) {
#ifdef __arm__
    if (!std::is_constant_evaluated()) {
        std::int32_t out = 0;
        if constexpr (Down == 0) {  // the compiler's __ssat changes signs on the way
            asm("ssat %0, #16, %1" : "=r"(out) : "r"(v));
        } else {
            asm("ssat %0, #16, %1, asr %2" : "=r"(out) : "r"(v), "I"(Down));
        }
        return out;
    }
#endif
    constexpr std::int32_t kMax = std::numeric_limits<std::int16_t>::max();
    constexpr std::int32_t kMin = std::numeric_limits<std::int16_t>::min();
    v >>= Down;
    return v > kMax ? kMax : (v < kMin ? kMin : v);
}

/// a b. The compiler, left alone, remembers where a number comes from and multiplies it as one of 64 bits.
constexpr std::int64_t product(std::int32_t a, std::int32_t b) {
#ifdef __arm__
    if (!std::is_constant_evaluated()) {
        std::int64_t out = 0;
        asm("smull %Q0, %R0, %1, %2" : "=r"(out) : "r"(a), "r"(b));
        return out;
    }
#endif
    return static_cast<std::int64_t>(a) * b;
}

/// sum + a b, modulo 2^64.
constexpr std::int64_t accumulated(std::int64_t sum, std::int32_t a, std::int32_t b) {
#ifdef __arm__
    if (!std::is_constant_evaluated()) {
        asm("smlal %Q0, %R0, %1, %2" : "+r"(sum) : "r"(a), "r"(b));
        return sum;
    }
#endif
    return static_cast<std::int64_t>(static_cast<std::uint64_t>(sum) +
                                     static_cast<std::uint64_t>(static_cast<std::int64_t>(a) * b));
}

/// a + b and a - b, saturated.
constexpr std::int32_t saturated_sum(std::int32_t a, std::int32_t b) {
#ifdef __arm__
    if (!std::is_constant_evaluated()) {
        std::int32_t out = 0;
        asm("qadd %0, %1, %2" : "=r"(out) : "r"(a), "r"(b));
        return out;
    }
#endif
    return saturate32(static_cast<std::int64_t>(a) + b);
}
constexpr std::int32_t saturated_difference(std::int32_t a, std::int32_t b) {
#ifdef __arm__
    if (!std::is_constant_evaluated()) {
        std::int32_t out = 0;
        asm("qsub %0, %1, %2" : "=r"(out) : "r"(a), "r"(b));
        return out;
    }
#endif
    return saturate32(static_cast<std::int64_t>(a) - b);
}

/// v / 2^bits, rounded half to even; 0 <= bits < width of Int. Exact for bits = 0. Cannot overflow: the
/// rounding bit is added after the shift.
template <std::signed_integral Int>
constexpr Int round_shift(Int v, int bits) {
    if (bits == 0) return v;
    const Int floor = v >> bits;
    const Int half = Int{1} << (bits - 1);
    const Int rest = v & static_cast<Int>((half - 1) | half);
    return static_cast<Int>(floor + (rest > half - (floor & 1) ? 1 : 0));
}

namespace detail {
/// v plus what makes the shift by Bits that follows round half to even: a little less than half to an even
/// number, half to an odd one.
template <int Bits>
constexpr std::uint64_t before_rounding_shift(std::int64_t v) {
    static_assert(Bits >= 1 && Bits <= 31);
    constexpr std::uint32_t kBelowHalf = (1U << (Bits - 1)) - 1;
    const auto wide = static_cast<std::uint64_t>(v);
#ifdef __arm__
    if (!std::is_constant_evaluated()) {
        auto low = static_cast<std::uint32_t>(wide);
        auto high = static_cast<std::uint32_t>(wide >> 32);
        std::uint32_t rest = 0;
        asm("lsrs %2, %0, %4\n\tadcs %0, %0, %3\n\tadc %1, %1, #0"  // the carry is whether it is odd
            : "+r"(low), "+r"(high), "=&r"(rest)
            : "r"(kBelowHalf), "n"(Bits + 1)
            : "cc");
        return std::uint64_t{high} << 32 | low;
    }
#endif
    return wide + (kBelowHalf + (static_cast<std::uint32_t>(wide >> Bits) & 1));
}
}  // namespace detail

/// v / 2^Bits, rounded half to even, 1 <= Bits <= 31, where that has 32 bits.
template <int Bits>
constexpr std::int32_t rounded(std::int64_t v) {
    return static_cast<std::int32_t>(
        static_cast<std::uint32_t>(detail::before_rounding_shift<Bits>(v) >> Bits));
}
/// The same saturated to 32 bits, |v| <= 2^62: what a product of two numbers of 32 bits becomes.
template <int Bits>
constexpr std::int32_t narrowed(std::int64_t v) {
    const std::uint64_t up = detail::before_rounding_shift<Bits>(v);
    const auto high = static_cast<std::int32_t>(up >> 32);
    const auto out = static_cast<std::int32_t>(static_cast<std::uint32_t>(up >> Bits));
    if (high >> (Bits - 1) != out >> 31) [[unlikely]]
        return (high >> 31) ^ std::numeric_limits<std::int32_t>::max();
    return out;
}

/// num / den rounded half to even, den > 0. The quotient must fit Int.
template <std::signed_integral Int>
constexpr Int round_divide(Int num, Int den) {
    Int q = num / den;
    Int r = num % den;
    if (r < 0) {
        r = static_cast<Int>(r + den);
        --q;
    }
    const Int rest = static_cast<Int>(den - r);
    if (r > rest || (r == rest && (q & 1) != 0)) ++q;
    return q;
}

/// A saturating fixed-point number with FractionBits fraction bits in 32 bits: Q(31-F.F).
///
/// Range [-2^(31-F), 2^(31-F) - 2^-F]. Sums and differences are exact or saturate; products round half to
/// even and saturate; a quotient by zero saturates to the end of the range with the sign of the dividend (0/0
/// = 0).
template <int FractionBits>
class Fixed {
    static_assert(FractionBits > 0 && FractionBits < 31);

  public:
    static constexpr int fraction_bits = FractionBits;

    constexpr Fixed() = default;
    /// An integer, saturated to the range. Implicit, so that `x * 2` and Eigen's literal 0 and 1 work.
    constexpr Fixed(int v) : raw_(saturate32(static_cast<std::int64_t>(v) << FractionBits)) {}  // NOLINT

    static constexpr Fixed from_raw(std::int32_t raw) {
        Fixed f;
        f.raw_ = raw;
        return f;
    }
    /// num/den rounded half to even, saturated: the way to write a constant, `ratio(1, 10)` for 0.1.
    static constexpr Fixed ratio(std::int64_t num, std::int64_t den) {
        if (den < 0) return ratio(-num, -den);
        return from_raw(saturate32(round_divide<std::int64_t>(num * (std::int64_t{1} << FractionBits), den)));
    }
    static constexpr Fixed max() { return from_raw(std::numeric_limits<std::int32_t>::max()); }
    static constexpr Fixed min() { return from_raw(std::numeric_limits<std::int32_t>::min()); }

    [[nodiscard]] constexpr std::int32_t raw() const { return raw_; }

    /// The same value with another number of fraction bits: rounds half to even, saturates.
    template <int G>
    [[nodiscard]] constexpr Fixed<G> to() const {
        if constexpr (G >= FractionBits) {
            return Fixed<G>::from_raw(saturate32(static_cast<std::int64_t>(raw_) << (G - FractionBits)));
        } else {
            return Fixed<G>::from_raw(round_shift(raw_, FractionBits - G));
        }
    }
    /// value * scale rounded half to even: for signals in integer units, e.g. `in_units(1000)` for mm of
    /// metres.
    [[nodiscard]] constexpr std::int32_t in_units(std::int32_t scale) const {
        return narrowed<FractionBits>(product(raw_, scale));
    }

    constexpr auto operator<=>(const Fixed&) const = default;

    constexpr Fixed operator-() const { return from_raw(saturated_difference(0, raw_)); }
    friend constexpr Fixed operator+(Fixed a, Fixed b) { return from_raw(saturated_sum(a.raw_, b.raw_)); }
    friend constexpr Fixed operator-(Fixed a, Fixed b) {
        return from_raw(saturated_difference(a.raw_, b.raw_));
    }
    friend constexpr Fixed operator*(Fixed a, Fixed b) {
        return from_raw(narrowed<FractionBits>(product(a.raw_, b.raw_)));
    }
    friend constexpr Fixed operator/(Fixed a, Fixed b) {
        if (b.raw_ == 0) return a.raw_ > 0 ? max() : (a.raw_ < 0 ? min() : Fixed{});
        std::int64_t num = static_cast<std::int64_t>(a.raw_) * (std::int64_t{1} << FractionBits);
        std::int64_t den = b.raw_;
        if (den < 0) {
            num = -num;
            den = -den;
        }
        return from_raw(saturate32(round_divide(num, den)));
    }
    constexpr Fixed& operator+=(Fixed o) { return *this = *this + o; }
    constexpr Fixed& operator-=(Fixed o) { return *this = *this - o; }
    constexpr Fixed& operator*=(Fixed o) { return *this = *this * o; }
    constexpr Fixed& operator/=(Fixed o) { return *this = *this / o; }

  private:
    std::int32_t raw_ = 0;
};

/// The format of physical quantities between the rooms (metres, metres per second, their variances, decibels,
/// probabilities): Q9.22, range +-512, step 2.4e-7.
using Real = Fixed<22>;

}  // namespace dsp
