/// What goes into a tracker and what comes out.
#pragma once

#include <cstdint>

#include "tracking/scalar.hpp"

namespace tracking {

inline constexpr int kMaxConfirmed = 16;
inline constexpr int kMaxTracks = 32;  ///< tentative ones included
inline constexpr int kMaxMeasurements = 64;

/// One detection as the tracker sees it: z = [range m, range rate m/s] with independent errors.
template <class S>
struct Measurement {
    Vec2<S> z = Vec2<S>::Zero();
    Vec2<S> variance = Vec2<S>::Ones();  ///< [m^2, (m/s)^2]
    S snr_db = S(0);
};

enum class TrackState : std::uint8_t { free = 0, tentative, confirmed, coasting };

/// State x = [range m, range rate m/s] with covariance, valid at the time of the frame just processed.
template <class S>
struct Track {
    std::uint8_t id = 0;  ///< 1..255; not given again until every other id was used
    TrackState state = TrackState::free;
    Vec2<S> x = Vec2<S>::Zero();
    Mat2<S> covariance = Mat2<S>::Identity();
    S existence = S(0);        ///< 0..1
    S snr_db = S(0);           ///< smoothed, of the measurements that updated it
    std::uint16_t age = 0;     ///< frames since its first measurement, saturating
    std::uint8_t hits = 0;     ///< frames in which it was measured, saturating
    std::uint8_t misses = 0;   ///< frames in a row in which it was not, saturating
    std::uint8_t overlap = 0;  ///< frames in a row in which it could not be told from an older track
    bool measured = false;  ///< took a measurement in this frame: the prediction's weight was below one half

    [[nodiscard]] bool is_confirmed() const {
        return state == TrackState::confirmed || state == TrackState::coasting;
    }
};

}  // namespace tracking
