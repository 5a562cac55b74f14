/// Where detections keep coming that are nobody's: echoes of the road at minus the car's own speed, of a
/// fence, of another radar. A coarse map of their mean number a frame makes the tracker trust such places
/// less.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "tracking/scalar.hpp"

namespace tracking {

template <class S>
class ClutterMap {
  public:
    static constexpr int kBands = 8;   ///< of kBandM; what is farther counts in the last
    static constexpr int kRates = 64;  ///< over the span of range rates
    static constexpr int kBandM = 20;

    /// `density`: of clutter expected everywhere, a frame per m (m/s). `rate_span_mps`: of the measured range
    /// rates, -span/2 to span/2; 0: unambiguous, 64 m/s are mapped.
    ClutterMap(S density, S rate_span_mps) {
        const S span = rate_span_mps > S(0) ? rate_span_mps : S(kRates);
        half_span_ = span * constant<S>(1, 2);
        per_rate_ = S(kRates) * reciprocal(span);
        const S least = constant<S>(1, std::int64_t{1} << 22);
        const S cell = S(kBandM) * reciprocal(per_rate_);
        per_count_ = S(1) * reciprocal(S(cell * (density < least ? least : density)));
    }

    /// ln of the clutter density at z over the density expected everywhere, >= 0.
    [[nodiscard]] S log_excess(const Vec2<S>& z) const {
        const std::uint16_t count = mean_[cell(z)];
        return count > 0 ? ln(S(S(1) + scalar_from<S>(dsp::Fixed<kMeanBits>::from_raw(count)) * per_count_))
                         : S(0);
    }

    /// A measurement turned out to be nobody's.
    void add(const Vec2<S>& z) {
        constexpr std::uint16_t kOnce = (1 << kMeanBits) / kMemory;
        std::uint16_t& mean = mean_[cell(z)];
        mean = mean <= 0xFFFF - kOnce ? static_cast<std::uint16_t>(mean + kOnce) : std::uint16_t{0xFFFF};
    }

    /// Once a frame: forgets with a time constant of kMemory frames. One band a frame. Rounds so that nothing
    /// stays.
    void forget() {
        constexpr int kShare = kMemory / kBands;
        for (std::size_t i = 0; i < kRates; ++i) {
            std::uint16_t& mean = mean_[static_cast<std::size_t>(band_) * kRates + i];
            mean = static_cast<std::uint16_t>(mean - (mean + kShare - 1) / kShare);
        }
        band_ = (band_ + 1) % kBands;
    }

    void reset() {
        mean_.fill(0);
        band_ = 0;
    }

  private:
    static constexpr int kMemory = 64;
    static constexpr int kMeanBits = 12;  ///< of the fraction of a mean, which saturates at 16 a frame

    /// What is off the map, however far, counts at its edge.
    [[nodiscard]] std::size_t cell(const Vec2<S>& z) const {
        const int band = floor_of_product(z[0], constant<S>(1, kBandM), kBands - 1);
        const int rate = floor_of_product(S(z[1] + half_span_), per_rate_, kRates - 1);
        return static_cast<std::size_t>(band * kRates + rate);
    }

    S half_span_;
    S per_rate_;
    S per_count_;
    std::array<std::uint16_t, std::size_t{kBands} * kRates> mean_{};  ///< detections a frame
    int band_ = 0;                                                    // to be forgotten next
};

}  // namespace tracking
