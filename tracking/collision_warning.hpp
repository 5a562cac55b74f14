/// Collision warning from confirmed tracks and the car's own speed.
///
/// The radar has no azimuth: it knows how far and how fast, not in which lane. So that a guard rail, a sign
/// or the traffic of the other direction does not brake the car, targets that were never seen moving and
/// oncoming ones are held at a configurable level (inform by default). Full warnings are for vehicles seen
/// moving in our direction, also when they have since stopped.
///
/// A level needs both a short time to collision and a large required deceleration: the first alone would cry
/// wolf when creeping up to a bumper, the second alone far away at high speed.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "tracking/scalar.hpp"
#include "tracking/track.hpp"

namespace tracking {

enum class WarningLevel : std::uint8_t { none = 0, inform = 1, warn = 2, brake = 3 };

/// Motion over ground, along the car's axis.
enum class Motion : std::uint8_t {
    unknown = 0,     ///< no valid ego speed
    stationary = 1,  ///< never seen moving
    moving = 2,      ///< in our direction
    oncoming = 3,
    stopped = 4,  ///< stands now, was seen moving
};

template <class S>
struct EgoState {
    S speed_mps = S(0);  ///< along the car's axis, positive forward
    bool valid = false;
};

template <class S>
struct WarningThreshold {
    S time_to_collision_s;         ///< at most
    S required_deceleration_mps2;  ///< and at least
};

template <class S>
struct CollisionWarningConfig {
    /// For inform, warn, brake, each stricter than the one before.
    std::array<WarningThreshold<S>, 3> threshold{{{S(4), constant<S>(12, 10)},
                                                  {constant<S>(27, 10), constant<S>(25, 10)},
                                                  {constant<S>(14, 10), S(5)}}};
    S margin_m = S(1);  ///< distance wanted at standstill; also covers the range bias of an extended target
    S hysteresis = constant<S>(8, 10);  ///< a level is kept down to this share of its deceleration and up to
                                        ///< its time divided by this; 1: no hysteresis
    std::uint8_t rise_frames = 2;       ///< frames in a row before the level rises
    std::uint8_t fall_frames = 5;       ///< frames in a row before it falls

    /// Highest level by class of motion.
    WarningLevel stationary_limit = WarningLevel::inform;
    WarningLevel oncoming_limit = WarningLevel::inform;
    WarningLevel unknown_limit = WarningLevel::inform;

    /// A target stands while its speed over ground is within base + share of ego speed (scale error of the
    /// wheels' speed), and moves again beyond twice that.
    S standstill_mps = S(1);
    S standstill_share = constant<S>(3, 100);
    std::uint8_t moving_frames = 5;          ///< frames of motion before a target counts as having moved
    S min_closing_mps = constant<S>(1, 10);  ///< slower closing has no time to collision

    [[nodiscard]] constexpr bool valid() const {
        for (std::size_t i = 0; i < threshold.size(); ++i) {
            if (threshold[i].time_to_collision_s <= S(0) || threshold[i].required_deceleration_mps2 <= S(0))
                return false;
            if (i > 0 &&
                (threshold[i].time_to_collision_s > threshold[i - 1].time_to_collision_s ||
                 threshold[i].required_deceleration_mps2 < threshold[i - 1].required_deceleration_mps2)) {
                return false;
            }
        }
        return margin_m >= S(0) && hysteresis > constant<S>(1, 10) && hysteresis <= S(1) &&
               rise_frames >= 1 && fall_frames >= 1 && standstill_mps > S(0) && standstill_share >= S(0) &&
               moving_frames >= 1 && min_closing_mps > S(0) && stationary_limit <= WarningLevel::brake &&
               oncoming_limit <= WarningLevel::brake && unknown_limit <= WarningLevel::brake;
    }
};

template <class S>
struct CollisionWarningResult {
    WarningLevel level = WarningLevel::none;
    std::uint8_t track_id = 0;             ///< most urgent track; 0: nothing closes
    std::optional<S> time_to_collision_s;  ///< range over closing speed of that track, at most 100 s
    S required_deceleration_mps2 = S(0);   ///< of that track: v^2 / 2 (range - margin), at most 100 m/s^2
    /// motion[i] belongs to tracks[i] of the step; unknown for tentative tracks.
    std::array<Motion, kMaxTracks> motion{};
};

template <class S>
class CollisionWarning {
  public:
    explicit CollisionWarning(const CollisionWarningConfig<S>& config) : config_(config) {}

    /// One frame, after the tracker's step, with its tracks (at most kMaxTracks).
    CollisionWarningResult<S> step(std::span<const Track<S>> tracks, const EgoState<S>& ego);

    void reset() { *this = CollisionWarning(config_); }

  private:
    /// What is remembered of a confirmed track.
    struct Memory {
        std::uint8_t id = 0;
        Motion motion = Motion::unknown;
        std::uint8_t moving_frames = 0;
    };
    static constexpr int kLimit = 100;  // s and m/s^2

