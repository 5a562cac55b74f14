#include "host_sim/traffic.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "host_sim/csv.hpp"

namespace sim {

std::optional<TrafficSample> TrafficObject::at(double time_s) const {
    const auto after = std::lower_bound(samples.begin(), samples.end(), time_s,
                                        [](const TrafficSample& s, double t) { return s.time_s < t; });
    if (after == samples.end() || (after == samples.begin() && after->time_s > time_s)) return std::nullopt;
    if (after == samples.begin()) return *after;
    const auto before = after - 1;
    const double span = after->time_s - before->time_s;
    const double share = span > 0 ? (time_s - before->time_s) / span : 0;
    return TrafficSample{time_s, before->range_m + share * (after->range_m - before->range_m),
                         before->range_rate_mps + share * (after->range_rate_mps - before->range_rate_mps)};
}

std::vector<TrafficObject> read_traffic(const std::filesystem::path& file) {
    const auto rows = read_csv(file, {"time_s", "track_id", "range_m", "range_rate_mps"});
    require_ascending(file, rows, 0, "time_s");
    std::vector<TrafficObject> objects;
    std::map<int, std::size_t> current;
    for (const auto& row : rows) {
        const TrafficSample sample{row[0], row[2], row[3]};
        if (sample.range_m < 0) throw InputError(file.string() + ": range_m: is negative");
        const int id = static_cast<int>(row[1]);
        const auto it = current.find(id);
        const TrafficSample* last = it == current.end() ? nullptr : &objects[it->second].samples.back();
        if (last == nullptr || sample.time_s - last->time_s > kTrafficGap_s ||
            std::fabs(sample.range_m - last->range_m) > kTrafficJump_m) {
            current[id] = objects.size();
            objects.push_back({id, {}});
        }
        objects[current[id]].samples.push_back(sample);
    }
    return objects;
}

std::vector<SpeedSample> read_ego_speed(const std::filesystem::path& file) {
    const auto rows = read_csv(file, {"time_s", "speed_mps"});
    require_ascending(file, rows, 0, "time_s");
    std::vector<SpeedSample> samples;
    for (const auto& row : rows) samples.push_back({row[0], row[1]});
    return samples;
}

double speed_at(const std::vector<SpeedSample>& samples, double time_s) {
    if (samples.empty()) return 0;
    const auto after = std::lower_bound(samples.begin(), samples.end(), time_s,
                                        [](const SpeedSample& s, double t) { return s.time_s < t; });
    if (after == samples.begin()) return samples.front().speed_mps;
    if (after == samples.end()) return samples.back().speed_mps;
    const auto before = after - 1;
    const double share = (time_s - before->time_s) / std::max(1e-9, after->time_s - before->time_s);
    return before->speed_mps + share * (after->speed_mps - before->speed_mps);
}

}  // namespace sim
