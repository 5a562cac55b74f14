#include "host_sim/bus_monitor.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "host_sim/bus_load.hpp"

namespace sim {
namespace {

std::string seconds(std::uint64_t time_us) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3f s", static_cast<double>(time_us) * 1e-6);
    return text;
}

const char* complaint(can::Reception reception) {
    switch (reception) {
        case can::Reception::ok:
            break;
        case can::Reception::ok_some_lost:
            return "frames before this one were lost";
        case can::Reception::repeated:
            return "repeated counter";
        case can::Reception::wrong_sequence:
            return "counter out of sequence";
        case can::Reception::bad_crc:
            return "bad CRC";
        case can::Reception::wrong_length:
            return "wrong length";
        case can::Reception::out_of_range:
            return "value out of range";
        case can::Reception::unknown_id:
            return "unknown identifier";
    }
    return "";
}

}  // namespace

std::string value_name(std::span<const can::ValueName> names, std::int32_t value) {
    for (const can::ValueName& name : names)
        if (name.raw == value) return std::string(name.name);
    return std::to_string(value);
}

std::string fault_names(std::uint16_t faults) {
    std::string text;
    for (const can::ValueName& fault : can::status::kFaultBits)
        if ((faults & fault.raw) != 0) text += (text.empty() ? "" : "+") + std::string(fault.name);
    return text.empty() ? "none" : text;
}

std::string message_name(std::uint16_t id) {
    char number[16];
    const can::Message* message = can::find_message(id);
    if (message == nullptr) {
        std::snprintf(number, sizeof number, "0x%03X", unsigned{id});
        return number;
    }
    std::snprintf(number, sizeof number, "%02d", id - message->id);
    return std::string(message->name) + (message->count > 1 ? number : "");
}

void BusMonitor::event(const std::string& text) {
    events_.push_back(seconds(elapsed_us_) + "  " + text);
}

std::vector<std::string> BusMonitor::take_events() {
    return std::exchange(events_, {});
}

void BusMonitor::advance(std::uint64_t time_us) {
    const std::uint64_t before_us = now_us_.value_or(time_us);
    now_us_ = time_us;
    if (time_us < before_us) {
        ++counters_.time_backwards;
        event("the log's time goes back");
        return;
    }
    elapsed_us_ += time_us - before_us;
    for (auto& [id, watch] : watches_) {
        const std::uint64_t period_us = std::uint64_t{can::find_message(id)->period_ms} * 1000;
        if (watch.overdue || elapsed_us_ - watch.last_us <= period_us * 5 / 2) continue;
        watch.overdue = true;
        ++counters_.overdue;
        receiver_.no_new_data(id);
        event(message_name(id) + ": no new data since " + seconds(watch.last_us));
    }
}

void BusMonitor::line(const hal::CandumpLine& line, std::uint64_t number) {
    if (line.kind != hal::CandumpKind::garbage && line.kind != hal::CandumpKind::frame) advance(line.time_us);
    switch (line.kind) {
        case hal::CandumpKind::frame:
            frame(line.time_us, line.frame);
            break;
        case hal::CandumpKind::remote:
            ++counters_.remote;
            break;
        case hal::CandumpKind::extended:
            ++counters_.extended;
            break;
        case hal::CandumpKind::fd:
            ++counters_.fd;
            break;
        case hal::CandumpKind::error:
            ++counters_.error_frames;
            event("error frame, line " + std::to_string(number));
            break;
        case hal::CandumpKind::garbage:
            ++counters_.garbage_lines;
            event("line " + std::to_string(number) + " is no line of a CAN log");
            break;
    }
}

void BusMonitor::frame(std::uint64_t time_us, const can::Frame& frame) {
    advance(time_us);
    ++counters_.frames;
    bits_ += wire_bits(frame).size();
    dispatch(frame);
}

