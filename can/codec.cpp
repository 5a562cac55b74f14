#include "can/codec.hpp"

#include <bit>
#include <concepts>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "can/signals.hpp"

namespace can {
namespace {

/// Collects signals into a frame.
class Packer {
  public:
    explicit Packer(const Message& message, std::uint16_t id) {
        encoded_.frame.id = id;
        encoded_.frame.length = message.length;
    }

    template <const Signal& kSignal, class T>
    void field(const T& value) {
        if constexpr (std::is_enum_v<T>) {
            put<kSignal>(to_count<kSignal>(static_cast<std::underlying_type_t<T>>(value)));
        } else if constexpr (std::is_same_v<T, bool>) {
            put<kSignal>(value ? 1 : 0);
        } else {
            put<kSignal>(to_count<kSignal>(value));
        }
    }

    template <const Signal& kSignal, class T>
    void field(const std::optional<T>& value) {
        if (value) {
            field<kSignal>(*value);
        } else {
            invalidate<kSignal>();
        }
    }

    template <const Signal& kSignal>
    void invalidate() {
        static_assert(kSignal.invalid.has_value());
        put<kSignal>(*kSignal.invalid);
    }

    void limited() { encoded_.limited = true; }

    Encoded finish() {
        static_assert(std::endian::native == std::endian::little);
        encoded_.frame.data = std::bit_cast<decltype(encoded_.frame.data)>(word_);
        return encoded_;
    }

  private:
    /// Nearest count, halves away from zero, within min..max. In 32 bits: what lies outside is told first.
    template <const Signal& kSignal, class T>
    std::int32_t to_count(T value) {
        constexpr std::int64_t kHalf = kSignal.step / 2;
        constexpr std::int64_t kLeast = (kSignal.min - 1) * kSignal.step + kHalf + 1;
        constexpr std::int64_t kMost = (kSignal.max + 1) * kSignal.step - kHalf - 1;
        static_assert(kSignal.min <= 0 && kSignal.max >= 0);
        static_assert(std::in_range<std::int32_t>(kLeast - kHalf) &&
                      std::in_range<std::int32_t>(kMost + kHalf));
        if (std::cmp_less(value, kLeast)) {
            encoded_.limited = true;
            return static_cast<std::int32_t>(kSignal.min);
        }
        if (std::cmp_greater(value, kMost)) {
            encoded_.limited = encoded_.limited || !kSignal.or_more;
            return static_cast<std::int32_t>(kSignal.max);
        }
        const auto units = static_cast<std::int32_t>(value);
        constexpr auto kHalf32 = static_cast<std::int32_t>(kHalf);
        return (units + (units < 0 ? -kHalf32 : kHalf32)) / kSignal.step;
    }

    /// Once for each signal: all bits are 0 before.
    template <const Signal& kSignal>
    void put(std::int64_t count) {
        constexpr std::uint64_t kMask = (std::uint64_t{1} << kSignal.length) - 1;
        word_ |= (static_cast<std::uint64_t>(count) & kMask) << kSignal.start;
    }

    Encoded encoded_;
    std::uint64_t word_ = 0;
};

/// Reads signals from a frame and remembers whether all of them were in range and available.
class Unpacker {
  public:
    explicit Unpacker(const Frame& frame) {
        for (unsigned i = 0; i < frame.length; ++i) word_ |= std::uint64_t{frame.data[i]} << (8 * i);
    }

    template <const Signal& kSignal, class T>
    void field(T& value) {
        const std::int64_t count = get<kSignal>();
        if (kSignal.invalid && count == *kSignal.invalid) {
            available_ = false;
        } else if (count < kSignal.min || count > kSignal.max) {
            in_range_ = false;
        } else {
            value = static_cast<T>(count * kSignal.step);
        }
    }

    template <const Signal& kSignal, class T>
    void field(std::optional<T>& value) {
        static_assert(kSignal.invalid.has_value());
        value.reset();
        if (get<kSignal>() == *kSignal.invalid) return;
        value.emplace();
        field<kSignal>(*value);
    }

