/// Every message and signal on the bus: the one place where the layout is written down. `can/codec.cpp` packs
/// and unpacks by it and `radar_monitor --write-dbc` makes `can/radar.dbc` of it. The codec reads it at
/// compile time only: names and comments take no memory in an image.
///
/// All signals are Intel byte order. Bits 0..7 of every message are the CRC, bits 8..11 the counter
/// (can/e2e.hpp); the E2E data id is the identifier, so a frame under another's identifier always fails its
/// CRC.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "can/messages.hpp"

namespace can {

struct ValueName {
    std::int32_t raw;
    std::string_view name;
};

struct Signal {
    std::string_view name;
    std::uint8_t start;         ///< bit number of the least significant bit: 8 * byte + bit
    std::uint8_t length;        ///< bits
    bool is_signed = false;     ///< two's complement
    std::int32_t step = 1;      ///< one count in the unit of the struct in can/messages.hpp, for example 5 mm
    std::uint8_t decimals = 0;  ///< one unit of the DBC is 10^decimals units of the struct: 3 for mm and m
    std::string_view unit = {};
    std::int64_t min = 0;  ///< in counts
    std::int64_t max = 0;  ///< in counts
    std::optional<std::int64_t> invalid =
        std::nullopt;      ///< count that means "not available"; outside min..max
    bool or_more = false;  ///< max stands for all that is greater, so reaching it is no error
    std::string_view comment = {};
    std::span<const ValueName> values = {};
};

struct Message {
    std::string_view name;
    std::uint16_t id;         ///< of the first of `count` messages of this layout
    std::uint8_t count;       ///< consecutive identifiers
    std::uint8_t length;      ///< bytes
    std::uint16_t period_ms;  ///< 0: sent on event
    std::string_view sender;
    std::string_view receivers;  ///< separated by commas
    std::string_view comment;
    std::span<const Signal* const> signals;

