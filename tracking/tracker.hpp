/// Multi-target tracker: detections of a frame in, tracks out. One source for `double` and fixed point.
///
/// A frame, in order: predict; associate and update confirmed tracks; do the same for tentative tracks with
/// the measurements confirmed ones did not claim; start tracks from pairs of measurements nobody claimed in
/// this frame and one of the last two; confirm, merge, delete.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

#include "tracking/association.hpp"
#include "tracking/associator.hpp"
#include "tracking/bits.hpp"
#include "tracking/clutter_map.hpp"
#include "tracking/existence.hpp"
#include "tracking/gating.hpp"
#include "tracking/imm_pdaf.hpp"
#include "tracking/kalman.hpp"
#include "tracking/order_statistics.hpp"
#include "tracking/pda.hpp"
#include "tracking/rate_index.hpp"
#include "tracking/scalar.hpp"
#include "tracking/scratch.hpp"
#include "tracking/track.hpp"

namespace tracking {

inline constexpr int kMaxTentative = kMaxTracks - kMaxConfirmed;
/// Once so many pairs of measurements near in range rate have been looked at to start tracks, the
/// measurements left wait for the next frame. Only a road where nearly everything has one range rate has
/// more.
inline constexpr int kMaxStartPairs = 1024;

template <class S>
struct TrackerConfig {
    MotionModel<S> motion;
    GateConfig<S> gate;
    Associator associator = Associator::ospda;
    /// With the covariance of what was decided: a track hidden in another's echo then doubts its place as one
    /// that coasts does, and its gate is wide enough to find it again.
    OrderStatisticsConfig<S> order_statistics{.covariance = CovarianceBetas::reshaped};
    IjipdaConfig ijipda;  ///< of Associator::ijipda
    RadarModes<S> modes;  ///< of Associator::imm_pdaf, in place of motion

    /// Two targets nearer than this in range and in range rate may be one detection: about two cells each,
    /// and a margin for the doubt about where a track hidden by another is.
    S resolution_range_m = S(12);
    S resolution_rate_mps = S(3);

    /// Range rates a new track may have. Rates outside +-rate_span/2 are measured folded; the change of range
    /// between the two measurements of a start tells which fold it is.
    S min_start_rate_mps = S(-80);
    S max_start_rate_mps = S(45);
    /// -2 ln of the prior odds that a range rate is folded, 0.05: added to the distance of such a start.
    S fold_distance2 = S(6);
    S max_range_m = S(170);  ///< a track predicted beyond this, or behind the radar, is deleted

    /// Existence: probability that the track is a target. Prior after the two measurements of a start, chance
    /// of a target to remain from one frame to the next, and thresholds.
    S initial_existence = constant<S>(2, 10);
    S survival = constant<S>(998, 1000);
    S confirm_existence = constant<S>(98, 100);
    S delete_existence = constant<S>(1, 100);
    /// Measurements before confirmation. 4 in a row confirm within 0.4 s; with 3, road clutter at 25 m/s
    /// confirms nine false tracks an hour instead of one.
    std::uint8_t confirm_hits = 4;
    std::uint8_t max_misses = 50;  ///< frames in a row a confirmed track is coasted at most
    /// A track less certain than this is deleted: it could be anywhere. Also what keeps variances in the
    /// format.
    S max_range_sigma_m = S(10);

    /// Tracks nearer than this, in the accuracy of a measurement of one of them, cannot be told apart ...
    S merge_distance2 = constant<S>(1, 4);
    std::uint8_t merge_frames = 20;  ///< ... and after this many frames in a row the younger is dropped
    S replace_margin_db = S(6);      ///< by how much stronger a track must be to take a confirmed one's place

