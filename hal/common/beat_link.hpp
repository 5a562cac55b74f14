/// Beat frames over a serial line: the packet, and a receiver that finds its way back after garbage.
///
/// A packet is 8208 bytes, little-endian:
///
/// | offset | bytes | meaning |
/// |---|---|---|
/// | 0 | 4 | sync 0xB5 'F' 'M' 'W' |
/// | 4 | 2 | payload length, 8192 |
/// | 6 | 2 | version of this format, 1 |
/// | 8 | 4 | sequence number of the frame, counts up by one |
/// | 12 | 8192 | samples as in dsp::BeatFrame |
/// | 8204 | 4 | CRC-32 of bytes 4 to 8203 |
///
/// At 1 Mbaud (8N1) it takes 82.08 ms of the 100 ms period, so that a sender who keeps the period leaves the receiver
/// 17.9 ms in which it need not look at the line.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "dsp/beat_frame.hpp"
#include "hal/common/crc32.hpp"

namespace hal {

inline constexpr std::size_t kBeatPacketBytes = 8208;
inline constexpr std::uint32_t kBeatLinkBaud = 1'000'000;
static_assert(kBeatPacketBytes * 10 * 1000 / kBeatLinkBaud < 90, "a frame, in ms, fits the period with room to spare");

using BeatPacket = std::array<std::uint8_t, kBeatPacketBytes>;

/// Writes the packet of a frame: what the sending side does.
void encode_beat_packet(const dsp::BeatFrame& frame, std::uint32_t sequence, BeatPacket& packet);

struct BeatLinkCounters {
    std::uint32_t frames = 0;      ///< packets received intact
    std::uint32_t crc_errors = 0;  ///< packets of full length whose checksum did not match
    std::uint32_t skipped = 0;     ///< bytes that belong to no intact packet
};

/// Byte by byte receiver. Every intact packet that does not overlap an earlier intact one is found: when a packet turns
/// out to be broken, what was received of it is searched for the start of the next, so that a truncated packet does not
/// cost the good one behind it. About 20 instructions a byte; after a broken packet up to one pass over 8 KiB a
/// candidate.
class BeatLinkReceiver {
  public:
    /// True: the byte completed a packet; `frame()` and `sequence()` hold it until 8 more bytes came.
    bool push(std::uint8_t byte);

    [[nodiscard]] const dsp::BeatFrame& frame() const { return packet_.frame; }
    [[nodiscard]] std::uint32_t sequence() const { return packet_.sequence; }
    [[nodiscard]] const BeatLinkCounters& counters() const { return counters_; }

  private:
    struct Packet {
        std::array<std::uint8_t, 4> sync;
        std::array<std::uint8_t, 4> format;
        std::uint32_t sequence;
        dsp::BeatFrame frame;
        std::uint32_t crc;
    };
    static_assert(sizeof(Packet) == kBeatPacketBytes);

    [[nodiscard]] std::uint8_t* bytes() { return reinterpret_cast<std::uint8_t*>(&packet_); }
    void resynchronise();

    Packet packet_{};
    std::size_t count_ = 0;  ///< bytes of packet_ received
    std::uint32_t crc_ = kCrc32Start;
    BeatLinkCounters counters_;
};

}  // namespace hal
