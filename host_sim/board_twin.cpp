#include "host_sim/board_twin.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "can/codec.hpp"
#include "can/signals.hpp"

namespace sim {

/// The board around a replica. Everything in it is set anew for each cycle.
struct FirmwareReplica::World final : hal::BeatSource, hal::CanPort, hal::Clock, hal::Watchdog, hal::Console {
    CycleInputs inputs;
    std::size_t next_bus = 0;
    std::uint64_t time_us = 0;
    std::vector<can::Frame> sent;

    hal::BeatResult acquire(dsp::BeatFrame& frame, std::uint32_t& sequence) override {
        if (inputs.beat == hal::BeatResult::ok) {
            frame = *inputs.frame;
            sequence = inputs.sequence;
        }
        return inputs.beat;
    }
    bool send(const can::Frame& frame) override {
        sent.push_back(frame);
        return true;
    }
    bool receive(can::Frame& frame) override {
        if (next_bus == inputs.bus.size()) return false;
        frame = inputs.bus[next_bus++];
        return true;
    }
    void begin_cycle() override {}
    hal::CanState state() override { return hal::CanState::active; }
    hal::CanCounters counters() override { return {}; }
    std::uint64_t now_us() override { return time_us; }
    void wait_until(std::uint64_t until_us) override { time_us = std::max(time_us, until_us); }
    void start() override {}
    void kick() override {}
    void line(std::string_view) override {}
    int read() override { return -1; }

