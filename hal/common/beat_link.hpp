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
/// At 1 Mbaud (8N1) it takes 82.08 ms of the 100 ms period, so that a sender who keeps the period leaves the
/// receiver 17.9 ms in which it need not look at the line.
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
static_assert(kBeatPacketBytes * 10 * 1000 / kBeatLinkBaud < 90,
              "a frame, in ms, fits the period with room to spare");

using BeatPacket = std::array<std::uint8_t, kBeatPacketBytes>;

/// Writes the packet of a frame: what the sending side does.
void encode_beat_packet(const dsp::BeatFrame& frame, std::uint32_t sequence, BeatPacket& packet);

struct BeatLinkCounters {
    std::uint32_t frames = 0;      ///< packets received intact
    std::uint32_t crc_errors = 0;  ///< packets of full length whose checksum did not match
    std::uint32_t skipped = 0;     ///< bytes that belong to no intact packet
};

/// Byte by byte receiver. Every intact packet that does not overlap an earlier intact one is found: when a
/// packet turns out to be broken, what was received of it is searched for the start of the next, so that a
/// truncated packet does not cost the good one behind it. About 20 instructions a byte; after a broken packet
/// up to one pass over 8 KiB for each header found in it.
class BeatLinkReceiver {
  public:
    /// Samples go straight to where they are wanted, `frame`, the same at each call until one returns true:
    /// the byte completed a packet, and `sequence()` is that of `frame`. Until then `frame` holds nothing of
    /// use.
    bool push(std::uint8_t byte, dsp::BeatFrame& frame);

    [[nodiscard]] std::uint32_t sequence() const { return sequence_; }
    [[nodiscard]] const BeatLinkCounters& counters() const { return counters_; }

  private:
    static constexpr std::size_t kHeaderBytes = 12;

    static std::uint32_t word(const std::uint8_t* bytes) {
        return bytes[0] | std::uint32_t{bytes[1]} << 8 | std::uint32_t{bytes[2]} << 16 |
               std::uint32_t{bytes[3]} << 24;
    }
    std::uint8_t& byte_at(std::size_t i, dsp::BeatFrame& frame);
    void resynchronise(dsp::BeatFrame& frame);

    std::array<std::uint8_t, kHeaderBytes> header_{};
    std::array<std::uint8_t, 4> trailer_{};
    std::size_t count_ = 0;  ///< bytes of the packet received
    std::uint32_t crc_ = kCrc32Start;
    std::uint32_t sequence_ = 0;
    BeatLinkCounters counters_;
};

}  // namespace hal
