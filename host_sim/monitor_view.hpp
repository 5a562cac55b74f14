/// What a BusMonitor knows, for the terminal and for other programs.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "host_sim/bus_monitor.hpp"

namespace sim {

/// One line for the newest object list: time, health, warning, objects.
std::string cycle_line(const BusMonitor& monitor);
/// The same as a table, a line an object.
std::string cycle_table(const BusMonitor& monitor);
/// Every count, at the end.
std::string summary_text(const BusMonitor& monitor);
/// The same with stable names: frames, duration_s, bus_load, radar, lists, errors, other.
nlohmann::ordered_json summary_json(const BusMonitor& monitor);
/// Load of the bus with `objects` objects in each list, message by message, and its sum beside the bar of 40
/// %.
std::string bus_load_text(int objects);

}  // namespace sim
