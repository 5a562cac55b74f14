/// The description of the bus for everybody else's tools.
#pragma once

#include <string>

namespace sim {

/// `can/signals.hpp` as a DBC file: messages, signals, units, ranges, comments, value tables, cycle times and
/// E2E data ids. A message with several identifiers becomes as many messages, numbered from 00.
/// `can/radar.dbc` is this text; numbers are written as exact decimals.
std::string dbc_text();

}  // namespace sim