    [[nodiscard]] constexpr bool valid() const {
        return motion.valid() && gate.valid() && order_statistics.valid() && associator <= kLastAssociator &&
               ijipda.valid() && modes.valid() && modes.period_s == motion.period_s &&
               resolution_range_m >= S(0) && resolution_rate_mps >= S(0) &&
               min_start_rate_mps < max_start_rate_mps && max_range_m > S(0) && fold_distance2 >= S(0) &&
               initial_existence > S(0) && initial_existence < S(1) && survival > S(0) && survival <= S(1) &&
               delete_existence > S(0) && delete_existence * 2 < initial_existence &&
               confirm_existence > initial_existence && confirm_existence < S(1) && confirm_hits >= 2 &&
               max_misses >= 1 && max_range_sigma_m >= S(1) && max_range_sigma_m <= S(20) &&
               merge_distance2 >= S(0) && merge_frames >= 1 && replace_margin_db >= S(0);
    }
};

/// What happened in one frame.
struct TrackerReport {
    int initiated = 0;
    int confirmed = 0;
    int deleted = 0;  ///< tentative and confirmed, merged ones and those out of the field not included
    int merged = 0;
    int left = 0;                  ///< out of the field of view
    int dropped_for_capacity = 0;  ///< tracks not started, not confirmed or given up for a stronger one
    int dropped_measurements = 0;  ///< beyond kMaxMeasurements
    int invalid_measurements = 0;  ///< not finite, or a variance that is not positive
    int gate_overflow = 0;         ///< measurements in a gate beyond kMaxGated
    int approximated = 0;          ///< clusters too large for exact JPDA
    int not_paired = 0;            ///< measurements that started no track because of kMaxStartPairs
    int limited = 0;               ///< tracks that did not reach the level of iterative JIPDA asked for
};

/// All memory is inside the object (kMaxConfirmed association rows are most of it). A step is bounded:
/// kMaxTracks gates over kMaxMeasurements, one association of at most kMaxConfirmed rows twice,
/// kMaxStartPairs pair tests to start tracks, kMaxTracks^2 merge tests.
template <class S>
class Tracker {
  public:
    explicit Tracker(const TrackerConfig<S>& config)
        : config_(config),
          gate_(config.gate),
          clutter_(config.gate.clutter_density, config.gate.rate_span_mps),
          index_(config.gate.rate_span_mps),
          model_(config.modes.model()) {
        set_start_motion();
    }

    /// One frame, one period after the last. Of more than kMaxMeasurements the first are used: give them
    /// strongest first.
    TrackerReport step(std::span<const Measurement<S>> measurements);

    /// All tracks, oldest first. Valid until the next step.
    [[nodiscard]] std::span<const Track<S>> tracks() const {
        return {track_.data(), static_cast<std::size_t>(count_)};
    }

    /// Forgets all tracks, and which ids were given.
    void reset() {
        count_ = 0;
        pending_count_ = 0;
        old_pending_count_ = 0;
        last_id_ = 0;
        clutter_.reset();
    }

    /// Another configuration, which must be valid(); begins anew. In place: the object is too large for a
    /// stack.
    void configure(const TrackerConfig<S>& config) {
        config_ = config;
        gate_ = Gate<S>(config.gate);
        clutter_ = ClutterMap<S>(config.gate.clutter_density, config.gate.rate_span_mps);
        index_ = RateIndex<S>(config.gate.rate_span_mps);
        model_ = config.modes.model();
        set_start_motion();
        reset();
    }

    /// From the next frame on; tracks are kept.
    void set_associator(Associator associator) {
        config_.associator = associator;
        if constexpr (kHasModes) {
            for (std::size_t i = 0; i < live().size(); ++i)
                modes_[i].start(track_[i].x, track_[i].covariance);
        }
    }

    [[nodiscard]] const TrackerConfig<S>& config() const { return config_; }

  private:
    /// A measurement nobody claimed, which may start a track with one of the next frames.
    struct Pending {
        Vec2<S> z;
        Vec2<S> noise;
    };
    /// At most two frames lie between the measurements of a start, so that one miss does not delay it
    /// further.
    static constexpr int kStartFrames = 2;
    /// What is the same for all starts with a pending measurement of one age.
    struct StartMotion {
        S time_s;
        Mat2<S> noise;  ///< of the motion in that time
        S fold_step_m;  ///< by how much farther a fold in range rate brings a target
    };
    /// A pending measurement, and how often its range rate is folded.
    struct Start {
        int from = -1;
        int fold = 0;
        S distance2 = S(0);
    };

    void set_start_motion() {
        Mat2<S> p = Mat2<S>::Zero();
        S time_s(0);
        for (StartMotion& m : start_motion_) {
            p = predict_covariance(p, config_.motion);
            time_s += config_.motion.period_s;
            m = {time_s, p, time_s * config_.gate.rate_span_mps};
        }
    }
    [[nodiscard]] int age_of_pending(std::size_t i) const { return i < old_pending_count_ ? 2 : 1; }
    [[nodiscard]] const StartMotion& motion_of(std::size_t pending) const {
        return start_motion_[static_cast<std::size_t>(age_of_pending(pending)) - 1];
    }

    static constexpr std::uint64_t bit(std::size_t i) { return std::uint64_t{1} << i; }

    [[nodiscard]] bool by_modes() const { return kHasModes && config_.associator == Associator::imm_pdaf; }
    std::span<Track<S>> live() { return {track_.data(), static_cast<std::size_t>(count_)}; }
    [[nodiscard]] int count_of(bool confirmed) const {
        int n = 0;
        for (const Track<S>& t : tracks()) n += t.is_confirmed() == confirmed ? 1 : 0;
        return n;
    }

