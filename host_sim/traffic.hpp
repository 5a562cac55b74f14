/// Recorded motion of other vehicles and of the own car, to synthesise beat signals from.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

namespace sim {

struct TrafficSample {
    double time_s = 0;
    double range_m = 0;
    double range_rate_mps = 0;
};

/// One object for as long as it was seen without a gap.
struct TrafficObject {
    int track_id = 0;  ///< of the recording
    std::vector<TrafficSample> samples;

    /// Between samples range and range rate are interpolated linearly; nothing outside of them.
    [[nodiscard]] std::optional<TrafficSample> at(double time_s) const;
};

/// A pause longer than this, or a jump farther than this, ends an object: a recording reuses its ids.
inline constexpr double kTrafficGap_s = 0.25;
inline constexpr double kTrafficJump_m = 5;

/// Columns time_s, track_id, range_m, range_rate_mps. Throws InputError.
std::vector<TrafficObject> read_traffic(const std::filesystem::path& file);

struct SpeedSample {
    double time_s = 0;
    double speed_mps = 0;
};
/// Columns time_s, speed_mps. Throws InputError.
std::vector<SpeedSample> read_ego_speed(const std::filesystem::path& file);
/// Linear between samples, constant outside.
double speed_at(const std::vector<SpeedSample>& samples, double time_s);

}  // namespace sim
