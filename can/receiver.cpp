#include "can/receiver.hpp"

#include <cstddef>
#include <span>

namespace can {
namespace {

/// Bytes by identifier, 0 where we have no message.
constexpr std::array<std::uint8_t, kIdCount> make_lengths() {
    std::array<std::uint8_t, kIdCount> lengths{};
    for (const Message* message : kMessages)
        for (std::size_t i = 0; i < message->count; ++i)
            lengths[message->id - kFirstId + i] = message->length;
    return lengths;
}

constexpr std::array<std::uint8_t, kIdCount> kLengths = make_lengths();

constexpr bool is_ours(std::uint16_t id) {
    return id >= kFirstId && id < kFirstId + kIdCount && kLengths[id - kFirstId] != 0;
}

}  // namespace

E2eStatus Receiver::status(std::uint16_t id) const {
    return is_ours(id) ? states_[id - kFirstId].status : E2eStatus::no_new_data;
}

void Receiver::no_new_data(std::uint16_t id) {
    if (is_ours(id)) e2e_check(states_[id - kFirstId], {}, id, config_);
}

Reception Receiver::check(const Frame& frame) {
    if (!is_ours(frame.id)) return Reception::unknown_id;
    if (frame.length != kLengths[frame.id - kFirstId]) return Reception::wrong_length;
    E2eReceiverState& state = states_[frame.id - kFirstId];
    const E2eStatus status = e2e_check(state, std::span(frame.data).first(frame.length), frame.id, config_);
    counters_.lost += state.lost;
    switch (status) {
        case E2eStatus::ok:
            return Reception::ok;
        case E2eStatus::ok_some_lost:
            return Reception::ok_some_lost;
        case E2eStatus::repeated:
            return Reception::repeated;
        case E2eStatus::wrong_sequence:
            return Reception::wrong_sequence;
        case E2eStatus::error:
        case E2eStatus::no_new_data:
            break;
    }
    return Reception::bad_crc;
}

Reception Receiver::count(Reception reception) {
    switch (reception) {
        case Reception::ok:
        case Reception::ok_some_lost:
            ++counters_.good;
            break;
        case Reception::repeated:
            ++counters_.repeated;
            break;
        case Reception::wrong_sequence:
            ++counters_.wrong_sequence;
            break;
        case Reception::bad_crc:
            ++counters_.bad_crc;
            break;
        case Reception::wrong_length:
            ++counters_.wrong_length;
            break;
        case Reception::out_of_range:
            ++counters_.out_of_range;
            break;
        case Reception::unknown_id:
            ++counters_.unknown_id;
            break;
    }
    return reception;
}

}  // namespace can
