#include "can/e2e.hpp"

#include <array>

namespace can {
namespace {

constexpr std::uint8_t kPolynomial = 0x1D;

constexpr std::array<std::uint8_t, 256> make_table() {
    std::array<std::uint8_t, 256> table{};
    for (unsigned value = 0; value < table.size(); ++value) {
        unsigned crc = value;
        for (int bit = 0; bit < 8; ++bit) crc = (crc & 0x80u) != 0 ? (crc << 1) ^ kPolynomial : crc << 1;
        table[value] = static_cast<std::uint8_t>(crc);
    }
    return table;
}

constexpr std::array<std::uint8_t, 256> kTable = make_table();

}  // namespace

std::uint8_t crc8(std::span<const std::uint8_t> bytes, std::uint8_t crc) {
    for (const std::uint8_t byte : bytes) crc = kTable[static_cast<std::uint8_t>(crc ^ byte)];
    return crc;
}

std::uint8_t e2e_crc(std::span<const std::uint8_t> bytes, std::uint16_t data_id) {
    const std::array<std::uint8_t, 2> id = {static_cast<std::uint8_t>(data_id & 0xFFu),
                                            static_cast<std::uint8_t>(data_id >> 8)};
    return crc8(bytes.subspan(1), crc8(id));
}

void e2e_protect(Frame& frame, std::uint16_t data_id, std::uint8_t& counter) {
    if (frame.length < 2 || frame.length > frame.data.size()) return;
    frame.data[1] = static_cast<std::uint8_t>((frame.data[1] & 0xF0u) | (counter & 0x0Fu));
    frame.data[0] = e2e_crc(std::span(frame.data).first(frame.length), data_id);
    counter = static_cast<std::uint8_t>(counter + 1u < kE2eCounters ? counter + 1u : 0u);
}

E2eStatus e2e_check(E2eReceiverState& state, std::span<const std::uint8_t> bytes, std::uint16_t data_id,
                    const E2eConfig& config) {
    state.lost = 0;
    if (bytes.empty()) return state.status = E2eStatus::no_new_data;
    if (bytes.size() < 2) return state.status = E2eStatus::error;
    const auto counter = static_cast<std::uint8_t>(bytes[1] & 0x0Fu);
    if (counter >= kE2eCounters || bytes[0] != e2e_crc(bytes, data_id))
        return state.status = E2eStatus::error;

    const unsigned delta = (0u + counter + kE2eCounters - state.counter) % kE2eCounters;
    const bool first = !state.synchronised;
    state.synchronised = true;
    state.counter = counter;
    if (first) return state.status = E2eStatus::ok;
    if (delta == 0) return state.status = E2eStatus::repeated;
    state.lost = static_cast<std::uint8_t>(delta - 1);
    if (delta > config.max_delta) return state.status = E2eStatus::wrong_sequence;
    return state.status = delta == 1 ? E2eStatus::ok : E2eStatus::ok_some_lost;
}

}  // namespace can
