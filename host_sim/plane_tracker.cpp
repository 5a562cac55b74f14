#include "host_sim/plane_tracker.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <stdexcept>

#include "tracking/kalman.hpp"

namespace sim {

namespace {

using tracking::AssociationRow;
using tracking::Associator;
using tracking::kMaxGated;
using tracking::kMaxMeasurements;
using tracking::kMaxTracks;
using Vec2d = tracking::Vec2<double>;
using Mat2d = tracking::Mat2<double>;
using Vec4d = tracking::VecN<double, 4>;
using Mat4d = tracking::MatN<double, 4>;

/// 12 tracks with any measurements, 14 with 16: a few milliseconds.
constexpr tracking::JpdaCapacity kExact{.items = 14, .table = 1 << 18};

/// Keeps the likeliest candidates, measurement indices ascending.
void insert(AssociationRow<double>& row, std::size_t measurement, double log_ratio) {
    if (row.count == kMaxGated) {
        ++row.dropped;
        std::size_t weakest = 0;
        for (std::size_t c = 1; c < kMaxGated; ++c)
            if (row.item[c].log_ratio < row.item[weakest].log_ratio) weakest = c;
        if (log_ratio <= row.item[weakest].log_ratio) return;
        for (std::size_t c = weakest; c + 1 < kMaxGated; ++c) row.item[c] = row.item[c + 1];
        --row.count;
    }
    row.item[static_cast<std::size_t>(row.count++)] = {static_cast<std::uint16_t>(measurement), log_ratio, 0,
                                                       0};
}

}  // namespace

struct PlaneTracker::Scratch {
    tracking::AssociatorWorkspace<double> work;
    tracking::JpdaWorkspace<double, kExact> exact;
    std::vector<AssociationRow<double>> rows;  ///< of a cluster, its measurements numbered from 0
    std::vector<AssociationRow<double>> kept;
    std::vector<double> existence;
    std::vector<double> kept_existence;
    std::vector<tracking::RankInput<double>> rank;
    std::vector<double> strength;
};

bool PlaneTrackerConfig::valid() const {
    return period_s > 0 && sigma > 0 && gate > 0 && detection_probability > 0 && detection_probability <= 1 &&
           clutter_density > 0 && snr >= 0 && iterative.valid() && max_speed > 0 && initial_existence > 0 &&
           initial_existence < 1 && chain.valid() && confirm > 0 && confirm < 1 && drop >= 0 &&
           drop < initial_existence && merge >= 0 && associator >= Associator::ipda &&
           associator < Associator::imm_pdaf;
}

PlaneTracker::PlaneTracker(const PlaneTrackerConfig& config)
    : config_(config), scratch_(std::make_unique<Scratch>()) {
    if (!config.valid()) throw std::invalid_argument("PlaneTrackerConfig");
}
PlaneTracker::~PlaneTracker() = default;

PlaneReport PlaneTracker::step(std::span<const PlaneMeasurement> measurements) {
    PlaneReport report;
    for (PlaneTrack& t : tracks_) {
        t.x = config_.motion.transition * t.x + config_.motion.input;
        t.covariance = config_.motion.transition * t.covariance * config_.motion.transition.transpose() +
                       config_.motion.noise;
        t.existence = config_.chain.predict(t.existence);
        ++t.age;
    }
    associate(measurements, report);
    std::erase_if(tracks_, [&](const PlaneTrack& t) { return t.existence < config_.drop; });
    merge();
    for (PlaneTrack& t : tracks_)
        if (t.existence >= config_.confirm) t.confirmed = true;
    start(measurements);
    report.tracks = static_cast<int>(tracks_.size());
    return report;
}

void PlaneTracker::associate(std::span<const PlaneMeasurement> measurements, PlaneReport& report) {
    const std::size_t count = tracks_.size();
    const double gate_probability = 1 - std::exp(-config_.gate / 2);
    const double log_missed = std::log(1 - config_.detection_probability * gate_probability);
    rows_.assign(count, {});
    gated_.assign(measurements.size(), false);
    taken_.assign(measurements.size(), 0);

    // Gates, and the tracks that share a measurement in one set each.
    std::vector<std::size_t> parent(count);
    std::iota(parent.begin(), parent.end(), std::size_t{0});
    const auto root = [&](std::size_t t) {
        while (parent[t] != t) t = parent[t] = parent[parent[t]];
        return t;
    };
    std::vector<int> first_user(measurements.size(), -1);
    const Vec2d r(config_.sigma * config_.sigma, config_.sigma * config_.sigma);
    for (std::size_t t = 0; t < count; ++t) {
        AssociationRow<double>& row = rows_[t];
        row.log_missed = log_missed;
        const Mat2d s = tracking::innovation_covariance(
            tracking::measured_covariance<double, 4>(tracks_[t].covariance), r);
        const tracking::Ldl<double> factors(s);
        int in_gate = 0;
        std::vector<std::pair<std::size_t, double>> found;
        for (std::size_t j = 0; j < measurements.size(); ++j) {
            const Vec2d nu = measurements[j].z - tracks_[t].x.head<2>();
            if (nu[0] * nu[0] > config_.gate * s(0, 0) || nu[1] * nu[1] > config_.gate * s(1, 1)) continue;
            const double distance2 = factors.distance2(nu);
            if (distance2 > config_.gate) continue;
            double log_density = factors.log_density(distance2);
            if (config_.use_amplitude)
                log_density +=
                    tracking::log_amplitude_ratio(measurements[j].amplitude, config_.threshold, config_.snr);
            found.emplace_back(j, log_density);
            ++in_gate;
        }
        double clutter = config_.clutter_density;
        if (config_.nonparametric) {
            const double area = std::numbers::pi * config_.gate * std::sqrt(s.determinant());
            const double expected = config_.detection_probability * gate_probability * tracks_[t].existence;
            clutter = std::max(in_gate - expected, 0.5) / area;
        }
        const double log_detected = std::log(config_.detection_probability / clutter);
        for (const auto& [j, log_density] : found) insert(row, j, log_detected + log_density);
        for (const auto& c : row.candidates()) {
            gated_[c.measurement] = true;
            int& first = first_user[c.measurement];
            if (first < 0)
                first = static_cast<int>(t);
            else
                parent[root(t)] = root(static_cast<std::size_t>(first));
        }
    }

    std::vector<std::vector<std::size_t>> clusters(count);
    for (std::size_t t = 0; t < count; ++t) clusters[root(t)].push_back(t);
    for (std::vector<std::size_t>& cluster : clusters) {
        if (cluster.empty()) continue;
        if (static_cast<int>(cluster.size()) > report.cluster_tracks) {
            std::vector<bool> seen(measurements.size(), false);
            for (const std::size_t t : cluster)
                for (const auto& c : rows_[t].candidates()) seen[c.measurement] = true;
            report.cluster_tracks = static_cast<int>(cluster.size());
            report.cluster_measurements = static_cast<int>(std::count(seen.begin(), seen.end(), true));
        }
        if (cluster.size() > static_cast<std::size_t>(kMaxTracks)) {
            ++report.split;
            std::stable_sort(cluster.begin(), cluster.end(), [&](std::size_t a, std::size_t b) {
                return tracks_[a].existence > tracks_[b].existence;
            });
        }
        for (std::size_t from = 0; from < cluster.size(); from += kMaxTracks)
            solve(std::span(cluster).subspan(from, std::min<std::size_t>(kMaxTracks, cluster.size() - from)),
                  measurements, report);
    }
}

void PlaneTracker::solve(std::span<const std::size_t> cluster, std::span<const PlaneMeasurement> measurements,
                         PlaneReport& report) {
    Scratch& s = *scratch_;
    s.rows.clear();
    s.existence.clear();
    s.rank.clear();
    s.strength.clear();

    // The cluster's measurements, numbered from 0. Of more than a solver takes, the likeliest.
    std::vector<std::pair<double, std::size_t>> likeliest;
    {
        std::vector<double> best(measurements.size(), -1e300);
        for (const std::size_t t : cluster)
            for (const auto& c : rows_[t].candidates())
                best[c.measurement] = std::max(best[c.measurement], c.log_ratio);
        for (std::size_t j = 0; j < best.size(); ++j)
            if (best[j] > -1e300) likeliest.emplace_back(best[j], j);
    }
    if (likeliest.size() > kMaxMeasurements) {
        std::nth_element(likeliest.begin(), likeliest.begin() + kMaxMeasurements, likeliest.end(),
                         std::greater<>());
        likeliest.resize(kMaxMeasurements);
        std::sort(likeliest.begin(), likeliest.end(),
                  [](const auto& a, const auto& b) { return a.second < b.second; });
    }
    std::vector<int> number(measurements.size(), -1);
    for (std::size_t i = 0; i < likeliest.size(); ++i) {
        number[likeliest[i].second] = static_cast<int>(i);
        s.strength.push_back(measurements[likeliest[i].second].amplitude);
    }

    const Vec2d r(config_.sigma * config_.sigma, config_.sigma * config_.sigma);
    for (const std::size_t t : cluster) {
        AssociationRow<double> row = rows_[t];
        row.count = 0;
        for (const auto& c : rows_[t].candidates()) {
            if (number[c.measurement] < 0) continue;
            row.item[static_cast<std::size_t>(row.count)] = c;
            row.item[static_cast<std::size_t>(row.count++)].measurement =
                static_cast<std::uint16_t>(number[c.measurement]);
        }
        s.rows.push_back(row);
        s.existence.push_back(tracks_[t].existence);
        const Mat2d innovation = tracking::innovation_covariance(
            tracking::measured_covariance<double, 4>(tracks_[t].covariance), r);
        const double area = std::numbers::pi * config_.gate * std::sqrt(innovation.determinant());
        s.rank.push_back({std::log(config_.clutter_density * area), std::log1p(config_.snr)});
    }

    if (config_.associator == Associator::jipda) {
        s.kept = s.rows;
        s.kept_existence = s.existence;
        const tracking::JpdaStatus status = tracking::jipda<double>(s.rows, s.existence, s.exact);
        if (status.approximated > 0) {
            ++report.inexact;
            s.rows = s.kept;
            s.existence = s.kept_existence;
            const auto reached =
                tracking::ijipda<double>(s.rows, s.existence, config_.iterative, s.work.ijipda);
            report.level = std::min(report.level, reached.level);
        }
    } else if (config_.associator == Associator::ijipda) {
        const auto reached = tracking::ijipda<double>(s.rows, s.existence, config_.iterative, s.work.ijipda);
        report.level = std::min(report.level, reached.level);
    } else if (config_.sharing && tracking::uses_rank(config_.associator)) {
        tracking::ihpda<double>(s.rows, s.existence, s.strength, s.rank, *config_.sharing, s.work.ihpda);
    } else {
        tracking::associate<double>(s.rows, {s.existence, s.strength, s.rank}, config_.associator, {},
                                    config_.iterative, s.work);
    }

    for (std::size_t i = 0; i < cluster.size(); ++i) {
        PlaneTrack& track = tracks_[cluster[i]];
        const AssociationRow<double>& row = s.rows[i];
        track.existence = s.existence[i];
        track.misses = row.count == 0 ? track.misses + 1 : 0;
        if (row.count == 0) continue;
        // One R for all: the PDA update with one gain.
        const Mat4d p = track.covariance;
        const tracking::Ldl<double> innovation(
            tracking::innovation_covariance(tracking::measured_covariance<double, 4>(p), r));
        const tracking::KalmanGain<double, 4> gain(p, innovation);
        Vec2d mean = Vec2d::Zero();
        Mat2d square = Mat2d::Zero();
        for (const auto& c : row.candidates()) {
            const std::size_t j = likeliest[c.measurement].second;
            const Vec2d nu = measurements[j].z - track.x.head<2>();
            mean += c.weight * nu;
            square += c.weight * nu * nu.transpose();
            if (track.confirmed) taken_[j] += track.existence * c.weight;
        }
        track.covariance = row.missed_weight * p + (1 - row.missed_weight) * gain.posterior(p, r) +
                           gain.k * (square - mean * mean.transpose()) * gain.k.transpose();
        track.x += gain.k * mean;
    }
}

/// Of two tracks that cannot be told apart the one with the larger covariance goes.
void PlaneTracker::merge() {
    std::vector<bool> gone(tracks_.size(), false);
    for (std::size_t a = 0; a < tracks_.size(); ++a) {
        for (std::size_t b = a + 1; b < tracks_.size() && !gone[a]; ++b) {
            if (gone[b]) continue;
            const Vec4d d = tracks_[a].x - tracks_[b].x;
            const Mat4d joint = tracks_[a].covariance + tracks_[b].covariance;
            if (d[0] * d[0] > config_.merge * joint(0, 0) || d[1] * d[1] > config_.merge * joint(1, 1))
                continue;
            if (d.dot(joint.ldlt().solve(d)) >= config_.merge) continue;
            const bool a_stays = tracks_[a].covariance.trace() <= tracks_[b].covariance.trace();
            gone[a_stays ? b : a] = true;
        }
    }
    std::size_t i = 0;
    std::erase_if(tracks_, [&](const PlaneTrack&) { return gone[i++]; });
}

void PlaneTracker::start(std::span<const PlaneMeasurement> measurements) {
    std::vector<PlaneMeasurement> free;
    for (std::size_t j = 0; j < measurements.size(); ++j) {
        const bool usable = config_.start_from == StartFrom::untaken ? taken_[j] < 0.5 : !gated_[j];
        if (usable) free.push_back(measurements[j]);
    }
    const double r = config_.sigma * config_.sigma;
    const double t = config_.period_s;
    const auto add = [&](const Vec2d& z, const Vec2d& velocity, double cross, double rate) {
        PlaneTrack track;
        track.id = ++last_id_;
        track.x << z, velocity;
        track.covariance.setZero();
        track.covariance.topLeftCorner<2, 2>().diagonal().setConstant(r);
        track.covariance.topRightCorner<2, 2>().diagonal().setConstant(cross);
        track.covariance.bottomLeftCorner<2, 2>().diagonal().setConstant(cross);
        track.covariance.bottomRightCorner<2, 2>().diagonal().setConstant(rate);
        track.existence = config_.initial_existence;
        tracks_.push_back(track);
    };
    if (config_.start == TrackStart::one_point) {
        for (const PlaneMeasurement& m : free)
            add(m.z, Vec2d::Zero(), 0, config_.max_speed * config_.max_speed / 3);
        return;
    }
    for (const PlaneMeasurement& m : free) {
        for (const PlaneMeasurement& before : pending_) {
            const Vec2d velocity = (m.z - before.z) / t;
            if (velocity.norm() > config_.max_speed + 3 * std::numbers::sqrt2 * config_.sigma / t) continue;
            add(m.z, velocity, r / t, 2 * r / (t * t));
        }
    }
    pending_ = std::move(free);
}

}  // namespace sim
