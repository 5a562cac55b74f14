/// The other end of the bus: what a control unit that trusts nothing makes of the radar's frames.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "can/object_list.hpp"
#include "can/receiver.hpp"
#include "can/signals.hpp"
#include "hal/host/candump_log.hpp"

namespace sim {

/// Counts beyond those of the receiver and of the list reader.
struct MonitorCounters {
    std::uint64_t frames = 0;   ///< standard data frames, of whomever
    std::uint64_t foreign = 0;  ///< of these, with identifiers that are none of the radar's
    std::uint64_t remote = 0, extended = 0, fd = 0, error_frames = 0;  ///< in a log
    std::uint64_t rejected = 0;  ///< all these on an interface, which does not tell them apart
    std::uint64_t garbage_lines = 0;
    std::uint64_t overdue = 0;         ///< times a periodic message stayed away for more than 2.5 periods
    std::uint64_t time_backwards = 0;  ///< times the log's clock went back
    std::uint64_t lost_here = 0;       ///< frames this computer did not read in time
};

/// Feed it in order of time. Everything it finds wrong is counted, and told in an event.
class BusMonitor {
  public:
    void frame(std::uint64_t time_us, const can::Frame& frame);
    /// A line of a log, whatever it is; the number is for the report.
    void line(const hal::CandumpLine& line, std::uint64_t number);
    /// Time passes without a frame.
    void advance(std::uint64_t time_us);
    /// Frames the interface refused, and frames it lost, in all so far.
    void port_counters(const hal::CanCounters& counters);

    /// Number of object lists that came completely; grows by one when there is something new to show.
    std::uint32_t lists() const { return list_.counters().complete; }
    /// What happened since the last call, a line each.
    std::vector<std::string> take_events();

    /// Everything that should not be, all kinds together; 0 on a sound bus. Other nodes' traffic is none of
    /// it.
    std::uint64_t errors() const;
    const MonitorCounters& counters() const { return counters_; }
    const can::ReceiveCounters& receive_counters() const { return receiver_.counters(); }
    const can::ObjectListReader& list() const { return list_; }
    can::E2eStatus status_of(std::uint16_t id) const { return receiver_.status(id); }

    /// The last ones that can be believed; empty until the first.
    const std::optional<can::Status>& status() const { return status_; }
    const std::optional<can::Version>& version() const { return version_; }
    const std::optional<can::CollisionWarning>& warning() const { return warning_; }
    const std::optional<can::EgoMotion>& ego() const { return ego_; }

    /// Since the first frame; a clock that goes back takes nothing away.
    std::uint64_t duration_us() const { return elapsed_us_; }
    /// Share of the bus all standard data frames took, stuff bits as they were, 0..1. 0 before there are two
    /// times.
    double bus_load() const;
    std::uint16_t faults_seen() const { return faults_seen_; }
    std::uint8_t most_objects() const { return most_objects_; }
    const std::map<can::WarningLevel, std::uint64_t>& warning_levels() const { return levels_; }

  private:
    template <class Message>
    bool receive(const can::Frame& frame, std::optional<Message>& last);
    bool judge(const can::Frame& frame, can::Reception reception);
    void dispatch(const can::Frame& frame);
    void object_half(const can::Frame& frame);
    void seen(std::uint16_t id);
    void event(const std::string& text);

    /// When a periodic message last came, since the first frame.
    struct Watch {
        std::uint64_t last_us = 0;
        bool overdue = false;
    };

    can::Receiver receiver_;
    can::ObjectListReader list_;
    bool list_started_ = false;
    MonitorCounters counters_;
    std::optional<can::Status> status_;
    std::optional<can::Version> version_;
    std::optional<can::CollisionWarning> warning_;
    std::optional<can::EgoMotion> ego_;
    std::map<std::uint16_t, Watch> watches_;
    std::map<can::WarningLevel, std::uint64_t> levels_;
    std::vector<std::string> events_;
    std::uint64_t bits_ = 0;
    std::optional<std::uint64_t> now_us_;
    std::uint64_t elapsed_us_ = 0;
    std::uint16_t faults_seen_ = 0;
    std::uint8_t most_objects_ = 0;
};

/// Names as in the DBC. A value without a name is written as its number.
std::string value_name(std::span<const can::ValueName> names, std::int32_t value);
/// "AdcDead+Blocked", "none".
std::string fault_names(std::uint16_t faults);
/// "ObjectKinematics03", "0x123" if it is none of ours.
std::string message_name(std::uint16_t id);

}  // namespace sim
