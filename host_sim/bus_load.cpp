#include "host_sim/bus_load.hpp"

#include <algorithm>

#include "can/signals.hpp"

namespace sim {

std::vector<bool> wire_bits(const can::Frame& frame) {
    constexpr unsigned kCrcPolynomial = 0x4599;
    constexpr int kCrcBits = 15;
    constexpr int kStuffAfter = 5;
    // Delimiter of the CRC, acknowledge slot (pulled down by the receivers) and its delimiter, end,
    // intermission.
    constexpr int kRecessiveAfterAcknowledge = 1 + 7 + 3;

    std::vector<bool> plain;
    const auto append = [&plain](unsigned value, int bits) {
        for (int bit = bits - 1; bit >= 0; --bit) plain.push_back((value >> bit & 1u) != 0);
    };
    append(0, 1);  // start of frame
    append(frame.id, 11);
    append(0, 3);  // RTR, IDE, r0
    append(frame.length, 4);
    for (unsigned i = 0; i < frame.length; ++i) append(frame.data[i], 8);
    unsigned crc = 0;
    for (const bool bit : plain) {
        const bool feedback = bit != ((crc >> (kCrcBits - 1) & 1u) != 0);
        crc = (crc << 1 & 0x7FFFu) ^ (feedback ? kCrcPolynomial : 0u);
    }
    append(crc, kCrcBits);

    std::vector<bool> wire;
    int run = 0;
    for (const bool bit : plain) {
        run = !wire.empty() && wire.back() == bit ? run + 1 : 1;
        wire.push_back(bit);
        if (run == kStuffAfter) {
            wire.push_back(!bit);
            run = 1;
        }
    }
    wire.push_back(true);
    wire.push_back(false);
    wire.insert(wire.end(), kRecessiveAfterAcknowledge, true);
    return wire;
}

std::vector<MessageLoad> message_loads(int objects) {
    constexpr double kCyclesPerS = 10;
    std::vector<MessageLoad> loads;
    for (const can::Message* message : can::kMessages) {
        const int frames = message->count == 1 ? 1 : std::clamp(objects, 0, int{message->count});
        const double rate = message->period_ms == 0 ? kCyclesPerS : 1000.0 / message->period_ms;
        loads.push_back({message->name, message->length, frames * rate,
                         frames * rate * worst_wire_bits(message->length)});
    }
    return loads;
}

}  // namespace sim
