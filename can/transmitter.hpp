/// The sending end: messages to protected frames.
#pragma once

#include <array>
#include <cstdint>

#include "can/codec.hpp"
#include "can/signals.hpp"

namespace can {

/// Keeps the counter of every message that one node sends. Each call makes the frame that has to be sent
/// next: a frame that is made but then dropped is seen as lost by the receivers, as it should be.
class Transmitter {
  public:
    Frame frame(const Status& status) { return protect(encode(status)); }
    Frame frame(const Version& version) { return protect(encode(version)); }
    Frame frame(const CollisionWarning& warning) { return protect(encode(warning)); }
    Frame frame(const CommandEcho& echo) { return protect(encode(echo)); }
    Frame frame(const ObjectListHeader& header) { return protect(encode(header)); }
    Frame frame(const EgoMotion& ego) { return protect(encode(ego)); }
    Frame frame(const Command& command) { return protect(encode(command)); }
    Frame kinematics(const Object& object) { return protect(encode_kinematics(object)); }
    Frame quality(const Object& object) { return protect(encode_quality(object)); }

    /// Frames in which a value had to be limited to its signal's range, modulo 2^32.
    std::uint32_t limited() const { return limited_; }

  private:
    Frame protect(Encoded encoded);

    std::array<std::uint8_t, kIdCount> counters_{};
    std::uint32_t limited_ = 0;
};

}  // namespace can