    [[nodiscard]] bool in_field(const Track<S>& t) const {
        return t.x[0] >= S(0) && t.x[0] <= config_.max_range_m;
    }

    static bool usable(const Measurement<S>& m) {
        return is_finite(m.z[0]) && is_finite(m.z[1]) && is_finite(m.variance[0]) &&
               is_finite(m.variance[1]) && is_finite(m.snr_db) && m.variance[0] > S(0) &&
               m.variance[1] > S(0);
    }

    void predict();
    [[nodiscard]] std::uint32_t obscured() const;
    std::uint64_t associate_and_update(bool confirmed, std::span<const Measurement<S>> measurements,
                                       std::uint64_t usable, const Vec2<S>& largest_variance,
                                       TrackerReport& report);
    static std::uint64_t claimed_by(std::span<const AssociationRow<S>> rows);
    void associate_modes(ImmState<S, 2, 2>& modes, const Vec2<S>& x, AssociationRow<S>& row, S log_excess,
                         S& existence, std::span<const Measurement<S>> measurements);
    void update(Track<S>& track, const AssociationRow<S>& row, std::span<const Measurement<S>> measurements);
    void start(std::span<const Measurement<S>> measurements, std::uint64_t unclaimed, TrackerReport& report);
    void consider_start(std::size_t from, S range_variance, const Vec2<S>& z, const Vec2<S>& noise,
                        Start& best) const;
    bool begin_track(const Start& start, const Measurement<S>& m, const Vec2<S>& noise, int& room,
                     TrackerReport& report);
    [[nodiscard]] Mat2<S> start_covariance(const Vec2<S>& noise, const StartMotion& motion) const;
    /// The configured prior, its odds lowered as clutter is denser than expected; not so low as to be
    /// deleted.
    [[nodiscard]] S existence_of_start(S log_excess) const {
        const S existence = updated_existence(config_.initial_existence, S(-log_excess));
        const S least = config_.delete_existence * 2;
        return existence > least ? existence : least;
    }
    Track<S>* weakest(bool confirmed);
    bool replace_tentative(S snr_db, TrackerReport& report);
    void confirm(TrackerReport& report);
    void merge(TrackerReport& report);
    void remove_lost(TrackerReport& report);
    void remember(std::span<const Measurement<S>> measurements, std::uint64_t unclaimed, std::uint64_t used);
    std::uint8_t next_id();
    void erase_free();