    bool in_range() const { return in_range_; }
    bool available() const { return available_; }

  private:
    template <const Signal& kSignal>
    std::int64_t get() const {
        constexpr std::uint64_t kMask = (std::uint64_t{1} << kSignal.length) - 1;
        constexpr std::int64_t kSign = kSignal.is_signed ? std::int64_t{1} << (kSignal.length - 1) : 0;
        const auto count = static_cast<std::int64_t>((word_ >> kSignal.start) & kMask);
        return (count ^ kSign) - kSign;
    }

    std::uint64_t word_ = 0;
    bool in_range_ = true;
    bool available_ = true;
};

// Which member is which signal: read by the packer and by the unpacker, so that the two can not differ.

template <class T, class Message>
concept Either = std::same_as<std::remove_const_t<T>, Message>;

void each_field(auto& io, Either<Status> auto& m) {
    io.template field<kCycle>(m.cycle);
    io.template field<status::kMode>(m.mode);
    io.template field<status::kFaults>(m.faults);
    io.template field<status::kDetections>(m.detections);
    io.template field<status::kOverruns>(m.overruns);
}

void each_field(auto& io, Either<Version> auto& m) {
    io.template field<version::kProtocol>(m.protocol);
    io.template field<version::kMajor>(m.major);
    io.template field<version::kMinor>(m.minor);
    io.template field<version::kPatch>(m.patch);
    io.template field<version::kWaveformId>(m.waveform_id);
}

void each_field(auto& io, Either<CollisionWarning> auto& m) {
    io.template field<kCycle>(m.cycle);
    io.template field<warning::kLevel>(m.level);
    io.template field<warning::kValid>(m.valid);
    io.template field<warning::kTrackId>(m.track_id);
    io.template field<warning::kTimeToCollision>(m.time_to_collision_ms);
    io.template field<warning::kRequiredDeceleration>(m.required_deceleration_mmps2);
}

void each_field(auto& io, Either<CommandEcho> auto& m) {
    io.template field<command::kCode>(m.code);
    io.template field<command::kSequence>(m.sequence);
    io.template field<command::kResult>(m.result);
    io.template field<command::kValueInForce>(m.value);
}

void each_field(auto& io, Either<ObjectListHeader> auto& m) {
    io.template field<kCycle>(m.cycle);
    io.template field<object_list::kValid>(m.valid);
    io.template field<object_list::kOverflow>(m.overflow);
    io.template field<object_list::kCount>(m.count);
}

void each_kinematics_field(auto& io, Either<Object> auto& m) {
    io.template field<kCycle>(m.cycle);
    io.template field<kinematics::kMotion>(m.motion);
    io.template field<kinematics::kCoasting>(m.coasting);
    io.template field<kinematics::kTrackId>(m.track_id);
    io.template field<kinematics::kRange>(m.range_mm);
    io.template field<kinematics::kRangeRate>(m.range_rate_mmps);
}

void each_quality_field(auto& io, Either<Object> auto& m) {
    io.template field<kCycle>(m.cycle);
    io.template field<quality::kRangeSigma>(m.range_sigma_mm);
    io.template field<quality::kRangeRateSigma>(m.range_rate_sigma_mmps);
    io.template field<quality::kSnr>(m.snr_cdb);
    io.template field<quality::kExistence>(m.existence_percent);
    io.template field<quality::kAge>(m.age_cycles);
}

void each_field(auto& io, Either<EgoMotion> auto& m) {
    io.template field<ego::kValid>(m.valid);
    io.template field<ego::kSpeed>(m.speed_mmps);
    io.template field<ego::kAcceleration>(m.acceleration_mmps2);
}

void each_field(auto& io, Either<Command> auto& m) {
    io.template field<command::kCode>(m.code);
    io.template field<command::kSequence>(m.sequence);
    io.template field<command::kValue>(m.value);
}

template <const Message& kMessage, class T>
Encoded encode_as(const T& value) {
    Packer packer(kMessage, kMessage.id);
    each_field(packer, value);
    return packer.finish();
}

template <const Message& kMessage>
bool is_frame_of(const Frame& frame) {
    return kMessage.has(frame.id) && frame.length == kMessage.length;
}

template <const Message& kMessage, class T>
bool decode_as(const Frame& frame, T& value) {
    if (!is_frame_of<kMessage>(frame)) return false;
    Unpacker unpacker(frame);
    T read;
    each_field(unpacker, read);
    if (!unpacker.in_range()) return false;
    if constexpr (requires { read.valid; }) {
        if (!unpacker.available()) read.valid = false;
    } else if (!unpacker.available()) {
        return false;
    }
    value = read;
    return true;
}

template <const Message& kMessage>
Packer object_packer(const Object& object) {
    const bool fits = object.index < kMaxObjects;
    Packer packer(kMessage,
                  static_cast<std::uint16_t>(kMessage.id + (fits ? object.index : kMaxObjects - 1)));
    if (!fits) packer.limited();
    return packer;
}

}  // namespace

Encoded encode(const Status& status) {
    return encode_as<status::kMessage>(status);
}

Encoded encode(const Version& version) {
    return encode_as<version::kMessage>(version);
}

Encoded encode(const CollisionWarning& warning) {
    if (warning.valid) return encode_as<warning::kMessage>(warning);
    Packer packer(warning::kMessage, warning::kMessage.id);
    packer.field<kCycle>(warning.cycle);
    packer.invalidate<warning::kLevel>();
    packer.invalidate<warning::kTimeToCollision>();
    packer.invalidate<warning::kRequiredDeceleration>();
    return packer.finish();
}

Encoded encode(const CommandEcho& echo) {
    return encode_as<command::kEchoMessage>(echo);
}

Encoded encode(const ObjectListHeader& header) {
    return encode_as<object_list::kMessage>(header);
}

Encoded encode_kinematics(const Object& object) {
    Packer packer = object_packer<kinematics::kMessage>(object);
    each_kinematics_field(packer, object);
    return packer.finish();
}

Encoded encode_quality(const Object& object) {
    Packer packer = object_packer<quality::kMessage>(object);
    each_quality_field(packer, object);
    return packer.finish();
}

Encoded encode(const EgoMotion& ego) {
    if (ego.valid) return encode_as<ego::kMessage>(ego);
    Packer packer(ego::kMessage, ego::kMessage.id);
    packer.invalidate<ego::kSpeed>();
    packer.invalidate<ego::kAcceleration>();
    return packer.finish();
}

Encoded encode(const Command& command) {
    return encode_as<command::kMessage>(command);
}

bool decode(const Frame& frame, Status& status) {
    return decode_as<status::kMessage>(frame, status);
}

bool decode(const Frame& frame, Version& version) {
    return decode_as<version::kMessage>(frame, version);
}

bool decode(const Frame& frame, CollisionWarning& warning) {
    return decode_as<warning::kMessage>(frame, warning);
}

bool decode(const Frame& frame, CommandEcho& echo) {
    return decode_as<command::kEchoMessage>(frame, echo);
}

bool decode(const Frame& frame, ObjectListHeader& header) {
    return decode_as<object_list::kMessage>(frame, header);
}

bool decode(const Frame& frame, Object& object) {
    Object read = object;
    Unpacker unpacker(frame);
    if (is_frame_of<kinematics::kMessage>(frame)) {
        read.index = static_cast<std::uint8_t>(frame.id - kinematics::kMessage.id);
        each_kinematics_field(unpacker, read);
    } else if (is_frame_of<quality::kMessage>(frame)) {
        read.index = static_cast<std::uint8_t>(frame.id - quality::kMessage.id);
        each_quality_field(unpacker, read);
    } else {
        return false;
    }
    if (!unpacker.in_range() || !unpacker.available()) return false;
    object = read;
    return true;
}

bool decode(const Frame& frame, EgoMotion& ego) {
    return decode_as<ego::kMessage>(frame, ego);
}

bool decode(const Frame& frame, Command& command) {
    return decode_as<command::kMessage>(frame, command);
}

}  // namespace can