    hal::Board board() { return {*this, *this, *this, *this, *this}; }
};

FirmwareReplica::FirmwareReplica(const firmware::RadarConfig& config)
    : world_(std::make_shared<World>()), radar_(config, world_->board()) {
    radar_.start();
}

std::vector<can::Frame> FirmwareReplica::run(const CycleInputs& inputs) {
    const auto period_us = static_cast<std::uint64_t>(radar_.config().waveform.period_ms) * 1000;
    world_->inputs = inputs;
    world_->next_bus = 0;
    world_->sent.clear();
    // Late by less than a period, so that the replica stays on its own time grid.
    world_->time_us = next_start_us_ + (inputs.overrun ? period_us / 2 : 0);
    next_start_us_ += period_us;
    radar_.run_cycle();
    return std::move(world_->sent);
}

BoardTwin::BoardTwin(const firmware::RadarConfig& config)
    : replica_(std::make_unique<FirmwareReplica>(config)) {}

void BoardTwin::beat_sent(std::uint32_t sequence, const dsp::BeatFrame& frame) {
    candidates_.clear();
    beats_.push_back({sequence, frame});
    if (beats_.size() > kMaxBeats) {
        beats_.pop_front();
        ++counters_.passed_over;
    }
}

void BoardTwin::bus_sent(const can::Frame& frame) {
    candidates_.clear();
    bus_.push_back(frame);
    if (bus_.size() > kMaxBus) bus_.pop_front();
}

std::optional<ListVerdict> BoardTwin::receive(const can::Frame& frame) {
    if (frame.id < can::status::kMessage.id || frame.id >= can::ego::kMessage.id) return std::nullopt;
    ++counters_.can_frames;
    if (can::status::kMessage.has(frame.id)) {
        const std::optional<ListVerdict> last = give_up_list();
        list_.assign(1, frame);
        candidates_.clear();
        settled_ = false;
        pass_over_rest_ = false;
        return last;
    }
    if (settled_) {
        if (list_.empty() || pass_over_rest_) return std::nullopt;  // empty: in the middle of a list at start
        pass_over_rest_ = true;
        ++counters_.different;
        return ListVerdict{.difference = "after the end of the list came " + to_text(frame)};
    }
    list_.push_back(frame);
    return header_and_objects_there() ? judge(false) : std::nullopt;
}

std::optional<ListVerdict> BoardTwin::give_up_list() {
    return settled_ ? std::nullopt : judge(true);
}

bool BoardTwin::header_and_objects_there() const {
    constexpr std::size_t kHeaderAt = 2;  // after status and warning
    if (list_.size() <= kHeaderAt) return false;
    can::ObjectListHeader header;
    if (!can::decode(list_[kHeaderAt], header)) return true;
    return list_.size() >= kHeaderAt + 1 + 2 * std::size_t{header.count};
}

std::vector<BoardTwin::Candidate> BoardTwin::possible_inputs() const {
    can::Status status;
    const bool late = can::decode(list_.front(), status) && status.overruns != overruns_before_;
    std::vector<Candidate> all;
    for (const bool overrun : {late, !late}) {
        for (std::size_t unread = 0; unread <= bus_.size(); ++unread) {
            const std::size_t bus_count = bus_.size() - unread;
            for (std::size_t i = 0; i < beats_.size(); ++i)
                all.push_back({hal::BeatResult::ok, i, overrun, bus_count, nullptr, {}});
            all.push_back({hal::BeatResult::missing, 0, overrun, bus_count, nullptr, {}});
            all.push_back({hal::BeatResult::invalid, 0, overrun, bus_count, nullptr, {}});
        }
    }
    return all;
}

void BoardTwin::evaluate(Candidate& candidate) const {
    if (candidate.after) return;
    const std::vector<can::Frame> bus(bus_.begin(),
                                      bus_.begin() + static_cast<std::ptrdiff_t>(candidate.bus_count));
    CycleInputs inputs{.beat = candidate.beat, .overrun = candidate.overrun, .bus = bus};
    if (candidate.beat == hal::BeatResult::ok) {
        inputs.frame = &beats_[candidate.beat_index].frame;
        inputs.sequence = beats_[candidate.beat_index].sequence;
    }
    candidate.after = std::make_unique<FirmwareReplica>(*replica_);
    candidate.list = candidate.after->run(inputs);
}

/// `whole`: nothing more will come of the list.
std::optional<ListVerdict> BoardTwin::judge(bool whole) {
    if (candidates_.empty()) candidates_ = possible_inputs();
    Candidate* nearest = nullptr;
    std::size_t nearest_equal = 0;
    for (Candidate& c : candidates_) {
        evaluate(c);
        const auto equal = static_cast<std::size_t>(
            std::mismatch(list_.begin(), list_.end(), c.list.begin(), c.list.end()).first - list_.begin());
        if (equal == list_.size() && equal == c.list.size()) return settle(c, "");
        if (equal == list_.size() && equal < c.list.size() && !whole) return std::nullopt;
        if (nearest == nullptr || equal > nearest_equal) {
            nearest = &c;
            nearest_equal = equal;
        }
    }
    const std::string expected =
        nearest_equal < nearest->list.size() ? to_text(nearest->list[nearest_equal]) : "the end of the list";
    const std::string got = nearest_equal < list_.size() ? to_text(list_[nearest_equal]) : "nothing more";
    return settle(*nearest, "frame " + std::to_string(nearest_equal + 1) + " of the list: board " + got +
                                ", PC " + expected);
}

ListVerdict BoardTwin::settle(Candidate& chosen, std::string difference) {
    ListVerdict verdict{.identical = difference.empty(),
                        .beat = chosen.beat,
                        .overrun = chosen.overrun,
                        .difference = std::move(difference)};
    ++counters_.lists;
    if (!verdict.identical) ++counters_.different;
    pass_over_rest_ = !verdict.identical;
    if (chosen.overrun) ++counters_.overruns;
    switch (chosen.beat) {
        case hal::BeatResult::ok:
            verdict.sequence = beats_[chosen.beat_index].sequence;
            ++counters_.processed;
            counters_.passed_over += chosen.beat_index;
            beats_.erase(beats_.begin(), beats_.begin() + static_cast<std::ptrdiff_t>(chosen.beat_index) + 1);
            break;
        case hal::BeatResult::invalid:
            ++counters_.invalid;
            break;
        default:
            ++counters_.missing;
    }
    bus_.erase(bus_.begin(), bus_.begin() + static_cast<std::ptrdiff_t>(chosen.bus_count));
    can::Status status;
    if (can::decode(list_.front(), status)) overruns_before_ = status.overruns;
    replica_ = std::move(chosen.after);
    candidates_.clear();
    settled_ = true;
    return verdict;
}

std::string to_text(const can::Frame& frame) {
    char text[32];
    int length = std::snprintf(text, sizeof text, "%03X#", static_cast<unsigned>(frame.id));
    for (std::size_t i = 0; i < frame.length && i < frame.data.size(); ++i)
        length += std::snprintf(text + length, sizeof text - static_cast<std::size_t>(length), "%02X",
                                static_cast<unsigned>(frame.data[i]));
    return text;
}

}  // namespace sim
