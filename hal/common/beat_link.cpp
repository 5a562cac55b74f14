#include "hal/common/beat_link.hpp"

#include <bit>
#include <cstring>

namespace hal {
namespace {

static_assert(std::endian::native == std::endian::little, "packets are copied, not converted");

constexpr std::size_t kCrcFrom = 4;
constexpr std::size_t kCrcAt = kBeatPacketBytes - 4;

/// Sync, length and version. No proper suffix of the sync is a prefix of it, so a search never has to go back.
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

bool BeatLinkReceiver::push(std::uint8_t byte) {
    const std::size_t at = count_++;
    bytes()[at] = byte;
    if (at < kHeader.size()) {
        if (byte != kHeader[at]) {
            resynchronise();
            return false;
        }
        if (at < kCrcFrom) {
            crc_ = kCrc32Start;
            return false;
        }
    }
    if (at < kCrcAt) {
        crc_ = crc32_step(crc_, byte);
        return false;
    }
    if (count_ < kBeatPacketBytes) return false;
    if (packet_.crc != ~crc_) {
        ++counters_.crc_errors;
        resynchronise();
        return false;
    }
    count_ = 0;
    ++counters_.frames;
    return true;
}

/// Drops the shortest possible beginning of the buffer after which the rest could be the beginning of a packet.
void BeatLinkReceiver::resynchronise() {
    const std::uint8_t* const buffer = bytes();
    std::size_t start = 1;
    for (; start < count_; ++start) {
        const std::size_t length = count_ - start;
        if (buffer[start] == kHeader[0] &&
            std::memcmp(buffer + start, kHeader.data(), length < kHeader.size() ? length : kHeader.size()) == 0) {
            break;
        }
    }
    counters_.skipped += static_cast<std::uint32_t>(start);
    count_ -= start;
    std::memmove(bytes(), buffer + start, count_);
    crc_ = kCrc32Start;
    for (std::size_t i = kCrcFrom; i < count_; ++i) crc_ = crc32_step(crc_, buffer[i]);
}

}  // namespace hal