    constexpr bool has(std::uint16_t some_id) const { return some_id >= id && some_id < id + count; }
};

inline constexpr Signal kCrc = {
    .name = "Crc", .start = 0, .length = 8, .max = 255, .comment = "E2E profile 11, CRC-8 0x1D"};
inline constexpr Signal kCounter = {
    .name = "Counter", .start = 8, .length = 4, .max = 14, .comment = "E2E profile 11, 0..14 cyclic"};
/// In the same place wherever it appears. A consumer takes objects for one list only if they agree in it.
inline constexpr Signal kCycle = {.name = "Cycle",
                                  .start = 12,
                                  .length = 8,
                                  .max = 255,
                                  .comment = "Radar cycle modulo 256, equal in all messages of one cycle"};

namespace status {
inline constexpr ValueName kModes[] = {{0, "Starting"}, {1, "Operating"}, {2, "Degraded"}, {3, "Failed"}};
inline constexpr ValueName kFaultBits[] = {
    {0x001, "AdcDead"},      {0x002, "AdcStuck"}, {0x004, "AdcSaturated"}, {0x008, "FrameMissing"},
    {0x010, "FrameInvalid"}, {0x020, "Blocked"},  {0x040, "Interference"}, {0x080, "OverCapacity"},
    {0x100, "EgoStale"},     {0x200, "CanError"}, {0x400, "Overrun"},      {0x800, "Internal"}};
inline constexpr Signal kMode = {.name = "Mode",
                                 .start = 20,
                                 .length = 4,
                                 .max = 3,
                                 .comment = "Degraded: objects are sent, but see Faults; Failed: no objects",
                                 .values = kModes};
inline constexpr Signal kFaults = {.name = "Faults",
                                   .start = 24,
                                   .length = 16,
                                   .max = 0xFFF,
                                   .comment = "Sum of the fault bits in the value table",
                                   .values = kFaultBits};
inline constexpr Signal kDetections = {.name = "Detections",
                                       .start = 40,
                                       .length = 8,
                                       .max = 255,
                                       .comment = "Detections of this cycle before tracking"};
inline constexpr Signal kOverruns = {.name = "Overruns",
                                     .start = 48,
                                     .length = 8,
                                     .max = 255,
                                     .comment = "Cycles longer than the period, modulo 256"};
inline constexpr const Signal* kSignals[] = {&kCrc,    &kCounter,    &kCycle,   &kMode,
                                             &kFaults, &kDetections, &kOverruns};
inline constexpr Message kMessage = {
    .name = "RadarStatus",
    .id = 0x400,
    .count = 1,
    .length = 7,
    .period_ms = 100,
    .sender = "Radar",
    .receivers = "Ecu,Driver",
    .comment = "Health. An empty object list with a fault set is not an empty road",
    .signals = kSignals};
}  // namespace status

namespace version {
inline constexpr Signal kProtocol = {.name = "Protocol",
                                     .start = 16,
                                     .length = 8,
                                     .max = 255,
                                     .comment = "Of this file; changes when a signal moves"};
inline constexpr Signal kMajor = {
    .name = "Major", .start = 24, .length = 8, .max = 255, .comment = "Firmware"};
inline constexpr Signal kMinor = {
    .name = "Minor", .start = 32, .length = 8, .max = 255, .comment = "Firmware"};
inline constexpr Signal kPatch = {
    .name = "Patch", .start = 40, .length = 8, .max = 255, .comment = "Firmware"};
inline constexpr Signal kWaveformId = {.name = "WaveformId",
                                       .start = 48,
                                       .length = 16,
                                       .max = 65535,
                                       .comment = "Which waveform the image is built for"};
inline constexpr const Signal* kSignals[] = {&kCrc,   &kCounter, &kProtocol,  &kMajor,
                                             &kMinor, &kPatch,   &kWaveformId};
inline constexpr Message kMessage = {.name = "RadarVersion",
                                     .id = 0x401,
                                     .count = 1,
                                     .length = 8,
                                     .period_ms = 1000,
                                     .sender = "Radar",
                                     .receivers = "Ecu,Driver",
                                     .comment = "Version of firmware, protocol and waveform",
                                     .signals = kSignals};
}  // namespace version

namespace warning {
inline constexpr ValueName kLevels[] = {
    {0, "None"}, {1, "Inform"}, {2, "Warn"}, {3, "Brake"}, {7, "NotAvailable"}};
inline constexpr ValueName kNoTime[] = {{65535, "NotAvailable"}};
inline constexpr ValueName kNoTrack[] = {{0, "NoTrack"}};
inline constexpr Signal kLevel = {
    .name = "Level",
    .start = 20,
    .length = 3,
    .max = 3,
    .invalid = 7,
    .comment = "Most urgent level of all tracks; NotAvailable whenever Valid is 0",
    .values = kLevels};
inline constexpr Signal kValid = {.name = "Valid",
                                  .start = 23,
                                  .length = 1,
                                  .max = 1,
                                  .comment = "0: no statement is possible, for the faults in RadarStatus"};
inline constexpr Signal kTrackId = {.name = "TrackId",
                                    .start = 24,
                                    .length = 8,
                                    .max = 255,
                                    .comment = "Track the warning is about",
                                    .values = kNoTrack};
inline constexpr Signal kTimeToCollision = {.name = "TimeToCollision",
                                            .start = 32,
                                            .length = 16,
                                            .decimals = 3,
                                            .unit = "s",
                                            .max = 65534,
                                            .invalid = 65535,
                                            .or_more = true,
                                            .comment = "NotAvailable: nothing approaches",
                                            .values = kNoTime};
inline constexpr Signal kRequiredDeceleration = {.name = "RequiredDeceleration",
                                                 .start = 48,
                                                 .length = 16,
                                                 .step = 10,
                                                 .decimals = 3,
                                                 .unit = "m/s^2",
                                                 .max = 65534,
                                                 .invalid = 65535,
                                                 .or_more = true,
                                                 .comment = "To avoid the collision, positive when braking",
                                                 .values = kNoTime};
inline constexpr const Signal* kSignals[] = {&kCrc,   &kCounter, &kCycle,           &kLevel,
                                             &kValid, &kTrackId, &kTimeToCollision, &kRequiredDeceleration};
inline constexpr Message kMessage = {.name = "CollisionWarning",
                                     .id = 0x402,
                                     .count = 1,
                                     .length = 8,
                                     .period_ms = 100,
                                     .sender = "Radar",
                                     .receivers = "Ecu,Driver",
                                     .comment = "Warning of the most urgent confirmed track",
                                     .signals = kSignals};
}  // namespace warning

namespace command {
inline constexpr ValueName kCodes[] = {{0, "None"},      {1, "SetTracker"},  {2, "SetCfarScale"},
                                       {3, "SetMinSnr"}, {4, "ResetTracks"}, {5, "Restart"}};
inline constexpr ValueName kResults[] = {
    {0, "None"}, {1, "Applied"}, {2, "UnknownCommand"}, {3, "ValueOutOfRange"}, {4, "NotSupported"}};
inline constexpr std::int64_t kInt32Min = -2147483647 - 1;
inline constexpr std::int64_t kInt32Max = 2147483647;

inline constexpr Signal kCode = {.name = "Code",
                                 .start = 12,
                                 .length = 4,
                                 .max = 15,
                                 .comment = "Codes not in the value table are answered with UnknownCommand",
                                 .values = kCodes};
inline constexpr Signal kSequence = {.name = "Sequence",
                                     .start = 16,
                                     .length = 8,
                                     .max = 255,
                                     .comment = "Chosen by the sender, repeated in the echo"};
inline constexpr Signal kValue = {.name = "Value",
                                  .start = 24,
                                  .length = 32,
                                  .is_signed = true,
                                  .min = kInt32Min,
                                  .max = kInt32Max,
                                  .comment = "Argument of the command"};
inline constexpr const Signal* kSignals[] = {&kCrc, &kCounter, &kCode, &kSequence, &kValue};
inline constexpr Message kMessage = {
    .name = "Command",
    .id = 0x432,
    .count = 1,
    .length = 7,
    .period_ms = 0,
    .sender = "Driver",
    .receivers = "Radar",
    .comment = "Applied between two cycles, all or nothing, and always answered",
    .signals = kSignals};

inline constexpr Signal kResult = {.name = "Result",
                                   .start = 24,
                                   .length = 8,
                                   .max = 4,
                                   .comment = "What became of the command",
                                   .values = kResults};
inline constexpr Signal kValueInForce = {.name = "ValueInForce",
                                         .start = 32,
                                         .length = 32,
                                         .is_signed = true,
                                         .min = kInt32Min,
                                         .max = kInt32Max,
                                         .comment = "After the command, whether it was applied or not"};
inline constexpr const Signal* kEchoSignals[] = {&kCrc,      &kCounter, &kCode,
                                                 &kSequence, &kResult,  &kValueInForce};
inline constexpr Message kEchoMessage = {.name = "CommandEcho",
                                         .id = 0x403,
                                         .count = 1,
                                         .length = 8,
                                         .period_ms = 0,
                                         .sender = "Radar",
                                         .receivers = "Ecu,Driver",
                                         .comment = "Answer to each command",
                                         .signals = kEchoSignals};
}  // namespace command

namespace object_list {
inline constexpr Signal kValid = {.name = "Valid",
                                  .start = 20,
                                  .length = 1,
                                  .max = 1,
                                  .comment = "0: the list, empty or not, is no statement about the road"};
inline constexpr Signal kOverflow = {
    .name = "Overflow",
    .start = 21,
    .length = 1,
    .max = 1,
    .comment = "1: more confirmed tracks than fit; these are the most important"};
inline constexpr Signal kCount = {.name = "Count",
                                  .start = 24,
                                  .length = 8,
                                  .max = kMaxObjects,
                                  .comment = "Objects that follow in this cycle"};
inline constexpr const Signal* kSignals[] = {&kCrc, &kCounter, &kCycle, &kValid, &kOverflow, &kCount};
inline constexpr Message kMessage = {
    .name = "ObjectListHeader",
    .id = 0x410,
    .count = 1,
    .length = 4,
    .period_ms = 100,
    .sender = "Radar",
    .receivers = "Ecu",
    .comment =
        "Sent before its objects. The list is whole when Count objects of both "
        "kinds with the same Cycle followed",
    .signals = kSignals};
}  // namespace object_list

namespace kinematics {
inline constexpr ValueName kMotions[] = {
    {0, "Unknown"}, {1, "Stationary"}, {2, "Moving"}, {3, "Oncoming"}, {4, "Stopped"}};
inline constexpr Signal kMotion = {.name = "Motion",
                                   .start = 20,
                                   .length = 3,
                                   .max = 4,
                                   .comment = "Over ground; Stopped was seen moving before",
                                   .values = kMotions};
inline constexpr Signal kCoasting = {.name = "Coasting",
                                     .start = 23,
                                     .length = 1,
                                     .max = 1,
                                     .comment = "1: predicted, not measured in this cycle"};
inline constexpr Signal kTrackId = {.name = "TrackId",
                                    .start = 24,
                                    .length = 8,
                                    .max = 255,
                                    .comment = "1..255, the same as long as the track lives"};
inline constexpr Signal kRange = {.name = "Range",
                                  .start = 32,
                                  .length = 16,
                                  .step = 5,
                                  .decimals = 3,
                                  .unit = "m",
                                  .max = 65535,
                                  .comment = "Radial distance from the radar"};
inline constexpr Signal kRangeRate = {.name = "RangeRate",
                                      .start = 48,
                                      .length = 16,
                                      .is_signed = true,
                                      .step = 5,
                                      .decimals = 3,
                                      .unit = "m/s",
                                      .min = -32768,
                                      .max = 32767,
                                      .comment = "Change of range, negative when closing"};
inline constexpr const Signal* kSignals[] = {&kCrc,      &kCounter, &kCycle, &kMotion,
                                             &kCoasting, &kTrackId, &kRange, &kRangeRate};
inline constexpr Message kMessage = {.name = "ObjectKinematics",
                                     .id = 0x411,
                                     .count = kMaxObjects,
                                     .length = 8,
                                     .period_ms = 100,
                                     .sender = "Radar",
                                     .receivers = "Ecu",
                                     .comment = "Where one object is; sent while the list is long enough",
                                     .signals = kSignals};
}  // namespace kinematics

namespace quality {
inline constexpr Signal kRangeSigma = {.name = "RangeSigma",
                                       .start = 20,
                                       .length = 10,
                                       .step = 10,
                                       .decimals = 3,
                                       .unit = "m",
                                       .max = 1023,
                                       .or_more = true,
                                       .comment = "Standard deviation of Range"};
inline constexpr Signal kRangeRateSigma = {.name = "RangeRateSigma",
                                           .start = 30,
                                           .length = 10,
                                           .step = 5,
                                           .decimals = 3,
                                           .unit = "m/s",
                                           .max = 1023,
                                           .or_more = true,
                                           .comment = "Standard deviation of RangeRate"};
inline constexpr Signal kSnr = {.name = "Snr",
                                .start = 40,
                                .length = 8,
                                .step = 50,
                                .decimals = 2,
                                .unit = "dB",
                                .max = 255,
                                .or_more = true,
                                .comment = "Integrated, of the last detection"};
inline constexpr Signal kExistence = {.name = "Existence",
                                      .start = 48,
                                      .length = 8,
                                      .unit = "%",
                                      .max = 100,
                                      .comment = "Probability that there is an object"};
inline constexpr Signal kAge = {.name = "Age",
                                .start = 56,
                                .length = 8,
                                .unit = "cycles",
                                .max = 255,
                                .or_more = true,
                                .comment = "Since the track was started"};
inline constexpr const Signal* kSignals[] = {&kCrc, &kCounter,   &kCycle, &kRangeSigma, &kRangeRateSigma,
                                             &kSnr, &kExistence, &kAge};
inline constexpr Message kMessage = {
    .name = "ObjectQuality",
    .id = 0x421,
    .count = kMaxObjects,
    .length = 8,
    .period_ms = 100,
    .sender = "Radar",
    .receivers = "Ecu",
    .comment = "How well the object is known; sent while the list is long enough",
    .signals = kSignals};
}  // namespace quality

namespace ego {
inline constexpr ValueName kNoValue[] = {{-32768, "NotAvailable"}};
inline constexpr Signal kValid = {.name = "Valid",
                                  .start = 12,
                                  .length = 1,
                                  .max = 1,
                                  .comment = "0: the car does not know its motion; the rest means nothing"};
inline constexpr Signal kSpeed = {.name = "Speed",
                                  .start = 16,
                                  .length = 16,
                                  .is_signed = true,
                                  .step = 5,
                                  .decimals = 3,
                                  .unit = "m/s",
                                  .min = -32767,
                                  .max = 32767,
                                  .invalid = -32768,
                                  .comment = "Along the car's axis, positive forward",
                                  .values = kNoValue};
inline constexpr Signal kAcceleration = {.name = "Acceleration",
                                         .start = 32,
                                         .length = 16,
                                         .is_signed = true,
                                         .step = 5,
                                         .decimals = 3,
                                         .unit = "m/s^2",
                                         .min = -32767,
                                         .max = 32767,
                                         .invalid = -32768,
                                         .comment = "Along the car's axis, positive when getting faster",
                                         .values = kNoValue};
inline constexpr const Signal* kSignals[] = {&kCrc, &kCounter, &kValid, &kSpeed, &kAcceleration};
inline constexpr Message kMessage = {.name = "EgoMotion",
                                     .id = 0x431,
                                     .count = 1,
                                     .length = 6,
                                     .period_ms = 100,
                                     .sender = "Ecu",
                                     .receivers = "Radar",
                                     .comment = "Motion of the car that carries the radar",
                                     .signals = kSignals};
}  // namespace ego

/// In the order of their identifiers.
inline constexpr std::array<const Message*, 9> kMessages = {
    &status::kMessage,      &version::kMessage,     &warning::kMessage,
    &command::kEchoMessage, &object_list::kMessage, &kinematics::kMessage,
    &quality::kMessage,     &ego::kMessage,         &command::kMessage};

inline constexpr std::uint16_t kFirstId = 0x400;
inline constexpr std::uint16_t kIdCount = 0x40;

/// The message an identifier belongs to; nullptr if it is none of ours.
constexpr const Message* find_message(std::uint16_t id) {
    for (const Message* message : kMessages)
        if (message->has(id)) return message;
    return nullptr;
}

constexpr bool is_valid(const Signal& signal) {
    const std::int64_t span = std::int64_t{1} << signal.length;
    const std::int64_t low = signal.is_signed ? -span / 2 : 0;
    const std::int64_t high = low + span - 1;
    const bool fits = low <= signal.min && signal.min <= signal.max && signal.max <= high;
    const bool invalid_apart =
        !signal.invalid || (low <= *signal.invalid && *signal.invalid <= high &&
                            (*signal.invalid < signal.min || *signal.invalid > signal.max));
    return signal.length >= 1 && signal.length <= 32 && signal.step >= 1 && fits && invalid_apart;
}

/// Signals inside the frame and free of overlap, identifiers ours and free of overlap.
constexpr bool is_valid(const Message& message) {
    if (message.length < 2 || message.length > 8 || message.id < kFirstId ||
        message.id + message.count > kFirstId + kIdCount)
        return false;
    if (message.signals[0] != &kCrc || message.signals[1] != &kCounter) return false;
    std::uint64_t used = 0;
    for (const Signal* signal : message.signals) {
        if (!is_valid(*signal) || signal->start + signal->length > 8 * message.length) return false;
        const std::uint64_t bits = ((std::uint64_t{1} << signal->length) - 1) << signal->start;
        if ((used & bits) != 0) return false;
        used |= bits;
    }
    return true;
}

constexpr bool are_messages_valid() {
    int next_id = kFirstId;
    for (const Message* message : kMessages) {
        if (!is_valid(*message) || message->id < next_id) return false;
        next_id = message->id + message->count;
    }
    return true;
}
static_assert(are_messages_valid());

}  // namespace can
