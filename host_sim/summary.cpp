#include "host_sim/summary.hpp"

#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>

namespace sim {

nlohmann::ordered_json to_json(const SimulationResult& r) {
    const MetricsSummary& m = r.metrics;
    const auto if_truth = [&r](auto value) {
        return r.has_truth ? nlohmann::ordered_json(value) : nlohmann::ordered_json();
    };
    const bool measured = r.has_truth && m.targets > m.never_confirmed;
    const auto if_measured = [measured](double value) {
        return measured ? nlohmann::ordered_json(value) : nlohmann::ordered_json();
    };
    nlohmann::ordered_json json;
    json["frames"] = r.frames;
    json["scenario"] = r.scenario;
    json["tracker"] = r.tracker;
    json["bus"] = r.bus;
    json["can_frames"] = r.can_frames;
    json["dropped_frames"] = r.dropped_frames;
    json["overruns"] = r.overruns;
    json["targets"] = if_truth(m.targets);
    json["confirmed_tracks"] = m.confirmed_tracks;
    json["false_tracks"] = if_truth(m.false_tracks);
    json["id_switches"] = if_truth(m.id_switches);
    json["range_rmse_m"] = if_measured(m.range_rmse_m);
    json["velocity_rmse_mps"] = if_measured(m.velocity_rmse_mps);
    json["gospa_mean"] = if_truth(m.gospa.distance);
    json["first_confirmation_s"] = if_measured(m.first_confirmation_s.value_or(0));
    json["faults"] = fault_names(r.faults);
    json["stationary_tracks"] = if_truth(m.stationary_tracks);
    json["brief_id_switches"] = if_truth(m.brief_id_switches);
    json["track_losses"] = if_truth(m.track_losses);
    json["never_confirmed"] = if_truth(m.never_confirmed);
    json["gospa_localisation_m2"] = if_truth(m.gospa.localisation);
    json["gospa_missed_m2"] = if_truth(m.gospa.missed);
    json["gospa_false_m2"] = if_truth(m.gospa.false_tracks);
    return json;
}

std::string to_text(const SimulationResult& r, double simulated_s, double took_s) {
    const MetricsSummary& m = r.metrics;
    std::ostringstream out;
    out << std::fixed;
    out << r.scenario << ", tracker " << r.tracker << ", bus " << r.bus << ": " << r.frames << " frames";
    if (took_s > 0) {
        out << std::setprecision(1) << " (" << simulated_s << " s) in " << std::setprecision(2) << took_s
            << " s, " << std::setprecision(0) << simulated_s / took_s << " x real time";
    }
    out << "\n  CAN: " << r.can_frames << " frames sent, " << r.dropped_frames << " dropped; overruns "
        << r.overruns << "\n";
    out << "  confirmed tracks: " << m.confirmed_tracks;
    if (r.has_truth) {
        out << ", of these false " << m.false_tracks << ", of stationary posts " << m.stationary_tracks
            << "\n";
        out << "  targets: " << m.targets << ", never confirmed " << m.never_confirmed << ", lost "
            << m.track_losses << ", identity switches " << m.id_switches << " (and brief ones "
            << m.brief_id_switches << ")";
        if (m.first_confirmation_s)
            out << ", confirmed at most " << std::setprecision(1) << *m.first_confirmation_s
                << " s after being detectable";
        out << "\n";
        if (m.targets > m.never_confirmed) {
            out << std::setprecision(3) << "  RMSE: range " << m.range_rmse_m << " m, range rate "
                << m.velocity_rmse_mps << " m/s\n";
        }
        out << std::setprecision(2) << "  GOSPA (c 10 m, p 2): " << m.gospa.distance
            << " m; squared parts: localisation " << m.gospa.localisation << ", missed " << m.gospa.missed
            << ", false " << m.gospa.false_tracks << " m^2";
    }
    out << "\n";
    const auto faults = fault_names(r.faults);
    out << "  faults: ";
    for (const auto& name : faults) out << name << ' ';
    out << (faults.empty() ? "none" : "") << "\n";
    return out.str();
}

}  // namespace sim