    TrackerConfig<S> config_;
    Gate<S> gate_;
    ClutterMap<S> clutter_;
    RateIndex<S> index_;  // of the frame's measurements, then of the pending ones, then of the tracks
    std::array<Track<S>, kMaxTracks> track_{};
    std::array<AssociationRow<S>, kMaxConfirmed> row_{};
    AssociatorWorkspace<S> work_{};
    ImmModel<S, 2, 2> model_;
    std::array<ImmState<S, 2, 2>, kHasModes ? kMaxTracks : 0> modes_{};  // of track_, in the same order
    std::array<StartMotion, kStartFrames> start_motion_;  // by age of the pending measurement, from 1
    std::array<Pending, kMaxMeasurements> pending_{};     // those of the frame before the last first
    int count_ = 0;
    std::size_t pending_count_ = 0;
    std::size_t old_pending_count_ = 0;
    std::uint8_t last_id_ = 0;
};
static_assert(kMaxTentative <= kMaxConfirmed, "row_ serves both in turn");
static_assert(kMaxMeasurements <= 64, "sets of measurements are kept in 64 bits");

template <class S>
TrackerReport Tracker<S>::step(std::span<const Measurement<S>> measurements) {
    TrackerReport report;
    if (measurements.size() > kMaxMeasurements) {
        report.dropped_measurements = static_cast<int>(measurements.size() - kMaxMeasurements);
        measurements = measurements.first(kMaxMeasurements);
    }
    std::uint64_t free = 0;
    Vec2<S> largest(S(0), S(0));
    index_.clear(measurements.size());
    for (std::size_t i = 0; i < measurements.size(); ++i) {
        const Measurement<S>& m = measurements[i];
        if (!usable(m)) {
            ++report.invalid_measurements;
            continue;
        }
        free |= bit(i);
        if (m.variance[0] > largest[0]) largest[0] = m.variance[0];
        if (m.variance[1] > largest[1]) largest[1] = m.variance[1];
        index_.add(i, m.z[1]);
    }
    predict();
    free &= ~associate_and_update(true, measurements, free, largest, report);
    free &= ~associate_and_update(false, measurements, free, largest, report);
    remove_lost(report);
    start(measurements, free, report);
    confirm(report);
    merge(report);
    return report;
}

template <class S>
void Tracker<S>::predict() {
    const ProcessNoise<S> noise = process_noise(config_.motion);
    for (std::size_t i = 0; i < static_cast<std::size_t>(count_); ++i) {
        Track<S>& t = track_[i];
        if (by_modes()) {
            tracking::predict(modes_[i], model_);
            const Estimate<S, 2> all = combined(modes_[i]);
            t.x = all.x;
            t.covariance = all.covariance;
        } else {
            t.x = predict_state(t.x, config_.motion);
            t.covariance = predict_covariance(t.covariance, config_.motion, noise);
        }
        t.existence = weighted(config_.survival, t.existence);
        if (t.age < 0xFFFF) ++t.age;
    }
}

/// Confirmed tracks so near another confirmed one that the two may give one detection, as bits.
template <class S>
[[gnu::noinline]] std::uint32_t Tracker<S>::obscured() const {
    Scratch<std::uint8_t, kMaxTracks> confirmed;
    std::size_t count = 0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(count_); ++i) {
        if (track_[i].is_confirmed()) confirmed[count++] = static_cast<std::uint8_t>(i);
    }
    // Nearly all pairs are farther apart in range than a fold in range rate could explain.
    const S reach = config_.resolution_range_m + gate_.most_shift();
    std::uint32_t set = 0;
    for (std::size_t a = 1; a < count; ++a) {
        const Vec2<S> x = track_[confirmed[a]].x;
        for (std::size_t b = 0; b < a; ++b) {
            const Vec2<S>& other = track_[confirmed[b]].x;
            if (absolute(x[0] - other[0]) > reach) continue;
            const Vec2<S> d = gate_.innovation(x, other);
            if (absolute(d[0]) < config_.resolution_range_m && absolute(d[1]) < config_.resolution_rate_mps)
                set |= 1U << confirmed[a] | 1U << confirmed[b];
        }
    }
    return set;
}

/// Gates, associates and updates all confirmed or all tentative tracks. Returns the claimed measurements.
/// `largest_variance`: of the measurements, in range and in range rate.
template <class S>
std::uint64_t Tracker<S>::associate_and_update(bool confirmed, std::span<const Measurement<S>> measurements,
                                               std::uint64_t usable, const Vec2<S>& largest_variance,
                                               TrackerReport& report) {
    std::array<S, kMaxConfirmed> existence;
    std::array<RankInput<S>, kHasExistence ? kMaxConfirmed : 0> rank;
    std::array<S, kHasExistence ? kMaxMeasurements : 0> strength;
    if (uses_rank(config_.associator)) {
        for (std::size_t i = 0; i < measurements.size(); ++i) strength[i] = measurements[i].snr_db;
    }
    std::size_t rows = 0;
    const std::uint32_t obscured = confirmed ? this->obscured() : 0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(count_); ++i) {
        const Track<S>& t = track_[i];
        if (t.is_confirmed() != confirmed) continue;
        AssociationRow<S>& row = row_[rows];
        const bool hidden = (obscured >> i & 1) != 0;
        const S rate_reach = gate_.rate_reach(t.covariance, largest_variance[1], hidden);
        gate_.fill(
            row, t.x, t.covariance, measurements, usable & index_.near(t.x[1], index_.width(rate_reach)),
            hidden,
            [&](const Vec2<S>& z) { return config_.gate.nonparametric ? S(0) : clutter_.log_excess(z); },
            gate_.range_reach(t.covariance, largest_variance[0], hidden));
        S counted(0);
        if (config_.gate.nonparametric) {
            counted = gate_.log_counted_excess(row, t, measurements);
            for (Candidate<S>& c : row.candidates()) c.log_ratio -= counted;
        }
        report.gate_overflow += row.dropped;
        existence[rows] = t.existence;
        if (by_modes()) associate_modes(modes_[i], t.x, row, counted, existence[rows], measurements);
        if (uses_rank(config_.associator)) {
            rank[rows] = gate_.rank_input(row, t, measurements);
            rank[rows].log_gate_clutter += counted;
        }
        ++rows;
    }
    if (!by_modes()) {
        const AssociationStatus status = associate<S>(
            {row_.data(), rows},
            {{existence.data(), rows},
             std::span<const S>(strength).first(uses_rank(config_.associator) ? measurements.size() : 0),
             std::span<const RankInput<S>>(rank).first(uses_rank(config_.associator) ? rows : 0)},
            config_.associator, config_.order_statistics, config_.ijipda, work_);
        report.approximated += status.approximated;
        report.limited += status.limited;
    }

    std::size_t next = 0;
    for (Track<S>& t : live()) {
        if (t.is_confirmed() != confirmed) continue;
        t.existence = existence[next];
        update(t, row_[next++], measurements);
    }
    return claimed_by({row_.data(), rows});
}

