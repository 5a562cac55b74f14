/// Runs of the radar in its simulated world, for tests and measurements.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "host_sim/simulation.hpp"

namespace sim_test {

/// A shipped scenario, without console lines; all of it if `frames` is not given.
inline sim::SimulationOptions quiet(const std::string& scenario, std::optional<std::uint64_t> frames = {},
                                    std::uint64_t seed = 1) {
    sim::SimulationOptions o;
    o.scenario = sim::load_scenario(scenario);
    o.frames = frames;
    o.seed = seed;
    o.quiet = true;
    return o;
}

/// To the end.
inline sim::SimulationResult simulate(const sim::SimulationOptions& options) {
    sim::Simulation simulation(options);
    while (simulation.step()) {
    }
    return simulation.result();
}

}  // namespace sim_test
