/// What is true: where everything is at a time, what of it a radar of this kind can detect, and which echoes
/// it therefore receives.
#pragma once

#include <cstdint>
#include <vector>

#include "host_sim/beat_synthesis.hpp"
#include "host_sim/scenario.hpp"
#include "host_sim/traffic.hpp"

namespace sim {

/// An object at the middle of a frame.
struct TruthObject {
    int id = 0;  ///< stays the object's own; posts count on from kFirstPostId
    double range_m = 0;
    double range_rate_mps = 0;
    double snr_db = 0;        ///< integrated, mean
    bool stationary = false;  ///< a post: a real thing, but none that must be tracked
    /// Must be seen: within the map and kDetectableSnr_db above the noise. Others may be seen.
    bool detectable = false;
};

inline constexpr int kFirstPostId = 1'000'000;
/// Two Hann windows cost 3.5 dB and up to 2.8 dB between two cells; OS-CFAR at 1e-4 asks for 11.6 dB.
inline constexpr double kDetectableSnr_db = 20;

struct Ego {
    double speed_mps = 0;
    double acceleration_mps2 = 0;
};

class World {
  public:
    World(Scenario scenario, std::uint64_t seed);
    /// Recorded objects take the place of the scenario's targets, and the recorded speed that of its ego.
    World(Scenario scenario, std::uint64_t seed, std::vector<TrafficObject> traffic,
          std::vector<SpeedSample> ego);

    [[nodiscard]] const Scenario& scenario() const { return scenario_; }
    /// Number of frames until the scenario or the recording ends.
    [[nodiscard]] std::uint64_t frames() const;
    [[nodiscard]] double frame_start_s(std::uint64_t index) const;
    /// When detections are valid: the middle of the chirps, 1.024 ms after the start with the default
    /// waveform.
    [[nodiscard]] double frame_middle_s(std::uint64_t index) const;

    [[nodiscard]] Ego ego_at(double time_s) const;
    /// Targets in view, then posts, at a time.
    [[nodiscard]] std::vector<TruthObject> truth_at(double time_s) const;
    /// What the antenna receives in a frame, with fluctuation, road and false echoes drawn for it. Echoes of
    /// equal range rate are neighbours.
    [[nodiscard]] std::vector<Echo> echoes(std::uint64_t index) const;
    [[nodiscard]] std::vector<Interference> bursts(std::uint64_t index) const;

  private:
    struct Reflector {
        int id = 0;
        double range_m = 0;
        double range_rate_mps = 0;
        double rcs_dbsm = 0;
        Fluctuation fluctuation = Fluctuation::none;
    };
    [[nodiscard]] std::vector<Reflector> reflectors_at(double time_s) const;
    void add_reflector(std::vector<Reflector>& list, int id, double along_m, double lateral_m,
                       double along_mps, double rcs_dbsm, Fluctuation fluctuation) const;
    void add_road(double speed_mps, Random& random, std::vector<Echo>& list) const;

    Scenario scenario_;
    std::uint64_t seed_;
    std::vector<TrafficObject> traffic_;
    std::vector<SpeedSample> ego_speed_;
    double range_cell_m_;
    double rate_cell_mps_;
    double coupling_s_;
};

}  // namespace sim
