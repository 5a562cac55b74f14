/// Which of a frame's range rates are near a given one: the cheap question before the costly one. Most pairs
/// of tracks, measurements and starts are far apart in range rate, and range rates are folded.
#pragma once

#include <array>
#include <bit>
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

    /// Makes room for range rates 0 .. count - 1.
    void clear(std::size_t count) {
        sector_ = {};
        count_ = static_cast<std::uint32_t>(count);
    }
    void add(std::size_t i, S rate) { sector_[angle(rate) >> kSectorBits][i / 32] |= 1U << i % 32; }

    /// A reach in range rate as near() wants it; the same for all range rates asked about.
    [[nodiscard]] std::uint32_t width(S reach) const {
        if constexpr (std::floating_point<S>) {
            return folded_ && reach * scale_ < constant<S>(12, 25)
                       ? static_cast<std::uint32_t>(std::ldexp(reach * scale_, 32)) + kMargin
                       : kEverything;
        } else {
            constexpr std::int32_t kMost = (1 << kScaleBits) / 25 * 12;
            const std::int64_t turns = dsp::product(reach.raw(), scale_);
            return folded_ && (turns >> 32) < kMost
                       ? static_cast<std::uint32_t>(turns >> kScaleBits) + kMargin
                       : kEverything;
        }
    }
    /// Those within the reach of `rate` but for folding, as bits, and perhaps some up to 2 % of the span
    /// farther. Cost five instructions a sector within reach.
    [[nodiscard]] std::uint64_t near(S rate, std::uint32_t width) const {
        if (width == kEverything) return count_ == 0 ? 0 : ~std::uint64_t{0} >> (64 - count_);
        const std::uint32_t middle = angle(rate);
        const std::uint32_t to = (middle + width) >> kSectorBits;
        const std::uint32_t from = (middle - width) >> kSectorBits;
        std::uint64_t set = 0;
        const auto add = [&set](const Set* sector, const Set* end) {
            for (; sector != end; ++sector) set |= std::bit_cast<std::uint64_t>(*sector);
        };
        const Set* const first = sector_.data();
        if (from > to) {
            add(first + from, first + kSectors);
            add(first, first + to + 1);
        } else {
            add(first + from, first + to + 1);
        }
        return set;
    }

  private:
    using Set = std::array<std::uint32_t, 2>;  ///< as bits, by halves
    static_assert(kMaxMeasurements <= 64 && std::endian::native == std::endian::little);
    static constexpr int kSectorBits = 26;  ///< of the angle within a sector
    static constexpr std::uint32_t kSectors = 64;
    static constexpr int kScaleBits = 16;
    static constexpr std::uint32_t kEverything = ~0U;   ///< a width past half a turn
    static constexpr std::uint32_t kMargin = 1U << 21;  ///< rounding of the scale, 512 m/s away

    /// 2^32 for a span.
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
    std::array<Set, kSectors> sector_{};
};

}  // namespace tracking