/// Measurements more than half of which the rows share out. Not inlined: the sums would lie on the stack
/// beneath the association, where it is deepest.
template <class S>
[[gnu::noinline]] std::uint64_t Tracker<S>::claimed_by(std::span<const AssociationRow<S>> rows) {
    std::array<S, kMaxMeasurements> share{};
    std::uint64_t claimed = 0;
    for (const AssociationRow<S>& row : rows) {
        for (const Candidate<S>& c : row.candidates()) {
            share[c.measurement] += c.weight;
            if (share[c.measurement] >= constant<S>(1, 2)) claimed |= bit(c.measurement);
        }
    }
    return claimed;
}

/// The gate is about the combined prediction x, so all modes are judged on the same measurements, unfolded
/// alike.
template <class S>
void Tracker<S>::associate_modes(ImmState<S, 2, 2>& modes, const Vec2<S>& x, AssociationRow<S>& row,
                                 S log_excess, S& existence, std::span<const Measurement<S>> measurements) {
    std::array<GatedMeasurement<S>, kMaxGated> gated;
    std::array<S, kMaxGated> beta;
    const auto count = static_cast<std::size_t>(row.count);
    for (std::size_t c = 0; c < count; ++c) {
        const Measurement<S>& m = measurements[row.item[c].measurement];
        const Vec2<S> nu = gate_.innovation(x, m.z);
        gated[c] = {{x[0] + nu[0], x[1] + nu[1]}, gate_.noise(m, row.obscured)};
    }
    SensorLogs<S> sensor = gate_.sensor(row.obscured);
    sensor.detected -= log_excess;
    row.missed = row.missed_weight =
        pda_update<S, 2, 2>(modes, existence, {gated.data(), count}, sensor, {beta.data(), count});
    for (std::size_t c = 0; c < count; ++c) row.item[c].beta = row.item[c].weight = beta[c];
}

template <class S>
void Tracker<S>::update(Track<S>& track, const AssociationRow<S>& row,
                        std::span<const Measurement<S>> measurements) {
    if (by_modes()) {
        const Estimate<S, 2> all = combined(modes_[static_cast<std::size_t>(&track - track_.data())]);
        track.x = all.x;
        track.covariance = all.covariance;
    } else {
        update_with_row(track.x, track.covariance, row, measurements, gate_);
    }

    track.measured = row.missed_weight < constant<S>(1, 2);
    if (!track.measured) {
        if (track.misses < 0xFF) ++track.misses;
        if (track.is_confirmed()) track.state = TrackState::coasting;
        return;
    }
    track.misses = 0;
    if (track.hits < 0xFF) ++track.hits;
    if (track.is_confirmed()) track.state = TrackState::confirmed;
    const Candidate<S>* main = nullptr;
    for (const Candidate<S>& c : row.candidates()) {
        if (main == nullptr || c.weight > main->weight) main = &c;
    }
    track.snr_db += weighted(constant<S>(1, 8), S(measurements[main->measurement].snr_db - track.snr_db));
}

/// Covariance after the motion of a state known as well as a measurement.
template <class S>
Mat2<S> Tracker<S>::start_covariance(const Vec2<S>& noise, const StartMotion& motion) const {
    Mat2<S> p = motion.noise;
    const S cross = motion.time_s * noise[1];
    p(0, 0) += noise[0] + motion.time_s * cross;
    p(0, 1) += cross;
    p(1, 0) += cross;
    p(1, 1) += noise[1];
    return p;
}

