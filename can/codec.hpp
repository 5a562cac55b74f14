/// Messages to frames and back, by the layout in can/signals.hpp. Pure functions; no protection in here: CRC
/// and counter are can/transmitter.hpp's and can/receiver.hpp's work, and encode() leaves their bits 0.
#pragma once

#include <cstdint>

#include "can/frame.hpp"
#include "can/messages.hpp"

namespace can {

/// Values are rounded to the nearest count, halves away from zero, and limited to the signal's range; a value
/// that is not available is sent as the signal's invalid count. Nothing ever wraps.
struct Encoded {
    Frame frame;
    /// A value did not fit and was limited, which the sender should count. Not set for signals whose greatest
    /// count stands for all that is more (ages, sigmas, times).
    bool limited = false;
};

Encoded encode(const Status& status);
Encoded encode(const Version& version);
/// Without valid, level and values are sent as not available: "none" can not be read from it.
Encoded encode(const CollisionWarning& warning);
Encoded encode(const CommandEcho& echo);
Encoded encode(const ObjectListHeader& header);
/// An index beyond 15 is limited to it.
Encoded encode_kinematics(const Object& object);
Encoded encode_quality(const Object& object);
/// Without valid, speed and acceleration are sent as not available.
Encoded encode(const EgoMotion& ego);
Encoded encode(const Command& command);

/// Reads the payload of a frame. False, and the message untouched: another identifier or length, or a count
/// out of its signal's range. A message with a `valid` member whose signals are not available is read as not
/// valid.
bool decode(const Frame& frame, Status& status);
bool decode(const Frame& frame, Version& version);
bool decode(const Frame& frame, CollisionWarning& warning);
bool decode(const Frame& frame, CommandEcho& echo);
bool decode(const Frame& frame, ObjectListHeader& header);
/// Either half of an object; the members that the other half carries keep their values.
bool decode(const Frame& frame, Object& object);
bool decode(const Frame& frame, EgoMotion& ego);
bool decode(const Frame& frame, Command& command);

}  // namespace can
