/// The result of a run for people and for scripts.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "host_sim/simulation.hpp"

namespace sim {

/// Keys frames, scenario, tracker, bus, can_frames, dropped_frames, overruns, targets, confirmed_tracks,
/// false_tracks, id_switches, range_rmse_m, velocity_rmse_mps, gospa_mean, first_confirmation_s (the longest
/// over the targets), faults (names), and of the same run stationary_tracks, brief_id_switches, track_losses,
/// never_confirmed, gospa_localisation_m2, gospa_missed_m2, gospa_false_m2. What needs the truth is null
/// where there is none.
nlohmann::ordered_json to_json(const SimulationResult& result);

/// Some lines of text, with `simulated_s` seconds in `took_s` seconds of the PC.
std::string to_text(const SimulationResult& result, double simulated_s, double took_s);

}  // namespace sim