/// Two measurements start a track if their range rates agree, and for one of the possible folds their range
/// difference agrees with the range rate. Nearly all pairs fail on one of the two alone. Not inlined: the
/// loop around it turns most pairs away.
template <class S>
[[gnu::noinline]] void Tracker<S>::consider_start(std::size_t from, S range_variance, const Vec2<S>& z,
                                                  const Vec2<S>& noise, Start& best) const {
    const Pending& pending = pending_[from];
    const StartMotion& motion = motion_of(from);
    // The folded difference of the range rates is the same for every fold.
    const Vec2<S> change = gate_.innovation(pending.z, z);
    const S travel = change[0] - motion.time_s * pending.z[1];
    const S rate_variance = pending.noise[1] + motion.noise(1, 1) + noise[1];
    if (product_exceeds(change[1], change[1], config_.gate.gate, rate_variance)) return;
    const S span = config_.gate.rate_span_mps;
    const int folds = span > S(0) ? 1 : 0;
    for (int fold = -folds; fold <= folds; ++fold) {
        const Vec2<S> nu(
            fold == 0 ? travel : (fold > 0 ? travel - motion.fold_step_m : travel + motion.fold_step_m),
            change[1]);
        if (product_exceeds(nu[0], nu[0], config_.gate.gate, range_variance)) continue;
        const S rate = pending.z[1] + span * fold;
        if (rate < config_.min_start_rate_mps || rate > config_.max_start_rate_mps) continue;
        S distance2(0);
        S log_density(0);
        if (!gate_.test(nu, start_covariance(pending.noise, motion), noise, distance2, log_density)) continue;
        if (fold != 0) distance2 += config_.fold_distance2;
        if (distance2 > config_.gate.gate || (best.from >= 0 && distance2 >= best.distance2)) continue;
        best = {static_cast<int>(from), fold, distance2};
    }
}

/// A tentative track from a pending measurement and m; false where there is no place for it. `room`: for how
/// many more there is without giving up another.
template <class S>
[[gnu::noinline]] bool Tracker<S>::begin_track(const Start& start, const Measurement<S>& m,
                                               const Vec2<S>& noise, int& room, TrackerReport& report) {
    const auto from = static_cast<std::size_t>(start.from);
    const Pending& pending = pending_[from];
    const StartMotion& motion = motion_of(from);
    Track<S> track;
    track.x[1] = pending.z[1] + config_.gate.rate_span_mps * start.fold;
    track.x[0] = pending.z[0] - config_.gate.alias_range_m * start.fold + motion.time_s * track.x[1];
    const Innovation<S> innovation(start_covariance(pending.noise, motion), noise);
    const Vec2<S> move = innovation.move(gate_.innovation(track.x, m.z));
    track.x[0] += move[0];
    track.x[1] += move[1];
    track.covariance = innovation.posterior();
    if (!in_field(track)) return false;
    if (room > 0) {
        --room;
    } else if (!replace_tentative(m.snr_db, report)) {
        return false;
    }
    track.id = next_id();
    track.state = TrackState::tentative;
    track.existence = existence_of_start(clutter_.log_excess(m.z));
    track.snr_db = m.snr_db;
    track.age = static_cast<std::uint16_t>(age_of_pending(from));
    track.hits = 2;
    track.measured = true;
    if constexpr (kHasModes) modes_[static_cast<std::size_t>(count_)].start(track.x, track.covariance);
    track_[static_cast<std::size_t>(count_++)] = track;
    ++report.initiated;
    return true;
}

