/// What the signal processing hands to the tracker.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "dsp/fixed_point.hpp"

namespace dsp {

inline constexpr int kMaxDetections = 64;

/// One target echo: grouped, interpolated, range-Doppler coupling removed. Time of validity: the middle of
/// the frame.
struct Detection {
    Real range_m;
    Real range_rate_mps;  ///< dr/dt, negative when closing
    Real range_variance_m2;
    Real rate_variance_m2ps2;
    Real snr_db;  ///< peak cell over the local noise estimate
    std::uint8_t range_cell = 0;
    std::uint8_t doppler_cell = 0;  ///< 0..63, 0 is standstill, 63 is one cell closing
};

/// At most kMaxDetections, strongest first. Those that did not fit are counted, never silently dropped.
struct DetectionList {
    std::array<Detection, kMaxDetections> item{};
    int count = 0;
    int dropped = 0;

    [[nodiscard]] std::span<const Detection> view() const {
        return {item.data(), static_cast<std::size_t>(count)};
    }
};

}  // namespace dsp
