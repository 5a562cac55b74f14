/// Which of a frame's range rates are near a given one: the cheap question before the costly one. Most pairs
/// of tracks, measurements and starts are far apart in range rate, and range rates are folded.
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>

#include "tracking/scalar.hpp"
#include "tracking/track.hpp"

namespace tracking {

/// At most kMaxMeasurements range rates, as bits in sectors of a circle: an angle of 32 bits makes one turn
/// for the span of unambiguous range rates, so that folding is what the arithmetic does by itself.
template <class S>
class RateIndex {
  public:
    /// 0 (unambiguous) or a span below 1 m/s: everything counts as near.
    explicit RateIndex(S span) : folded_(span >= S(1)) {
        if (!folded_) return;
        if constexpr (std::floating_point<S>) {
            scale_ = 1 / span;
        } else {
            scale_ = static_cast<std::int32_t>((std::int64_t{1} << (32 + kScaleBits)) / span.raw());
        }
    }

    void clear() {
        sector_ = {};
        count_ = 0;
        largest_variance_ = S(0);
    }
    /// Its number is how many were added before.
    void add(S rate, S variance) {
        sector_[angle(rate) >> kSectorBits][count_ / 32] |= 1U << count_ % 32;
        ++count_;
        if (variance > largest_variance_) largest_variance_ = variance;
    }
    [[nodiscard]] S largest_variance() const { return largest_variance_; }

    /// Those within `reach` of `rate` but for folding, as bits, and perhaps some up to 2 % of the span
    /// farther. Cost five instructions a sector within reach.
    [[nodiscard]] std::uint64_t near(S rate, S reach) const {
        const std::uint64_t width = turns(reach) + kMargin;
        if (!folded_ || width >= (std::uint64_t{1} << 31) - (1U << kSectorBits))
            return count_ == 0 ? 0 : ~std::uint64_t{0} >> (64 - count_);
        const std::uint32_t middle = angle(rate);
        const std::uint32_t from = (middle - static_cast<std::uint32_t>(width)) >> kSectorBits;
        const std::uint32_t to = (middle + static_cast<std::uint32_t>(width)) >> kSectorBits;
        Set set = sector_[to];
        for (std::uint32_t i = from; i != to; i = (i + 1) % kSectors) {
            set[0] |= sector_[i][0];
            set[1] |= sector_[i][1];
        }
        return static_cast<std::uint64_t>(set[1]) << 32 | set[0];
    }

  private:
    using Set = std::array<std::uint32_t, 2>;  ///< as bits, by halves
    static_assert(kMaxMeasurements <= 64);
    static constexpr int kSectorBits = 26;  ///< of the angle within a sector
    static constexpr std::uint32_t kSectors = 64;
    static constexpr int kScaleBits = 16;
    static constexpr std::uint32_t kMargin = 1U << 21;  ///< rounding of the scale, 512 m/s away

    /// 2^32 for a span, of a number that is not negative; saturates at 2^32.
    [[nodiscard]] std::uint64_t turns(S rate) const {
        if constexpr (std::floating_point<S>) {
            const S t = rate * scale_;
            return t < 1 ? static_cast<std::uint64_t>(std::ldexp(t, 32)) : std::uint64_t{1} << 32;
        } else {
            return static_cast<std::uint64_t>(dsp::product(rate.raw(), scale_)) >> kScaleBits;
        }
    }
    [[nodiscard]] std::uint32_t angle(S rate) const {
        if constexpr (std::floating_point<S>) {
            const S t = rate * scale_;
            return static_cast<std::uint32_t>(static_cast<std::uint64_t>(std::ldexp(t - std::floor(t), 32)));
        } else {
            return static_cast<std::uint32_t>(dsp::product(rate.raw(), scale_) >> kScaleBits);
        }
    }

    bool folded_;
    std::conditional_t<std::floating_point<S>, S, std::int32_t> scale_{};  ///< 2^(32 + kScaleBits) for a span
    std::uint32_t count_ = 0;
    S largest_variance_ = S(0);
    std::array<Set, kSectors> sector_{};
};

}  // namespace tracking
