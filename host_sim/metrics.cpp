#include "host_sim/metrics.hpp"

#include <algorithm>
#include <cmath>

#include "host_sim/assignment.hpp"

namespace sim {

double Metrics::distance_m(const TruthObject& truth, const TrackEstimate& track) const {
    return std::hypot(track.range_m - truth.range_m,
                      config_.rate_weight_s * (track.range_rate_mps - truth.range_rate_mps));
}

Metrics::Assignment Metrics::match(std::span<const TruthObject> truth,
                                   std::span<const TrackEstimate> tracks) const {
    Assignment result{std::vector<int>(truth.size(), kUnassigned),
                      std::vector<int>(tracks.size(), kUnassigned)};
    const auto rank = [](const TruthObject& t) { return t.detectable ? 0 : (t.stationary ? 2 : 1); };
    const double cutoff = std::pow(config_.cutoff_m, config_.order);
    for (int turn = 0; turn < 3; ++turn) {
        std::vector<std::size_t> rows;
        std::vector<std::size_t> columns;
        for (std::size_t i = 0; i < truth.size(); ++i)
            if (rank(truth[i]) == turn) rows.push_back(i);
        for (std::size_t j = 0; j < tracks.size(); ++j)
            if (result.truth_of_track[j] == kUnassigned) columns.push_back(j);
        if (rows.empty() || columns.empty()) continue;
        CostMatrix cost(rows.size(), columns.size());
        for (std::size_t r = 0; r < rows.size(); ++r)
            for (std::size_t c = 0; c < columns.size(); ++c)
                cost(r, c) =
                    std::min(cutoff, std::pow(distance_m(truth[rows[r]], tracks[columns[c]]), config_.order));
        const auto column_of = assign(cost);
        for (std::size_t r = 0; r < rows.size(); ++r) {
            if (column_of[r] == kUnassigned) continue;
            const auto c = static_cast<std::size_t>(column_of[r]);
            if (cost(r, c) >= cutoff) continue;
            result.track_of_truth[rows[r]] = static_cast<int>(columns[c]);
            result.truth_of_track[columns[c]] = static_cast<int>(rows[r]);
        }
    }
    return result;
}

Gospa Metrics::gospa(std::span<const TruthObject> truth, std::span<const TrackEstimate> tracks,
                     const Assignment& assignment) const {
    Gospa g;
    const double penalty = std::pow(config_.cutoff_m, config_.order) / 2;
    for (std::size_t i = 0; i < truth.size(); ++i) {
        if (!truth[i].detectable) continue;
        if (const int j = assignment.track_of_truth[i]; j == kUnassigned) {
            g.missed += penalty;
        } else {
            g.localisation +=
                std::pow(distance_m(truth[i], tracks[static_cast<std::size_t>(j)]), config_.order);
        }
    }
    for (const int owner : assignment.truth_of_track)
        if (owner == kUnassigned) g.false_tracks += penalty;
    g.distance = std::pow(g.localisation + g.missed + g.false_tracks, 1 / config_.order);
    return g;
}

void Metrics::follow(Identity& target, const TrackEstimate* track,
                     std::span<const TrackEstimate> tracks) const {
    if (track == nullptr) {
        if (++target.untracked_frames == config_.loss_frames && target.settled != 0) {
            ++target.report.losses;
            target.settled = 0;
            target.rival_frames = 0;
        }
        return;
    }
    target.untracked_frames = 0;
    if (target.settled == 0) {
        target.settled = track->id;
    } else if (track->id == target.settled) {
        if (target.rival_frames > 0) ++target.report.brief_switches;
        target.rival_frames = 0;
    } else {
        if (target.rival_frames == 0 || track->id != target.rival) {
            target.rival = track->id;
            target.rival_frames = 0;
        }
        if (++target.rival_frames < config_.lasting_frames) return;
        const bool lives_on = std::any_of(tracks.begin(), tracks.end(),
                                          [&](const TrackEstimate& t) { return t.id == target.settled; });
        ++(lives_on ? target.report.switches : target.report.losses);
        target.settled = track->id;
        target.rival_frames = 0;
    }
}

void Metrics::count(const Life& life, MetricsSummary& summary) const {
    ++summary.confirmed_tracks;
    if (2 * life.nobody > life.frames) {
        ++summary.false_tracks;
    } else if (2 * life.stationary > life.frames) {
        ++summary.stationary_tracks;
    }
}

void Metrics::add_frame(double time_s, std::span<const TruthObject> truth,
                        std::span<const TrackEstimate> tracks) {
    ++ended_.frames;
    const Assignment assignment = match(truth, tracks);
    const Gospa g = gospa(truth, tracks, assignment);
    ended_.gospa.distance += g.distance;
    ended_.gospa.localisation += g.localisation;
    ended_.gospa.missed += g.missed;
    ended_.gospa.false_tracks += g.false_tracks;

    for (std::size_t i = 0; i < truth.size(); ++i) {
        if (!truth[i].detectable) continue;
        const auto [it, is_new] = targets_.try_emplace(truth[i].id);
        Identity& target = it->second;
        TargetReport& report = target.report;
        if (is_new) {
            report.id = truth[i].id;
            report.detectable_from_s = time_s;
        }
        ++report.detectable_frames;
        const int j = assignment.track_of_truth[i];
        const TrackEstimate* track = j == kUnassigned ? nullptr : &tracks[static_cast<std::size_t>(j)];
        follow(target, track, tracks);
        if (track == nullptr) continue;
        ++report.tracked_frames;
        report.range_square_sum += std::pow(track->range_m - truth[i].range_m, 2);
        report.rate_square_sum += std::pow(track->range_rate_mps - truth[i].range_rate_mps, 2);
        if (!report.confirmed_after_s) report.confirmed_after_s = time_s - report.detectable_from_s;
    }

    for (auto& [id, life] : lives_) life.present = false;
    for (std::size_t j = 0; j < tracks.size(); ++j) {
        Life& life = lives_[tracks[j].id];
        life.present = true;
        ++life.frames;
        const int owner = assignment.truth_of_track[j];
        if (owner == kUnassigned) {
            ++life.nobody;
        } else if (truth[static_cast<std::size_t>(owner)].stationary) {
            ++life.stationary;
        }
    }
    for (auto it = lives_.begin(); it != lives_.end();) {
        if (!it->second.present) {
            count(it->second, ended_);
            it = lives_.erase(it);
        } else {
            ++it;
        }
    }
}

MetricsSummary Metrics::summary() const {
    MetricsSummary s = ended_;
    for (const auto& [id, life] : lives_) count(life, s);
    double tracked = 0;
    for (const auto& [id, target] : targets_) {
        const TargetReport& report = target.report;
        ++s.targets;
        s.track_losses += report.losses;
        s.id_switches += report.switches;
        s.brief_id_switches += report.brief_switches;
        tracked += report.tracked_frames;
        s.range_rmse_m += report.range_square_sum;
        s.velocity_rmse_mps += report.rate_square_sum;
        if (!report.confirmed_after_s) {
            ++s.never_confirmed;
        } else {
            s.first_confirmation_s = std::max(s.first_confirmation_s.value_or(0), *report.confirmed_after_s);
        }
    }
    const double frames = std::max(1, s.frames);
    s.range_rmse_m = std::sqrt(s.range_rmse_m / std::max(1.0, tracked));
    s.velocity_rmse_mps = std::sqrt(s.velocity_rmse_mps / std::max(1.0, tracked));
    s.gospa = {s.gospa.distance / frames, s.gospa.localisation / frames, s.gospa.missed / frames,
               s.gospa.false_tracks / frames};
    return s;
}

std::vector<TargetReport> Metrics::targets() const {
    std::vector<TargetReport> list;
    for (const auto& [id, target] : targets_) list.push_back(target.report);
    return list;
}

}  // namespace sim