void BusMonitor::port_counters(const hal::CanCounters& counters) {
    counters_.rejected = counters.rejected;
    if (counters.receive_overflow != counters_.lost_here)
        event(std::to_string(counters.receive_overflow - counters_.lost_here) + " frames not read in time");
    counters_.lost_here = counters.receive_overflow;
}

void BusMonitor::dispatch(const can::Frame& frame) {
    switch (frame.id) {
        case can::status::kMessage.id:
            if (receive(frame, status_)) faults_seen_ |= status_->faults;
            return;
        case can::version::kMessage.id:
            receive(frame, version_);
            return;
        case can::warning::kMessage.id:
            if (receive(frame, warning_) && warning_->valid) ++levels_[warning_->level];
            return;
        case can::command::kEchoMessage.id: {
            std::optional<can::CommandEcho> echo;
            if (receive(frame, echo)) {
                event("answer to command " + std::to_string(echo->sequence) + " " +
                      value_name(can::command::kCodes, static_cast<int>(echo->code)) + ": " +
                      value_name(can::command::kResults, static_cast<int>(echo->result)) + ", in force " +
                      std::to_string(echo->value));
            }
            return;
        }
        case can::object_list::kMessage.id: {
            std::optional<can::ObjectListHeader> header;
            if (!receive(frame, header)) return;
            const std::uint32_t torn = list_.counters().torn;
            list_.header(*header);
            if (list_.counters().torn != torn) event("object list before this header is torn");
            list_started_ = true;
            most_objects_ = std::max(most_objects_, header->count);
            return;
        }
        case can::ego::kMessage.id:
            receive(frame, ego_);
            return;
        case can::command::kMessage.id: {
            std::optional<can::Command> command;
            if (receive(frame, command)) {
                event("command " + std::to_string(command->sequence) + " " +
                      value_name(can::command::kCodes, static_cast<int>(command->code)) + " " +
                      std::to_string(command->value));
            }
            return;
        }
        default:
            break;
    }
    if (can::kinematics::kMessage.has(frame.id) || can::quality::kMessage.has(frame.id)) {
        object_half(frame);
    } else {
        receiver_.ignore();
        ++counters_.foreign;
    }
}

void BusMonitor::object_half(const can::Frame& frame) {
    can::Object object;
    if (!judge(frame, receiver_.receive(frame, object))) return;
    if (!list_started_) return;  // listening began in the middle of a list
    const std::uint32_t stray = list_.counters().stray;
    if (can::kinematics::kMessage.has(frame.id)) {
        list_.kinematics(object);
    } else {
        list_.quality(object);
    }
    if (list_.counters().stray != stray) event(message_name(frame.id) + ": belongs to no list");
}

template <class Message>
bool BusMonitor::receive(const can::Frame& frame, std::optional<Message>& last) {
    Message message;
    if (!judge(frame, receiver_.receive(frame, message))) return false;
    last = message;
    seen(frame.id);
    return true;
}

/// Tells what is wrong with a frame; true if it is good.
bool BusMonitor::judge(const can::Frame& frame, can::Reception reception) {
    if (reception != can::Reception::ok) event(message_name(frame.id) + ": " + complaint(reception));
    return can::is_good(reception);
}

void BusMonitor::seen(std::uint16_t id) {
    if (can::find_message(id)->period_ms > 0) watches_[id] = {.last_us = elapsed_us_};
}

std::uint64_t BusMonitor::errors() const {
    const can::ReceiveCounters& r = receiver_.counters();
    return std::uint64_t{r.lost} + r.repeated + r.wrong_sequence + r.bad_crc + r.wrong_length +
           r.out_of_range + list_.counters().torn + list_.counters().stray + counters_.overdue +
           counters_.garbage_lines + counters_.error_frames + counters_.time_backwards + counters_.lost_here;
}

double BusMonitor::bus_load() const {
    if (duration_us() == 0) return 0;
    return static_cast<double>(bits_) / (static_cast<double>(duration_us()) * 1e-6 * kBitrate);
}

}  // namespace sim