template <class S>
void Tracker<S>::start(std::span<const Measurement<S>> measurements, std::uint64_t unclaimed,
                       TrackerReport& report) {
    Scratch<S, kMaxMeasurements> expected;  // ranges of the pending measurements by now
    Vec2<S> pending_variance(S(0), S(0));   // the largest
    S pending_rate(0);                      // the largest either way
    index_.clear(pending_count_);
    S time_s = start_motion_[1].time_s;
    for (std::size_t i = 0; i < pending_count_; ++i) {
        if (i == old_pending_count_) time_s = start_motion_[0].time_s;
        const Pending& p = pending_[i];
        index_.add(i, p.z[1]);
        expected[i] = p.z[0] + time_s * p.z[1];
        if (p.noise[0] > pending_variance[0]) pending_variance[0] = p.noise[0];
        if (p.noise[1] > pending_variance[1]) pending_variance[1] = p.noise[1];
        if (absolute(p.z[1]) > pending_rate) pending_rate = absolute(p.z[1]);
    }
    Vec2<S> variance = gate_.noise({{S(0), S(0)}, {S(0), S(0)}, S(0)}, false);  // the largest of this frame
    for (const std::uint32_t index : Bits(unclaimed)) {
        const Measurement<S>& m = measurements[index];
        if (m.variance[0] > variance[0]) variance[0] = m.variance[0];
        if (m.variance[1] > variance[1]) variance[1] = m.variance[1];
    }
    // Of the oldest pending measurements: the others are nearer.
    const StartMotion& motion = start_motion_[kStartFrames - 1];
    const S gate = config_.gate.gate;
    const S rate_reach = sqrt_above(gate, S(pending_variance[1] + motion.noise(1, 1) + variance[1]));
    const std::uint32_t width = index_.width(rate_reach);
    const S moved = motion.noise(0, 0) + motion.time_s * (motion.time_s * pending_variance[1]);
    const S reach = sqrt_above(gate, S(pending_variance[0] + variance[0] + moved)) + motion.fold_step_m;
    // Range rates smaller than this are on the same side of a fold as all pending ones within reach; those of
    // the others may make the expected range wrong.
    const S unfolded = config_.gate.rate_span_mps - pending_rate - rate_reach;
    const S folded_reach = reach + gate_.most_shift();

    std::uint64_t used = 0;
    std::uint64_t left = unclaimed;
    int room = kMaxTentative - count_of(false);
    int pairs = 0;
    for (const std::uint32_t index : Bits(unclaimed)) {
        if (pairs >= kMaxStartPairs) {
            ++report.not_paired;
            continue;
        }
        const Measurement<S>& m = measurements[index];
        const Vec2<S> noise = gate_.noise(m, false);
        const S range = m.z[0];
        const S own_variance = noise[0] + moved;
        const bool folded = absolute(m.z[1]) >= unfolded;
        const S most_off = folded ? folded_reach : reach;
        Start best;
        for_each_bit(index_.near(m.z[1], width) & ~used, [&](std::uint32_t from) {
            ++pairs;
            const S off = absolute(range - expected[from]);
            if (off > most_off) return;
            const S range_variance = own_variance + pending_[from].noise[0];
            const auto too_far = [&](S d) { return product_exceeds(d, d, gate, range_variance); };
            if (!folded && too_far(off) && too_far(off - motion_of(from).fold_step_m)) return;
            consider_start(from, range_variance, m.z, noise, best);
        });
        if (best.from < 0 || !begin_track(best, m, noise, room, report)) continue;
        used |= bit(static_cast<std::size_t>(best.from));
        left &= ~bit(index);
    }
    remember(measurements, left, used);
}

/// Pending from now on: the unclaimed measurements of this frame, and as far as there is room those of the
/// last that still have no partner. Those given up were clutter.
template <class S>
void Tracker<S>::remember(std::span<const Measurement<S>> measurements, std::uint64_t unclaimed,
                          std::uint64_t used) {
    clutter_.forget();
    const auto room = kMaxMeasurements - static_cast<std::size_t>(std::popcount(unclaimed));
    std::size_t kept = 0;
    const std::uint64_t all = pending_count_ == 0 ? 0 : ~std::uint64_t{0} >> (64 - pending_count_);
    for (const std::uint32_t i : Bits(all & ~used)) {
        if (i < old_pending_count_ || kept >= room) {
            clutter_.add(pending_[i].z);
        } else {
            pending_[kept++] = pending_[i];
        }
    }
    old_pending_count_ = kept;
    for (const std::uint32_t index : Bits(unclaimed))
        pending_[kept++] = {measurements[index].z, gate_.noise(measurements[index], false)};
    pending_count_ = kept;
}

/// Of the confirmed or the tentative tracks, of which there must be one.
template <class S>
Track<S>* Tracker<S>::weakest(bool confirmed) {
    Track<S>* weakest = nullptr;
    for (Track<S>& t : live()) {
        if ((weakest == nullptr || t.snr_db < weakest->snr_db) && t.is_confirmed() == confirmed) weakest = &t;
    }
    return weakest;
}

/// With kMaxTentative already, the weakest gives way to a stronger one.
template <class S>
bool Tracker<S>::replace_tentative(S snr_db, TrackerReport& report) {
    ++report.dropped_for_capacity;
    Track<S>* const t = weakest(false);
    if (snr_db <= t->snr_db) return false;
    t->state = TrackState::free;
    erase_free();
    return true;
}

/// With kMaxConfirmed already, the weakest gives way to one stronger by replace_margin_db.
template <class S>
void Tracker<S>::confirm(TrackerReport& report) {
    int confirmed = count_of(true);
    Track<S>* weakest_confirmed = nullptr;  // not looked for yet
    for (Track<S>& t : live()) {
        if (t.state != TrackState::tentative || t.hits < config_.confirm_hits ||
            t.existence < config_.confirm_existence || !t.measured) {
            continue;
        }
        if (confirmed == kMaxConfirmed) {
            ++report.dropped_for_capacity;
            if (weakest_confirmed == nullptr) weakest_confirmed = weakest(true);
            if (t.snr_db < weakest_confirmed->snr_db + config_.replace_margin_db) continue;
            weakest_confirmed->state = TrackState::free;
            --confirmed;
        }
        t.state = TrackState::confirmed;
        ++confirmed;
        weakest_confirmed = nullptr;
        ++report.confirmed;
    }
    erase_free();
}

