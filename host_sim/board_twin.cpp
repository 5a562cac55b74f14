#include "host_sim/board_twin.hpp"

#include <algorithm>
#include <cstdio>
#include <cstring>
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

bool FirmwareReplica::same_state(const FirmwareReplica& other) const {
    // Of the counters only these two are told on the bus.
    const firmware::RadarCounters& mine = radar_.counters();
    const firmware::RadarCounters& its = other.radar_.counters();
    if (mine.overruns != its.overruns || mine.cycles != its.cycles) return false;
    const auto* const a = reinterpret_cast<const std::byte*>(&radar_);
    const auto* const b = reinterpret_cast<const std::byte*>(&other.radar_);
    const auto at = static_cast<std::size_t>(reinterpret_cast<const std::byte*>(&mine) - a);
    const std::size_t after = at + sizeof mine;
    return std::memcmp(a, b, at) == 0 && std::memcmp(a + after, b + after, sizeof radar_ - after) == 0;
}

BoardTwin::BoardTwin(const firmware::RadarConfig& config)
    : histories_{{.replica = std::make_shared<FirmwareReplica>(config), .beats = {}, .bus = {}}} {}

void BoardTwin::beat_sent(std::uint32_t sequence, const dsp::BeatFrame& frame) {
    candidates_.clear();
    const auto sent = std::make_shared<const SentBeat>(SentBeat{sequence, frame});
    for (History& h : histories_) {
        h.beats.push_back(sent);
        if (h.beats.size() > kMaxBeats) h.beats.pop_front();
    }
}

void BoardTwin::bus_sent(const can::Frame& frame) {
    candidates_.clear();
    for (History& h : histories_) {
        h.bus.push_back(frame);
        if (h.bus.size() > kMaxBus) h.bus.pop_front();
    }
}

BoardTwinCounters BoardTwin::counters() const {
    BoardTwinCounters c = histories_.front().counters;
    c.lists = lists_;
    c.different = different_;
    c.can_frames = can_frames_;
    return c;
}

