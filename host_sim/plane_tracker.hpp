/// Existence-based tracker of targets in a plane, x = [x y vx vy], in double: what the 2013 and the 2020
/// paper simulate. Any number of tracks; clusters go to the solvers of tracking/.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "tracking/associator.hpp"
#include "tracking/imm.hpp"
#include "tracking/jipda.hpp"

namespace sim {

struct PlaneMeasurement {
    tracking::Vec2<double> z;
    double amplitude = 0;  ///< detector output in units of the mean clutter output
};

struct PlaneTrack {
    int id = 0;
    tracking::VecN<double, 4> x;
    tracking::MatN<double, 4> covariance;
    double existence = 0;
    bool confirmed = false;  ///< stays so until the track ends
    int age = 0;             ///< frames since the start
    int misses = 0;          ///< frames in a row with an empty gate
};

enum class TrackStart : std::uint8_t {
    one_point,  ///< at each measurement, at rest, any velocity up to the largest
    two_point,  ///< at each pair of measurements of two frames that a target could have made
};

/// Which measurements may start tracks.
enum class StartFrom : std::uint8_t {
    outside_all_gates,  ///< nobody's
    untaken,            ///< not taken by a confirmed track: its sum of psi beta over them is below one half
};

struct PlaneTrackerConfig {
    tracking::LinearMode<double, 4> motion;
    double period_s = 1;
    double sigma = 1;  ///< of a measurement, each axis
    double gate = 16;  ///< g^2
    double detection_probability = 0.9;
    double clutter_density = 1e-4;  ///< per unit of area
    /// Clutter density from the measurements in each gate, less the one expected of the target, in place of
    /// clutter_density.
    bool nonparametric = false;
    /// Mean target amplitude is 1 + snr. Of the rank-based associators, and of the others if `use_amplitude`.
    double snr = 0;
    double threshold = 0;  ///< of the detector
    bool use_amplitude = false;

    tracking::Associator associator = tracking::Associator::jipda;
    std::optional<tracking::IhpdaConfig> sharing;  ///< of the rank-based associators, in place of their own
    tracking::IjipdaConfig iterative;  ///< of ijipda; and what a cluster too large for exact jipda gets

    TrackStart start = TrackStart::two_point;
    StartFrom start_from = StartFrom::outside_all_gates;
    double max_speed = 60;
    double initial_existence = 0.1;
    tracking::ExistenceChain<double> chain;
    double confirm = 0.995;
    double drop = 0.01;
    double merge = 1;  ///< squared distance in the joint covariance

    [[nodiscard]] bool valid() const;
};

/// What happened in one frame.
struct PlaneReport {
    int tracks = 0;
    int cluster_tracks = 0;           ///< of the largest cluster
    int cluster_measurements = 0;     ///< of the same
    int split = 0;                    ///< clusters with more tracks than a solver takes, cut by existence
    int inexact = 0;                  ///< clusters that exact jipda refused: iterative JIPDA to its budget
    int level = tracking::kMaxLevel;  ///< lowest level of iterative JIPDA; kMaxLevel: exact
};

class PlaneTracker {
  public:
    /// Throws std::invalid_argument unless valid().
    explicit PlaneTracker(const PlaneTrackerConfig& config);
    ~PlaneTracker();

    PlaneReport step(std::span<const PlaneMeasurement> measurements);
    [[nodiscard]] const std::vector<PlaneTrack>& tracks() const { return tracks_; }

  private:
    struct Scratch;
    void associate(std::span<const PlaneMeasurement> measurements, PlaneReport& report);
    void solve(std::span<const std::size_t> cluster, std::span<const PlaneMeasurement> measurements,
               PlaneReport& report);
    void start(std::span<const PlaneMeasurement> measurements);
    void merge();

    PlaneTrackerConfig config_;
    std::vector<PlaneTrack> tracks_;
    std::vector<tracking::AssociationRow<double>> rows_;  ///< of tracks_, measurement indices of the frame
    std::vector<double> taken_;                           ///< of each measurement, by confirmed tracks
    std::vector<bool> gated_;
    std::vector<PlaneMeasurement> pending_;  ///< of the last frame, that a pair may begin with
    std::unique_ptr<Scratch> scratch_;
    int last_id_ = 0;
};

}  // namespace sim
