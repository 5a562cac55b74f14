/// Infrared image sequences of the 2013 paper's kind, and their point targets found again.
#pragma once

#include <cstdint>
#include <vector>

#include "host_sim/plane_tracker.hpp"

namespace sim {

inline constexpr int kImageWidth = 1500;
inline constexpr int kImageHeight = 600;
inline constexpr int kInfraredFrames = 105;

struct InfraredTarget {
    int id = 0;         ///< from 1
    int formation = 0;  ///< 1 flies to the right, 2 to the left, 0 alone
    tracking::Vec2<double> position;
};

/// Where the targets of a frame (from 1) are: two formations of seven appear in frame 6 at 320 pixels from
/// each other, fly 20 pixels a frame and pass through each other in frames 13 to 15; three more come alone.
std::vector<InfraredTarget> infrared_targets(int frame);

/// A frame of run `index`, row by row: background, white noise of standard deviation 1, the targets and
/// flashes of clutter, blurred to a point spread of 0.8 pixels.
std::vector<float> infrared_image(std::uint64_t seed, std::uint64_t index, int frame);

/// Point targets of an image: matched filter against the local mean, two-dimensional OS-CFAR on its square
/// with the 24 cells of a ring, local maxima, interpolated. amplitude: filter output squared, over its mean
/// in noise.
std::vector<PlaneMeasurement> detect_points(const std::vector<float>& image);

/// Flashes of clutter a frame, and false alarms of the detector in noise alone (measured).
inline constexpr double kFlashes = 8;
inline constexpr double kNoiseAlarms = 1.3;

}  // namespace sim