std::optional<ListVerdict> BoardTwin::receive(const can::Frame& frame) {
    if (frame.id < can::status::kMessage.id || frame.id >= can::ego::kMessage.id) return std::nullopt;
    ++can_frames_;
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
        ++different_;
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

void BoardTwin::add_candidate(const History& before, hal::BeatResult beat, std::size_t beats_gone,
                              bool overrun, std::size_t bus_count) {
    const auto bus_end = before.bus.begin() + static_cast<std::ptrdiff_t>(bus_count);
    const std::vector<can::Frame> bus(before.bus.begin(), bus_end);
    CycleInputs inputs{.beat = beat, .overrun = overrun, .bus = bus};
    Candidate c{.after = before, .list = {}, .beat = beat, .sequence = 0};
    c.after.bus.erase(c.after.bus.begin(), c.after.bus.begin() + static_cast<std::ptrdiff_t>(bus_count));
    c.after.beats.erase(c.after.beats.begin(),
                        c.after.beats.begin() + static_cast<std::ptrdiff_t>(beats_gone));
    BoardTwinCounters& counters = c.after.counters;
    if (overrun) ++counters.overruns;
    switch (beat) {
        case hal::BeatResult::ok:
            inputs.frame = &before.beats[beats_gone - 1]->frame;
            inputs.sequence = c.sequence = before.beats[beats_gone - 1]->sequence;
            ++counters.processed;
            break;
        case hal::BeatResult::invalid:
            if (beats_gone == 0) c.after.met_old_bytes = true;
            ++counters.invalid;
            break;
        default:
            ++counters.missing;
    }
    const auto replica = std::make_shared<FirmwareReplica>(*before.replica);
    c.list = replica->run(inputs);
    c.after.replica = replica;
    candidates_.push_back(std::move(c));
}

/// Everything that can have led to the list whose status is known, the most likely first. `beats`: so many of
/// the beat frames not taken yet are tried.
void BoardTwin::find_candidates(std::size_t beats) {
    candidates_.clear();
    can::Status status;
    const bool readable = can::decode(list_.front(), status);
    // A fault's bit is set from the very cycle on.
    const auto possible = [&](can::Fault fault) {
        return !readable || (status.faults & static_cast<std::uint16_t>(fault)) != 0;
    };
    const bool missing = possible(can::Fault::frame_missing);
    const bool invalid = possible(can::Fault::frame_invalid);
    for (const History& h : histories_) {
        // The status counts late cycles, but a restart sets the count to 0.
        const bool restart = std::any_of(
            h.bus.begin(), h.bus.end(), [](const can::Frame& f) { return can::command::kMessage.has(f.id); });
        const bool late = readable && status.overruns != overruns_before_;
        for (std::size_t unread = 0; unread <= h.bus.size(); ++unread) {
            for (const bool overrun : {late, !late}) {
                if (overrun != late && !restart) continue;
                const std::size_t bus_count = h.bus.size() - unread;
                const std::size_t most = std::min(beats, h.beats.size());
                for (std::size_t gone = 1; gone <= most; ++gone)
                    add_candidate(h, hal::BeatResult::ok, gone, overrun, bus_count);
                if (readable && status.detections != 0) continue;  // there was a frame to detect them in
                if (missing) add_candidate(h, hal::BeatResult::missing, 0, overrun, bus_count);
                for (std::size_t gone = 1; gone <= most && invalid; ++gone)
                    add_candidate(h, hal::BeatResult::invalid, gone, overrun, bus_count);
                if (invalid && !h.met_old_bytes)
                    add_candidate(h, hal::BeatResult::invalid, 0, overrun, bus_count);
            }
        }
    }
    // Nothing fits a status like this; what the PC would have said without a frame is compared with it.
    if (candidates_.empty()) add_candidate(histories_.front(), hal::BeatResult::missing, 0, false, 0);
}

/// `whole`: nothing more will come of the list.
std::optional<ListVerdict> BoardTwin::judge(bool whole) {
    const auto begins_so = [this](const Candidate& c) {
        return c.list.size() >= list_.size() && std::equal(list_.begin(), list_.end(), c.list.begin());
    };
    if (candidates_.empty()) find_candidates(kLikelyBeats);
    if (std::none_of(candidates_.begin(), candidates_.end(), begins_so)) find_candidates(kMaxBeats);

    std::vector<const Candidate*> equal;
    for (const Candidate& c : candidates_) {
        if (!begins_so(c)) continue;
        if (c.list.size() == list_.size()) {
            equal.push_back(&c);
        } else if (!whole) {
            return std::nullopt;  // it may go on
        }
    }
    if (!equal.empty()) return settle(equal, "");

    const auto equal_frames = [this](const Candidate& c) {
        return static_cast<std::size_t>(
            std::mismatch(list_.begin(), list_.end(), c.list.begin(), c.list.end()).first - list_.begin());
    };
    const Candidate& nearest = *std::max_element(
        candidates_.begin(), candidates_.end(),
        [&](const Candidate& a, const Candidate& b) { return equal_frames(a) < equal_frames(b); });
    const std::size_t at = equal_frames(nearest);
    const std::string expected = at < nearest.list.size() ? to_text(nearest.list[at]) : "the end of the list";
    const std::string got = at < list_.size() ? to_text(list_[at]) : "nothing more";
    return settle({&nearest}, "frame " + std::to_string(at + 1) + ": board " + got + ", PC " + expected);
}

ListVerdict BoardTwin::settle(const std::vector<const Candidate*>& chosen, std::string difference) {
    ListVerdict verdict{.identical = difference.empty(),
                        .beat = chosen.front()->beat,
                        .sequence = chosen.front()->sequence,
                        .difference = std::move(difference)};
    ++lists_;
    if (!verdict.identical) ++different_;
    pass_over_rest_ = !verdict.identical;
    can::Status status;
    if (can::decode(list_.front(), status)) overruns_before_ = status.overruns;

    std::vector<History> next;
    for (const Candidate* c : chosen) {
        const History& h = c->after;
        const bool known = std::any_of(next.begin(), next.end(), [&](const History& other) {
            return other.beats == h.beats && other.bus == h.bus && other.met_old_bytes == h.met_old_bytes &&
                   other.replica->same_state(*h.replica);
        });
        if (!known) next.push_back(h);
    }
    // Damage is rare.
    std::ranges::stable_sort(next, {}, [](const History& h) { return h.counters.invalid; });
    if (next.size() > kMaxHistories) next.erase(next.begin() + kMaxHistories, next.end());
    histories_ = std::move(next);
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