    /// Looked for from `next` on, round: tracks keep their order, so each is found where the last one's
    /// search ended.
    Memory recall(std::uint8_t id, std::size_t& next) const {
        for (std::size_t i = 0; i < memory_.size(); ++i) {
            const Memory& m = memory_[(next + i) % memory_.size()];
            if (m.id != id) continue;
            next += i + 1;
            return m;
        }
        return {id};
    }
    void classify(Memory& memory, S range_rate_mps, const EgoState<S>& ego) const;
    [[nodiscard]] WarningLevel limit(Motion motion) const;
    [[nodiscard]] WarningLevel raw_level(S time_s, S deceleration, bool relaxed) const;
    void follow(WarningLevel wanted, WarningLevel kept);

    CollisionWarningConfig<S> config_;
    std::array<Memory, kMaxConfirmed> memory_{};
    WarningLevel level_ = WarningLevel::none;
    std::uint8_t rising_ = 0;
    std::uint8_t falling_ = 0;
};

template <class S>
CollisionWarningResult<S> CollisionWarning<S>::step(std::span<const Track<S>> tracks,
                                                    const EgoState<S>& ego) {
    CollisionWarningResult<S> result;
    std::array<Memory, kMaxConfirmed> memory{};
    std::size_t remembered = 0;
    std::size_t next = 0;
    WarningLevel wanted = WarningLevel::none;  // by the thresholds
    WarningLevel kept = WarningLevel::none;    // by the thresholds relaxed by the hysteresis
    for (std::size_t i = 0; i < tracks.size() && i < result.motion.size(); ++i) {
        const Track<S>& t = tracks[i];
        if (!t.is_confirmed() || remembered == memory.size()) continue;
        Memory& m = memory[remembered++];
        m = recall(t.id, next);
        classify(m, t.x[1], ego);
        result.motion[i] = m.motion;

        const S closing = -t.x[1];
        if (closing < config_.min_closing_mps) continue;
        S time = t.x[0] * reciprocal(closing);
        if (time > S(kLimit)) time = S(kLimit);
        const S way = t.x[0] - config_.margin_m;
        S deceleration(kLimit);
        if (way > S(0)) {
            deceleration = closing * reciprocal(way) * closing * constant<S>(1, 2);
            if (deceleration > S(kLimit)) deceleration = S(kLimit);
        }
        const WarningLevel most = limit(m.motion);
        const auto capped = [most](WarningLevel l) { return l > most ? most : l; };
        const WarningLevel raw = capped(raw_level(time, deceleration, false));
        const WarningLevel relaxed = capped(raw_level(time, deceleration, true));
        if (relaxed > kept) kept = relaxed;
        if (result.track_id == 0 || raw > wanted ||
            (raw == wanted && deceleration > result.required_deceleration_mps2)) {
            result.track_id = t.id;
            result.time_to_collision_s = time;
            result.required_deceleration_mps2 = deceleration;
        }
        if (raw > wanted) wanted = raw;
    }
    memory_ = memory;
    follow(wanted, kept);
    result.level = level_;
    return result;
}

template <class S>
void CollisionWarning<S>::classify(Memory& memory, S range_rate_mps, const EgoState<S>& ego) const {
    if (!ego.valid) {
        memory.motion = Motion::unknown;
        return;
    }
    const S over_ground = ego.speed_mps + range_rate_mps;
    const S still = config_.standstill_mps + absolute(ego.speed_mps) * config_.standstill_share;
    const bool was_moving = memory.motion == Motion::moving || memory.motion == Motion::oncoming;
    const S border = was_moving ? still : still * 2;
    if (absolute(over_ground) <= border) {
        memory.motion = memory.moving_frames >= config_.moving_frames ? Motion::stopped : Motion::stationary;
        return;
    }
    memory.motion = over_ground > S(0) ? Motion::moving : Motion::oncoming;
    if (memory.motion == Motion::moving && memory.moving_frames < config_.moving_frames)
        ++memory.moving_frames;
}

template <class S>
WarningLevel CollisionWarning<S>::limit(Motion motion) const {
    switch (motion) {
        case Motion::stationary:
            return config_.stationary_limit;
        case Motion::oncoming:
            return config_.oncoming_limit;
        case Motion::unknown:
            return config_.unknown_limit;
        case Motion::moving:
        case Motion::stopped:
            break;
    }
    return WarningLevel::brake;
}

template <class S>
WarningLevel CollisionWarning<S>::raw_level(S time_s, S deceleration, bool relaxed) const {
    const S share = relaxed ? config_.hysteresis : S(1);
    auto level = WarningLevel::none;
    for (std::size_t i = 0; i < config_.threshold.size(); ++i) {
        const WarningThreshold<S>& t = config_.threshold[i];
        if (time_s * share <= t.time_to_collision_s && deceleration >= t.required_deceleration_mps2 * share) {
            level = static_cast<WarningLevel>(i + 1);
        }
    }
    return level;
}

template <class S>
void CollisionWarning<S>::follow(WarningLevel wanted, WarningLevel kept) {
    if (wanted > level_) {
        falling_ = 0;
        if (++rising_ < config_.rise_frames) return;
        level_ = wanted;
        rising_ = 0;
        return;
    }
    rising_ = 0;
    if (kept >= level_) {
        falling_ = 0;
        return;
    }
    if (++falling_ < config_.fall_frames) return;
    level_ = kept > wanted ? kept : wanted;
    falling_ = 0;
}

/// The one the firmware uses is compiled once, in collision_warning.cpp.
extern template class CollisionWarning<dsp::Real>;

}  // namespace tracking
