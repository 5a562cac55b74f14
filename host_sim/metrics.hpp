/// How well the confirmed tracks describe the truth.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "host_sim/world.hpp"

namespace sim {

/// One confirmed track as a consumer sees it.
struct TrackEstimate {
    int id = 0;
    double range_m = 0;
    double range_rate_mps = 0;
};

struct MetricsConfig {
    /// Distance between track and truth: sqrt(dr^2 + (rate_weight dv)^2); two crossing vehicles differ in
    /// velocity.
    double rate_weight_s = 2;
    double cutoff_m = 10;     ///< GOSPA's c: from here a track is not of this object
    double order = 2;         ///< GOSPA's p; alpha is 2
    int lasting_frames = 10;  ///< a switch of identity that is undone sooner is a brief one
    int loss_frames = 5;      ///< a target untracked this long was lost
};

/// Generalised optimal sub-pattern assignment (Rahmathullah, Garcia-Fernandez and Svensson 2017), alpha = 2.
/// All parts are in metres to the power p, and distance^p = localisation + missed + false_tracks.
struct Gospa {
    double distance = 0;
    double localisation = 0;
    double missed = 0;
    double false_tracks = 0;
};

/// One target over the run.
struct TargetReport {
    int id = 0;
    double detectable_from_s = 0;
    std::optional<double> confirmed_after_s;  ///< from being detectable to the first confirmed track
    int detectable_frames = 0;
    int tracked_frames = 0;  ///< of the detectable ones
    int losses = 0;    ///< had a track and then none for loss_frames, or a new one after the old was deleted
    int switches = 0;  ///< the track's id changed to stay, while the old track lived on
    int brief_switches = 0;
    double range_square_sum = 0;
    double rate_square_sum = 0;
};

struct MetricsSummary {
    int frames = 0;
    int targets = 0;          ///< ever detectable
    int never_confirmed = 0;  ///< of these
    int confirmed_tracks = 0;
    int false_tracks = 0;       ///< confirmed tracks that were nobody's for more than half of their frames
    int stationary_tracks = 0;  ///< confirmed tracks of posts
    int id_switches = 0;
    int brief_id_switches = 0;
    int track_losses = 0;
    double range_rmse_m = 0;
    double velocity_rmse_mps = 0;
    Gospa gospa;                                 ///< mean over the frames, part by part
    std::optional<double> first_confirmation_s;  ///< the longest over the targets that were confirmed
};

class Metrics {
  public:
    explicit Metrics(const MetricsConfig& config = {}) : config_(config) {}

    /// The assignment of one frame: for each truth object the index of its track, or kUnassigned. Detectable
    /// targets choose first, then other targets, then posts: a track of something that need not be tracked is
    /// not false.
    struct Assignment {
        std::vector<int> track_of_truth;
        std::vector<int> truth_of_track;
    };
    [[nodiscard]] Assignment match(std::span<const TruthObject> truth,
                                   std::span<const TrackEstimate> tracks) const;
    /// Of the detectable targets, and the tracks that are of nothing else.
    [[nodiscard]] Gospa gospa(std::span<const TruthObject> truth, std::span<const TrackEstimate> tracks,
                              const Assignment& assignment) const;

    void add_frame(double time_s, std::span<const TruthObject> truth, std::span<const TrackEstimate> tracks);

    [[nodiscard]] MetricsSummary summary() const;
    [[nodiscard]] std::vector<TargetReport> targets() const;

  private:
    struct Identity {
        TargetReport report;
        int settled = 0;  ///< id that counts as the target's, 0: none
        int rival = 0;
        int rival_frames = 0;
        int untracked_frames = 0;
    };
    struct Life {
        int frames = 0;
        int stationary = 0;
        int nobody = 0;
        bool present = false;
    };
    [[nodiscard]] double distance_m(const TruthObject& truth, const TrackEstimate& track) const;
    void follow(Identity& target, const TrackEstimate* track, std::span<const TrackEstimate> tracks) const;
    void count(const Life& life, MetricsSummary& summary) const;

    MetricsConfig config_;
    std::map<int, Identity> targets_;
    std::map<int, Life> lives_;
    MetricsSummary ended_;  ///< tracks that are gone, sums of GOSPA
};

}  // namespace sim
