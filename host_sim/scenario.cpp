#include "host_sim/scenario.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <system_error>

namespace sim {

namespace {

constexpr Allowed kTime{0, 86400, "s"};
constexpr Allowed kSpeed{-100, 100, "m/s"};
constexpr Allowed kAcceleration{-20, 20, "m/s^2"};
constexpr Allowed kRcs{-60, 60, "dBsm"};
constexpr Allowed kLsb{0, 32767, "LSB"};

Motion parse_motion(JsonFields& fields, double start_s) {
    Motion motion;
    motion.start_s = start_s;
    motion.speed_mps = fields.number("speed_mps", kSpeed);
    motion.acceleration_mps2 = fields.pairs("acceleration_mps2", kTime, kAcceleration);
    const auto later = [](const auto& a, const auto& b) { return a.first >= b.first; };
    if (std::adjacent_find(motion.acceleration_mps2.begin(), motion.acceleration_mps2.end(), later) !=
        motion.acceleration_mps2.end()) {
        fields.fail("acceleration_mps2", "the times must ascend");
    }
    return motion;
}

dsp::Waveform parse_waveform(JsonFields fields) {
    const dsp::Waveform standard;
    dsp::Waveform w;
    w.carrier_hz = fields.integer("carrier_hz", {1e9, 300e9, "Hz"}, standard.carrier_hz);
    w.bandwidth_hz = fields.integer("bandwidth_hz", {1e6, 10e9, "Hz"}, standard.bandwidth_hz);
    w.sample_rate_hz = fields.integer("sample_rate_hz", {100e3, 100e6, "Hz"}, standard.sample_rate_hz);
    w.chirp_interval_ns = fields.integer("chirp_interval_ns", {1e3, 1e6, "ns"}, standard.chirp_interval_ns);
    w.range_offset_um = fields.integer("range_offset_um", {0, 100e6, "um"}, standard.range_offset_um);
    w.period_ms =
        static_cast<std::int32_t>(fields.integer("period_ms", {10, 1000, "ms"}, standard.period_ms));
    if (w.chirp_interval_ns < w.sampled_ns())
        fields.fail("chirp_interval_ns",
                    "shorter than the 64 samples of a chirp, " + std::to_string(w.sampled_ns()) + " ns");
    if (dsp::kChirps * w.chirp_interval_ns > std::int64_t{w.period_ms} * 1'000'000)
        fields.fail("period_ms", "shorter than 64 chirps");
    if (w.coupling_ns() >= 1'000'000'000)
        fields.fail("bandwidth_hz",
                    "too small: the Doppler shift would move the range by more than 1 s x range rate");
    fields.done();
    return w;
}

FrontEnd parse_front_end(JsonFields fields) {
    FrontEnd f;
    f.adc_bits = static_cast<int>(fields.integer("adc_bits", {6, 16, "bit"}, f.adc_bits));
    f.noise_lsb = fields.number("noise_lsb", {0.01, 1000, "LSB"}, f.noise_lsb);
    f.reference_snr_db = fields.number("reference_snr_db", {-50, 100, "dB"}, f.reference_snr_db);
    f.offset_lsb = fields.number("offset_lsb", {-32767, 32767, "LSB"}, f.offset_lsb);
    f.leakage_lsb = fields.number("leakage_lsb", kLsb, f.leakage_lsb);
    f.leakage_range_m = fields.number("leakage_range_m", {0, 10, "m"}, f.leakage_range_m);
    f.field_of_view_deg = fields.number("field_of_view_deg", {1, 180, "deg"}, f.field_of_view_deg);
    fields.done();
    return f;
}

TargetPlan parse_target(JsonFields fields, std::size_t index, double duration_s) {
    TargetPlan t;
    t.name = fields.text("name", std::to_string(index + 1));
    const double start_s = fields.number("start_s", kTime, 0);
    t.end_s = fields.number("end_s", kTime, duration_s);
    if (t.end_s <= start_s) fields.fail("end_s", "must be later than start_s");
    t.range_m = fields.number("range_m", {-1000, 5000, "m"});
    t.lateral_m = fields.number("lateral_m", {-100, 100, "m"}, 0);
    t.motion = parse_motion(fields, start_s);
    t.rcs_dbsm = fields.number("rcs_dbsm", kRcs, t.rcs_dbsm);
    const std::string fluctuation = fields.text("fluctuation", "none");
    if (fluctuation == "swerling1") {
        t.fluctuation = Fluctuation::swerling1;
    } else if (fluctuation != "none") {
        fields.fail("fluctuation", "unknown value \"" + fluctuation + "\"; known: none, swerling1");
    }
    fields.done();
    return t;
}

GuardRail parse_guard_rail(JsonFields fields) {
    GuardRail g;
    g.spacing_m = fields.number("spacing_m", {1, 1000, "m"}, g.spacing_m);
    g.lateral_m = fields.number("lateral_m", {0.5, 100, "m"}, g.lateral_m);
    g.rcs_dbsm = fields.number("rcs_dbsm", kRcs, g.rcs_dbsm);
    fields.done();
    return g;
}

RoadSurface parse_road(JsonFields fields) {
    RoadSurface r;
    r.gamma_db = fields.number("gamma_db", {-80, 0, "dB"}, r.gamma_db);
    r.height_m = fields.number("height_m", {0.1, 5, "m"}, r.height_m);
    r.beam_width_deg = fields.number("beam_width_deg", {0.1, 120, "deg"}, r.beam_width_deg);
    r.nearest_m = fields.number("nearest_m", {0.5, 100, "m"}, r.nearest_m);
    fields.done();
    return r;
}

Interference parse_interference(JsonFields fields, double duration_s) {
    Interference i;
    i.start_s = fields.number("start_s", kTime, 0);
    i.end_s = fields.number("end_s", kTime, duration_s);
    if (i.end_s <= i.start_s) fields.fail("end_s", "must be later than start_s");
    i.amplitude_lsb = fields.number("amplitude_lsb", kLsb);
    i.burst_us = fields.number("burst_us", {0.1, 1000, "us"}, i.burst_us);
    i.chirp_share = fields.number("chirp_share", {0, 1}, i.chirp_share);
    fields.done();
    return i;
}

FalseEchoes parse_false_echoes(JsonFields fields) {
    FalseEchoes f;
    f.per_frame = fields.number("per_frame", {0, 200});
    f.snr_db = fields.number("snr_db", {0, 80, "dB"}, f.snr_db);
    fields.done();
    return f;
}

}  // namespace

double Motion::speed_at(double time_s) const {
    double speed = speed_mps;
    for (std::size_t i = 0; i < acceleration_mps2.size(); ++i) {
        const double from = std::max(start_s, acceleration_mps2[i].first);
        const double to =
            i + 1 < acceleration_mps2.size() ? std::min(time_s, acceleration_mps2[i + 1].first) : time_s;
        if (to > from) speed += acceleration_mps2[i].second * (to - from);
    }
    return speed;
}

double Motion::distance_at(double time_s) const {
    double distance = speed_mps * (time_s - start_s);
    for (std::size_t i = 0; i < acceleration_mps2.size(); ++i) {
        const double from = std::max(start_s, acceleration_mps2[i].first);
        const double to =
            i + 1 < acceleration_mps2.size() ? std::min(time_s, acceleration_mps2[i + 1].first) : time_s;
        if (to <= from) continue;
        const double span = to - from;
        distance += acceleration_mps2[i].second * span * (span / 2 + (time_s - to));
    }
    return distance;
}

double Motion::acceleration_at(double time_s) const {
    double acceleration = 0;
    for (const auto& [from, value] : acceleration_mps2)
        if (from <= time_s) acceleration = value;
    return acceleration;
}

Scenario parse_scenario(const nlohmann::json& json, const std::string& place) {
    JsonFields fields(json, place);
    Scenario s;
    s.description = fields.text("description");
    s.duration_s = fields.number("duration_s", {0.1, 86400, "s"});
    if (fields.has("waveform")) s.waveform = parse_waveform(fields.object("waveform"));
    if (fields.has("front_end")) s.front_end = parse_front_end(fields.object("front_end"));
    JsonFields ego = fields.object("ego");
    s.ego = parse_motion(ego, 0);
    ego.done();
    const auto targets = fields.objects("targets");
    for (std::size_t i = 0; i < targets.size(); ++i)
        s.targets.push_back(parse_target(targets[i], i, s.duration_s));
    if (fields.has("guard_rail")) s.guard_rail = parse_guard_rail(fields.object("guard_rail"));
    if (fields.has("road")) s.road = parse_road(fields.object("road"));
    for (const auto& item : fields.objects("interference"))
        s.interference.push_back(parse_interference(item, s.duration_s));
    if (fields.has("false_echoes")) s.false_echoes = parse_false_echoes(fields.object("false_echoes"));
    fields.done();
    return s;
}

Scenario read_scenario(const std::filesystem::path& file) {
    Scenario s = parse_scenario(read_json_file(file), file.filename().string());
    s.name = file.stem().string();
    return s;
}

dsp::Waveform read_waveform(const std::filesystem::path& file) {
    const nlohmann::json json = read_json_file(file);
    return parse_waveform(JsonFields(json, file.filename().string()));
}

std::filesystem::path scenario_directory() {
    std::error_code none;
    const auto program = std::filesystem::read_symlink("/proc/self/exe", none);
    const auto installed = program.parent_path().parent_path() / "share/fmcw_radar/scenarios";
    return std::filesystem::is_directory(installed, none) ? installed
                                                          : std::filesystem::path(RADAR_SCENARIO_DIR);
}

std::vector<std::string> shipped_scenarios() {
    std::vector<std::string> names;
    std::error_code none;
    for (const auto& entry : std::filesystem::directory_iterator(scenario_directory(), none))
        if (entry.path().extension() == ".json") names.push_back(entry.path().stem().string());
    std::sort(names.begin(), names.end());
    return names;
}

Scenario load_scenario(const std::string& name_or_file) {
    if (std::filesystem::path(name_or_file).extension() == ".json") return read_scenario(name_or_file);
    const auto names = shipped_scenarios();
    if (std::find(names.begin(), names.end(), name_or_file) == names.end()) {
        std::string known;
        for (const auto& name : names) known += (known.empty() ? "" : ", ") + name;
        throw InputError("no scenario named \"" + name_or_file + "\"; shipped: " +
                         (known.empty() ? "none found in " + scenario_directory().string() : known) +
                         "; or give a file that ends in .json");
    }
    return read_scenario(scenario_directory() / (name_or_file + ".json"));
}

}  // namespace sim
