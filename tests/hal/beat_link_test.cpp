#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <random>
#include <vector>

#include "hal/common/beat_link.hpp"

#include <CppUTest/TestHarness.h>

namespace {

using Bytes = std::vector<std::uint8_t>;

/// A frame whose samples tell which one it is.
dsp::BeatFrame frame_number(std::uint32_t n) {
    dsp::BeatFrame frame;
    std::mt19937 random(n);
    for (auto& chirp : frame.chirp) {
        for (auto& sample : chirp) sample = static_cast<std::int16_t>(random());
    }
    return frame;
}

Bytes packet_number(std::uint32_t n) {
    hal::BeatPacket packet;
    hal::encode_beat_packet(frame_number(n), n, packet);
    return {packet.begin(), packet.end()};
}

void append(Bytes& to, const Bytes& from) {
    to.insert(to.end(), from.begin(), from.end());
}

bool same(const dsp::BeatFrame& a, const dsp::BeatFrame& b) {
    return std::memcmp(&a, &b, sizeof a) == 0;
}

/// Sequence numbers of the frames that came out; fails when one is not what was sent under its number.
std::vector<std::uint32_t> receive(const Bytes& line, hal::BeatLinkReceiver& receiver) {
    std::vector<std::uint32_t> got;
    dsp::BeatFrame frame;
    for (const std::uint8_t byte : line) {
        if (!receiver.push(byte, frame)) continue;
        CHECK_TRUE(same(frame_number(receiver.sequence()), frame));
        got.push_back(receiver.sequence());
    }
    return got;
}

}  // namespace

TEST_GROUP(BeatLink) {
    hal::BeatLinkReceiver receiver;
};

/// Written out from the table in the header, with the CRC checked by its own test.
TEST(BeatLink, layout) {
    dsp::BeatFrame frame;
    frame.chirp[0][0] = 0x1234;
    frame.chirp[0][1] = -2;
    frame.chirp[1][0] = 0x55;
    hal::BeatPacket packet;
    hal::encode_beat_packet(frame, 0xA1B2C3D4, packet);
    const std::array<std::uint8_t, 16> start{0xB5, 'F',  'M',  'W',  0x00, 0x20, 0x01, 0x00,
                                             0xD4, 0xC3, 0xB2, 0xA1, 0x34, 0x12, 0xFE, 0xFF};
    CHECK_EQUAL(0, std::memcmp(start.data(), packet.data(), start.size()));
    CHECK_EQUAL(0x55, packet[12 + 128]);
    const std::uint32_t crc = hal::crc32(std::span(packet).subspan(4, 8200));
    CHECK_EQUAL(crc & 0xFF, packet[8204]);
    CHECK_EQUAL(crc >> 24, packet[8207]);
}

TEST(BeatLink, good_packets_in_a_row) {
    Bytes line;
    for (std::uint32_t n = 0; n < 5; ++n) append(line, packet_number(n));
    CHECK_TRUE(receive(line, receiver) == (std::vector<std::uint32_t>{0, 1, 2, 3, 4}));
    CHECK_EQUAL(0U, receiver.counters().skipped);
    CHECK_EQUAL(5U, receiver.counters().frames);
}

TEST(BeatLink, packet_cut_short_costs_only_itself) {
    for (const std::size_t length : {1U, 3U, 4U, 8U, 11U, 12U, 100U, 8203U, 8204U, 8207U}) {
        hal::BeatLinkReceiver fresh;
        Bytes line = packet_number(1);
        line.resize(length);
        append(line, packet_number(2));
        append(line, packet_number(3));
        CHECK_TRUE(receive(line, fresh) == (std::vector<std::uint32_t>{2, 3}));
    }
}

TEST(BeatLink, packet_with_missing_byte_costs_only_itself) {
    for (const std::size_t at : {0U, 5U, 9U, 4000U, 8205U}) {
        hal::BeatLinkReceiver fresh;
        Bytes line = packet_number(1);
        line.erase(line.begin() + static_cast<std::ptrdiff_t>(at));
        append(line, packet_number(2));
        append(line, packet_number(3));
        CHECK_TRUE(receive(line, fresh) == (std::vector<std::uint32_t>{2, 3}));
    }
}

/// Any one, two or three flipped bits after the sync; CRC-32 has Hamming distance 4 at this length (Koopman
/// 2002).
TEST(BeatLink, flipped_bits_are_never_accepted) {
    std::mt19937 random(1);
    Bytes line;
    for (std::uint32_t n = 0; n < 300; ++n) {
        Bytes packet = packet_number(n);
        for (std::uint32_t flip = 0; flip <= n % 3; ++flip) {
            const std::uint32_t bit = 32 + static_cast<std::uint32_t>(random()) % ((8208 - 4) * 8);
            packet[bit / 8] = static_cast<std::uint8_t>(packet[bit / 8] ^ (1U << (bit % 8)));
        }
        if (packet != packet_number(n)) append(line, packet);
    }
    append(line, packet_number(1000));
    CHECK_TRUE(receive(line, receiver) == (std::vector<std::uint32_t>{1000}));
}

/// A payload that is full of headers: each is followed to its end in vain, and the packet behind is still
/// found.
TEST(BeatLink, headers_inside_a_broken_packet) {
    Bytes broken = packet_number(1);
    for (std::size_t at = 100; at + 8 < 8000; at += 500)
        std::copy_n(broken.begin(), 8, broken.begin() + static_cast<std::ptrdiff_t>(at));
    Bytes line = broken;
    append(line, packet_number(2));
    append(line, packet_number(3));
    append(line, packet_number(4));
    CHECK_TRUE(receive(line, receiver) == (std::vector<std::uint32_t>{2, 3, 4}));
}

/// 10^6 random bytes, flipped bits and truncated packets between good ones: every good packet comes out, in
/// order, and nothing else.
TEST(BeatLink, garbage_between_good_packets) {
    std::mt19937 random(20240607);
    Bytes line;
    std::vector<std::uint32_t> good;
    std::size_t garbage = 0;
    for (std::uint32_t n = 0; garbage < 1'000'000; ++n) {
        switch (random() % 4) {
            case 0: {
                const std::size_t length = random() % 60'000;
                for (std::size_t i = 0; i < length; ++i) line.push_back(static_cast<std::uint8_t>(random()));
                garbage += length;
                break;
            }
            case 1: {
                Bytes packet = packet_number(1'000'000 + n);
                const std::size_t bit = 32 + random() % ((8208 - 4) * 8);
                packet[bit / 8] = static_cast<std::uint8_t>(packet[bit / 8] ^ (1U << (bit % 8)));
                append(line, packet);
                break;
            }
            case 2: {
                Bytes packet = packet_number(1'000'000 + n);
                packet.resize(random() % packet.size());
                append(line, packet);
                break;
            }
            default:
                break;
        }
        append(line, packet_number(n));
        good.push_back(n);
    }
    // What follows a truncated packet at the very end would still be waited for.
    CHECK_TRUE(good.size() > 50);
    const std::vector<std::uint32_t> got = receive(line, receiver);
    std::printf("serial link: %zu random bytes, flips and truncations; %zu good frames sent, %zu taken\n",
                garbage, good.size(), got.size());
    CHECK_TRUE(got == good);
    CHECK_EQUAL(good.size(), receiver.counters().frames);
}