/// Two tracks of one target end up in the same state and stay there; targets that pass each other are there
/// for a few frames at most, hence the count. "The same" is what a measurement of the other could not tell
/// apart: the wide covariance of a coasting track proves nothing. Of the two the coasting one goes, else the
/// younger, so that the id a consumer knows survives; a tentative track always gives way to a confirmed one.
template <class S>
void Tracker<S>::merge(TrackerReport& report) {
    constexpr std::uint8_t kCoasting = 3;  // misses in a row
    const Vec2<S> least = gate_.noise({{S(0), S(0)}, {S(0), S(0)}, S(0)}, false);
    const S limit = config_.merge_distance2;
    const auto near = [&](const Track<S>& a, const Track<S>& b) {
        const Vec2<S> d(a.x[0] - b.x[0], a.x[1] - b.x[1]);
        if (product_exceeds(d[1], d[1], limit, S(a.covariance(1, 1) + least[1])) ||
            product_exceeds(d[0], d[0], limit, S(a.covariance(0, 0) + least[0])))
            return false;
        const Innovation<S> accuracy(a.covariance, least);
        return accuracy.valid() && accuracy.distance2(d) < limit;
    };
    Vec2<S> variance(S(0), S(0));  // the largest of those that may stay
    index_.clear(tracks().size());
    for (std::size_t i = 0; i < tracks().size(); ++i) {
        const Track<S>& t = track_[i];
        index_.add(i, t.x[1]);
        if (t.misses >= kCoasting) continue;
        if (t.covariance(0, 0) > variance[0]) variance[0] = t.covariance(0, 0);
        if (t.covariance(1, 1) > variance[1]) variance[1] = t.covariance(1, 1);
    }
    const S range_reach = sqrt_above(limit, S(variance[0] + least[0]));
    const std::uint32_t width = index_.width(sqrt_above(limit, S(variance[1] + least[1])));
    for (std::size_t i = 0; i < static_cast<std::size_t>(count_); ++i) {
        Track<S>& b = track_[i];
        bool same = false;
        for (const std::uint32_t j : Bits(index_.near(b.x[1], width) & ~bit(i))) {
            const Track<S>& a = track_[j];
            if (absolute(a.x[0] - b.x[0]) > range_reach || a.state == TrackState::free ||
                a.misses >= kCoasting)
                continue;
            const bool yields =
                a.is_confirmed() == b.is_confirmed() ? j < i || b.misses >= kCoasting : a.is_confirmed();
            same = yields && near(a, b);
            if (same) break;
        }
        b.overlap = same ? static_cast<std::uint8_t>(b.overlap + 1) : std::uint8_t{0};
        if (b.overlap < config_.merge_frames) continue;
        b.state = TrackState::free;
        ++report.merged;
    }
    erase_free();
}

template <class S>
void Tracker<S>::remove_lost(TrackerReport& report) {
    const S most = config_.max_range_sigma_m * config_.max_range_sigma_m;
    for (Track<S>& t : live()) {
        if (!in_field(t)) {
            t.state = TrackState::free;
            ++report.left;
        } else if (t.existence < config_.delete_existence || t.misses > config_.max_misses ||
                   t.covariance(0, 0) > most) {
            t.state = TrackState::free;
            ++report.deleted;
        }
    }
    erase_free();
}

/// The next id in 1..255 that no track has, going round.
template <class S>
std::uint8_t Tracker<S>::next_id() {
    for (int tries = 0; tries <= kMaxTracks; ++tries) {
        last_id_ = last_id_ == 255 ? std::uint8_t{1} : static_cast<std::uint8_t>(last_id_ + 1);
        if (!std::ranges::any_of(tracks(), [&](const Track<S>& t) { return t.id == last_id_; })) break;
    }
    return last_id_;
}

/// Closes the gaps that freed tracks left, keeping the order.
template <class S>
void Tracker<S>::erase_free() {
    std::size_t kept = 0;
    while (kept < static_cast<std::size_t>(count_) && track_[kept].state != TrackState::free) ++kept;
    for (std::size_t i = kept; i < static_cast<std::size_t>(count_); ++i) {
        if (track_[i].state == TrackState::free) continue;
        track_[kept] = track_[i];
        if constexpr (kHasModes) modes_[kept] = modes_[i];
        ++kept;
    }
    count_ = static_cast<int>(kept);
}

/// The one the firmware uses is compiled once, in tracker.cpp.
extern template class Tracker<dsp::Real>;

}  // namespace tracking
