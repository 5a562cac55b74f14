/// What the radar says and hears on the bus, in integer engineering units. Nothing here depends on how fast
/// the processor is: the same beat frames give the same bytes on every platform. `can/codec.hpp` turns these
/// into frames, `can/radar.dbc` describes the same frames to the rest of the world.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

namespace can {

inline constexpr int kMaxObjects = 16;

/// Why the output may not be trusted. One bit each in RadarStatus; an empty object list with a bit set is not
/// an empty road.
enum class Fault : std::uint16_t {
    adc_dead = 1 << 0,       ///< every sample of the frame equal
    adc_stuck = 1 << 1,      ///< the same frame, or chirp, again and again
    adc_saturated = 1 << 2,  ///< too many samples at the ends of the converter's range
    frame_missing = 1 << 3,  ///< no beat frame within the period
    frame_invalid = 1 << 4,  ///< short, stale or corrupt beat frame
    blocked = 1 << 5,        ///< nothing seen while the car moves
    interference = 1 << 6,   ///< noise floor far above its normal level
    over_capacity = 1 << 7,  ///< more detections, tracks or objects than fit; the strongest are kept
    ego_stale = 1 << 8,      ///< no valid ego motion for too long; warnings assume the last speed
    can_error = 1 << 9,      ///< transmit queue full, error passive or bus off since the last status
    overrun = 1 << 10,       ///< the last cycle took longer than the period
    internal = 1 << 11,      ///< a self check failed
};

enum class Mode : std::uint8_t { starting = 0, operating = 1, degraded = 2, failed = 3 };

struct Status {  ///< 0x400, every cycle
    Mode mode = Mode::starting;
    std::uint16_t faults = 0;  ///< bits of Fault
    std::uint8_t cycle = 0;    ///< frame counter modulo 256, equal in every message of one cycle
    std::uint8_t detections = 0;
    std::uint8_t overruns = 0;  ///< modulo 256
};

struct Version {  ///< 0x401, once a second
    std::uint8_t major = 0, minor = 0, patch = 0;
    std::uint8_t protocol = 1;  ///< of can/radar.dbc; changes when a signal moves
    std::uint16_t waveform_id = 0;
};

enum class WarningLevel : std::uint8_t { none = 0, inform = 1, warn = 2, brake = 3 };

struct CollisionWarning {  ///< 0x402, every cycle
    bool valid = false;    ///< false: no statement is possible (faults); level and values mean nothing
    WarningLevel level = WarningLevel::none;
    std::uint8_t track_id = 0;  ///< 0: none
    std::optional<std::int32_t> time_to_collision_ms = std::nullopt;
    std::int32_t required_deceleration_mmps2 = 0;
    std::uint8_t cycle = 0;
};

/// Commands the radar accepts. Applied between two cycles, all or nothing.
enum class CommandCode : std::uint8_t {
    none = 0,
    set_tracker = 1,
    set_cfar_scale = 2,
    set_min_snr = 3,
    reset_tracks = 4,
    restart = 5
};
enum class CommandResult : std::uint8_t {
    none = 0,
    applied = 1,
    unknown_command = 2,
    value_out_of_range = 3,
    not_supported = 4
};

struct CommandEcho {  ///< 0x403, in answer to each command
    CommandCode code = CommandCode::none;
    CommandResult result = CommandResult::none;
    std::uint8_t sequence = 0;  ///< of the command answered
    std::int32_t value = 0;     ///< in force after the command
};

struct ObjectListHeader {    ///< 0x410, every cycle, before its objects
    std::uint8_t count = 0;  ///< 0..16 objects follow
    std::uint8_t cycle = 0;
    bool valid = false;     ///< false: the list is not a statement about the road
    bool overflow = false;  ///< more confirmed tracks than fit
};

enum class Motion : std::uint8_t { unknown = 0, stationary = 1, moving = 2, oncoming = 3, stopped = 4 };

/// One confirmed track. Two frames: kinematics 0x411..0x420, quality 0x421..0x430, both by index in the list.
struct Object {
    std::uint8_t index = 0;     ///< 0..15
    std::uint8_t cycle = 0;     ///< of the header it belongs to
    std::uint8_t track_id = 0;  ///< 1..255
    std::int32_t range_mm = 0;
    std::int32_t range_rate_mmps = 0;
    Motion motion = Motion::unknown;
    bool coasting = false;  ///< not measured in this cycle
    std::uint32_t range_sigma_mm = 0;
    std::uint32_t range_rate_sigma_mmps = 0;
    std::uint8_t existence_percent = 0;
    std::int32_t snr_cdb = 0;  ///< hundredths of a decibel
    std::uint16_t age_cycles = 0;
};

struct EgoMotion {                ///< 0x431, from the car, at least every 100 ms
    std::int32_t speed_mmps = 0;  ///< along the car's axis, positive forward
    std::int32_t acceleration_mmps2 = 0;
    bool valid = false;
};

struct Command {  ///< 0x432, from the car or a tester
    CommandCode code = CommandCode::none;
    std::uint8_t sequence = 0;
    std::int32_t value = 0;
};

}  // namespace can
