#include "host_sim/world.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "host_sim/portable_math.hpp"

namespace sim {

namespace {

enum Purpose : std::uint64_t { kFluctuation = 16, kRoad = 17, kFalseEchoes = 18 };

constexpr double kTrafficRcs_dbsm = 10;
/// Echoes below this change nothing that could be measured.
constexpr double kFaintest_db = -20;

double offset_m(const Scenario& scenario) {
    return static_cast<double>(scenario.waveform.range_offset_um) * 1e-6;
}

}  // namespace

World::World(Scenario scenario, std::uint64_t seed) : World(std::move(scenario), seed, {}, {}) {}

World::World(Scenario scenario, std::uint64_t seed, std::vector<TrafficObject> traffic,
             std::vector<SpeedSample> ego)
    : scenario_(std::move(scenario)),
      seed_(seed),
      traffic_(std::move(traffic)),
      ego_speed_(std::move(ego)),
      range_cell_m_(static_cast<double>(scenario_.waveform.range_cell_um()) * 1e-6),
      rate_cell_mps_(static_cast<double>(scenario_.waveform.rate_cell_umps()) * 1e-6),
      coupling_s_(static_cast<double>(scenario_.waveform.coupling_ns()) * 1e-9) {
    if (!traffic_.empty()) {
        scenario_.targets.clear();
        scenario_.duration_s = 0;
        for (const auto& object : traffic_)
            scenario_.duration_s = std::max(scenario_.duration_s, object.samples.back().time_s);
    }
}

double World::frame_start_s(std::uint64_t index) const {
    return static_cast<double>(index) * scenario_.waveform.period_ms / 1000;
}

double World::frame_middle_s(std::uint64_t index) const {
    return frame_start_s(index) +
           dsp::kChirps / 2.0 * static_cast<double>(scenario_.waveform.chirp_interval_ns) * 1e-9;
}

std::uint64_t World::frames() const {
    const double frames = scenario_.duration_s * 1000 / scenario_.waveform.period_ms;
    return static_cast<std::uint64_t>(std::max(1.0, std::floor(frames + 1e-6)));
}

Ego World::ego_at(double time_s) const {
    if (ego_speed_.empty()) return {scenario_.ego.speed_at(time_s), scenario_.ego.acceleration_at(time_s)};
    constexpr double kStep_s = 0.1;
    const double now = speed_at(ego_speed_, time_s);
    return {now, (now - speed_at(ego_speed_, time_s - kStep_s)) / kStep_s};
}

void World::add_reflector(std::vector<Reflector>& list, int id, double along_m, double lateral_m,
                          double along_mps, double rcs_dbsm, Fluctuation fluctuation) const {
    const Phasor edge = phasor(scenario_.front_end.field_of_view_deg / 720);
    if (along_m <= 0 || std::fabs(lateral_m) * edge.re > along_m * edge.im) return;
    const double range = std::sqrt(along_m * along_m + lateral_m * lateral_m);
    list.push_back({id, range, along_mps * along_m / range, rcs_dbsm, fluctuation});
}

std::vector<World::Reflector> World::reflectors_at(double time_s) const {
    std::vector<Reflector> list;
    for (std::size_t i = 0; i < traffic_.size(); ++i) {
        if (const auto s = traffic_[i].at(time_s))
            list.push_back(
                {static_cast<int>(i), s->range_m, s->range_rate_mps, kTrafficRcs_dbsm, Fluctuation::none});
    }
    const double ego_speed = ego_at(time_s).speed_mps;
    const double ego_distance = scenario_.ego.distance_at(time_s);
    for (std::size_t i = 0; i < scenario_.targets.size(); ++i) {
        const TargetPlan& t = scenario_.targets[i];
        if (time_s < t.motion.start_s || time_s >= t.end_s) continue;
        const double along = t.range_m + t.motion.distance_at(time_s) -
                             (ego_distance - scenario_.ego.distance_at(t.motion.start_s));
        add_reflector(list, static_cast<int>(i), along, t.lateral_m, t.motion.speed_at(time_s) - ego_speed,
                      t.rcs_dbsm, t.fluctuation);
    }
    if (scenario_.guard_rail) {
        const GuardRail& rail = *scenario_.guard_rail;
        const double farthest = offset_m(scenario_) + range_cell_m_ * dsp::kRangeCells;
        const auto first = static_cast<int>(std::floor(ego_distance / rail.spacing_m)) + 1;
        for (int i = first; i * rail.spacing_m - ego_distance < farthest; ++i) {
            add_reflector(list, kFirstPostId + i, i * rail.spacing_m - ego_distance, rail.lateral_m,
                          -ego_speed, rail.rcs_dbsm, Fluctuation::none);
        }
    }
    return list;
}

std::vector<TruthObject> World::truth_at(double time_s) const {
    std::vector<TruthObject> list;
    for (const Reflector& r : reflectors_at(time_s)) {
        TruthObject& t = list.emplace_back();
        t.id = r.id;
        t.range_m = r.range_m;
        t.range_rate_mps = r.range_rate_mps;
        t.snr_db = integrated_snr_db(scenario_.front_end, r.rcs_dbsm, r.range_m);
        t.stationary = r.id >= kFirstPostId;
        const double cell =
            (r.range_m + coupling_s_ * r.range_rate_mps - offset_m(scenario_)) / range_cell_m_;
        t.detectable = !t.stationary && cell >= 1 && cell <= dsp::kRangeCells - 1 &&
                       std::fabs(r.range_rate_mps) <= (dsp::kDopplerCells / 2.0 - 1) * rate_cell_mps_ &&
                       t.snr_db >= kDetectableSnr_db;
    }
    return list;
}

void World::add_road(double speed_mps, Random& random, std::vector<Echo>& list) const {
    const RoadSurface& road = *scenario_.road;
    const double step_m = range_cell_m_ / 2;
    const double area_db =
        road.gamma_db + db_from_power(road.height_m * step_m * road.beam_width_deg * std::numbers::pi / 180);
    const double farthest = offset_m(scenario_) + range_cell_m_ * dsp::kRangeCells;
    double range = road.nearest_m;
    while (range < farthest) {
        const double snr_db = integrated_snr_db(scenario_.front_end, area_db, range);
        if (snr_db < kFaintest_db) break;
        // The car moves by many wavelengths from frame to frame: a new speckle each time.
        const double power = random.exponential();
        list.push_back({range, -speed_mps, power_from_db(snr_db) * power, random.uniform()});
        range += step_m;
    }
}

std::vector<Echo> World::echoes(std::uint64_t index) const {
    std::vector<Echo> list;
    const double time_s = frame_start_s(index);
    for (const Reflector& r : reflectors_at(time_s)) {
        const double snr_db = integrated_snr_db(scenario_.front_end, r.rcs_dbsm, r.range_m);
        double snr = power_from_db(snr_db);
        if (r.fluctuation == Fluctuation::swerling1) {
            Random random(seed_, kFluctuation + (static_cast<std::uint64_t>(r.id) << 8), index);
            snr *= random.exponential();
        }
        if (snr_db > kFaintest_db) list.push_back({r.range_m, r.range_rate_mps, snr, 0});
    }
    if (scenario_.road) {
        Random random(seed_, kRoad, index);
        add_road(ego_at(time_s).speed_mps, random, list);
    }
    Random random(seed_, kFalseEchoes, index);
    const int false_echoes = random.poisson(scenario_.false_echoes.per_frame);
    for (int i = 0; i < false_echoes; ++i) {
        const double range =
            offset_m(scenario_) + (1 + random.uniform() * (dsp::kRangeCells - 2)) * range_cell_m_;
        const double rate = (random.uniform() - 0.5) * (dsp::kDopplerCells - 2) * rate_cell_mps_;
        list.push_back({range - coupling_s_ * rate, rate, power_from_db(scenario_.false_echoes.snr_db),
                        random.uniform()});
    }
    return list;
}

std::vector<Interference> World::bursts(std::uint64_t index) const {
    std::vector<Interference> list;
    const double time_s = frame_start_s(index);
    for (const Interference& i : scenario_.interference)
        if (time_s >= i.start_s && time_s < i.end_s) list.push_back(i);
    return list;
}

}  // namespace sim
