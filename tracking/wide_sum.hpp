/// Sums of products that round once, at the end.
#pragma once

#include <bit>
#include <concepts>
#include <cstdint>
#include <type_traits>

#include "dsp/fixed_math.hpp"
#include "tracking/scalar.hpp"

namespace tracking {

/// A sum of products of S. In fixed point it is held in 64 bits with twice the fraction bits, so nothing is
/// rounded until `value()` or `share()`, and on the targets a term costs one multiply-accumulate.
/// Range: the absolute value of every partial sum stays below 2^(63 - 2F), 524,288 for dsp::Real; the caller
/// keeps it there.
template <class S>
class WideSum {
  public:
    WideSum() = default;
    explicit WideSum(S v) { add(v); }

    void add(S v) {
        if constexpr (std::floating_point<S>) {
            sum_ += v;
        } else {
            sum_ += static_cast<std::int64_t>(v.raw()) << S::fraction_bits;
        }
    }
    void add_product(S a, S b) {
        if constexpr (std::floating_point<S>) {
            sum_ += a * b;
        } else {
            sum_ = dsp::accumulated(sum_, a.raw(), b.raw());
        }
    }
    WideSum& operator+=(const WideSum& o) {
        sum_ += o.sum_;
        return *this;
    }
    WideSum& operator-=(const WideSum& o) {
        sum_ -= o.sum_;
        return *this;
    }
    [[nodiscard]] bool positive() const { return sum_ > 0; }
    /// The sum times a weight of 0..1; in fixed point truncated at the last of the 2F fraction bits.
    [[nodiscard]] WideSum scaled(S weight) const {
        WideSum out;
        if constexpr (std::floating_point<S>) {
            out.sum_ = sum_ * weight;
        } else {
            const std::int64_t high = sum_ >> 32;
            const std::int64_t low = sum_ & 0xFFFF'FFFF;
            out.sum_ = ((high * weight.raw()) << (32 - S::fraction_bits)) +
                       ((low * weight.raw()) >> S::fraction_bits);
        }
        return out;
    }

    /// The sum as S: rounded half to even, saturated.
    [[nodiscard]] S value() const {
        if constexpr (std::floating_point<S>) {
            return sum_;
        } else {
            return S::from_raw(dsp::narrowed<S::fraction_bits>(sum_));
        }
    }

    /// Divides parts by a whole: `part.share(Whole(whole))`, one division for all parts. 0 <= part <= whole,
    /// whole > 0; in fixed point within one LSB of S plus 2^-29, as long as the whole is at least 2^-F.
    class Whole {
      public:
        explicit Whole(const WideSum& whole) : inverse_(reciprocal(normalised(whole))) {}

      private:
        friend class WideSum;
        S normalised(const WideSum& whole) {
            if constexpr (std::floating_point<S>) {
                return whole.sum_;
            } else {
                const int width = 64 - std::countl_zero(static_cast<std::uint64_t>(whole.sum_));
                drop_ = width > 30 ? width - 30 : 0;
                return S::from_raw(static_cast<std::int32_t>(whole.sum_ >> drop_));
            }
        }
        int drop_ = 0;
        decltype(reciprocal(S{})) inverse_;
    };
    [[nodiscard]] S share(const Whole& whole) const {
        if constexpr (std::floating_point<S>) {
            return sum_ * whole.inverse_;
        } else {
            return S::from_raw(dsp::saturate32(sum_ >> whole.drop_)) * whole.inverse_;
        }
    }

  private:
    std::conditional_t<std::floating_point<S>, S, std::int64_t> sum_{};
};

}  // namespace tracking
