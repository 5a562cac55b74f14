#include "hal/common/beat_link.hpp"

#include <bit>
#include <cstring>

namespace hal {
namespace {

static_assert(std::endian::native == std::endian::little, "packets are copied, not converted");

constexpr std::size_t kCrcFrom = 4;
constexpr std::size_t kCrcAt = kBeatPacketBytes - 4;

/// Sync, length and version. No proper suffix of the sync is a prefix of it, so a search never has to go
/// back.
constexpr std::array<std::uint8_t, 8> kHeader{0xB5, 'F', 'M', 'W', 0x00, 0x20, 0x01, 0x00};
static_assert(kHeader[4] + 256 * kHeader[5] == sizeof(dsp::BeatFrame));

}  // namespace

void encode_beat_packet(const dsp::BeatFrame& frame, std::uint32_t sequence, BeatPacket& packet) {
    std::memcpy(packet.data(), kHeader.data(), kHeader.size());
    std::memcpy(packet.data() + 8, &sequence, sizeof sequence);
    std::memcpy(packet.data() + 12, &frame, sizeof frame);
    const std::uint32_t crc = crc32(std::span(packet).subspan(kCrcFrom, kCrcAt - kCrcFrom));
    std::memcpy(packet.data() + kCrcAt, &crc, sizeof crc);
}

std::uint8_t& BeatLinkReceiver::byte_at(std::size_t i, dsp::BeatFrame& frame) {
    if (i < kHeaderBytes) return header_[i];
    if (i < kCrcAt) return reinterpret_cast<std::uint8_t*>(&frame)[i - kHeaderBytes];
    return trailer_[i - kCrcAt];
}

bool BeatLinkReceiver::push(std::uint8_t byte, dsp::BeatFrame& frame) {
    const std::size_t at = count_++;
    byte_at(at, frame) = byte;
    if (at < kHeader.size() && byte != kHeader[at]) {
        resynchronise(frame);
        return false;
    }
    if (at < kCrcFrom) {
        crc_ = kCrc32Start;
        return false;
    }
    if (at < kCrcAt) {
        crc_ = crc32_step(crc_, byte);
        return false;
    }
    if (count_ < kBeatPacketBytes) return false;
    if (word(trailer_.data()) != ~crc_) {
        ++counters_.crc_errors;
        resynchronise(frame);
        return false;
    }
    count_ = 0;
    sequence_ = word(header_.data() + 8);
    ++counters_.frames;
    return true;
}

/// Drops the shortest possible beginning of what was received after which the rest could be the beginning of
/// a packet.
void BeatLinkReceiver::resynchronise(dsp::BeatFrame& frame) {
    std::size_t start = 1;
    for (; start < count_; ++start) {
        std::size_t same = 0;
        while (same < kHeader.size() && start + same < count_ &&
               byte_at(start + same, frame) == kHeader[same])
            ++same;
        if (same == kHeader.size() || start + same == count_) break;
    }
    counters_.skipped += static_cast<std::uint32_t>(start);
    count_ -= start;
    crc_ = kCrc32Start;
    for (std::size_t i = 0; i < count_; ++i) {
        const std::uint8_t byte = byte_at(start + i, frame);
        byte_at(i, frame) = byte;
        if (i >= kCrcFrom) crc_ = crc32_step(crc_, byte);
    }
}

}  // namespace hal
