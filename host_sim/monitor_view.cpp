#include "host_sim/monitor_view.hpp"

#include <cstdarg>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vector>

#include "host_sim/bus_load.hpp"

namespace sim {
namespace {

[[gnu::format(printf, 1, 2)]] std::string format(const char* pattern, ...) {
    std::va_list arguments;
    va_start(arguments, pattern);
    std::va_list again;
    va_copy(again, arguments);
    const int size = std::vsnprintf(nullptr, 0, pattern, arguments);
    va_end(arguments);
    std::string text(static_cast<std::size_t>(std::max(size, 0)), '\0');
    std::vsnprintf(text.data(), text.size() + 1, pattern, again);
    va_end(again);
    return text;
}

/// Thousandths of a unit.
double milli(std::int64_t value) {
    return static_cast<double>(value) * 1e-3;
}

std::string health_text(const BusMonitor& monitor) {
    if (!monitor.status()) return "no status";
    const bool stale = monitor.status_of(can::status::kMessage.id) == can::E2eStatus::no_new_data;
    return value_name(can::status::kModes, static_cast<int>(monitor.status()->mode)) +
           (stale ? " (no longer told)" : "") + ", faults " + fault_names(monitor.status()->faults);
}

std::string warning_text(const BusMonitor& monitor) {
    const auto& warning = monitor.warning();
    if (!warning) return "not told";
    if (!warning->valid) return "no statement possible";
    std::string text = value_name(can::warning::kLevels, static_cast<int>(warning->level));
    if (warning->track_id != 0) text += format(", track %d", warning->track_id);
    if (warning->time_to_collision_ms)
        text += format(", collision in %.2f s", milli(*warning->time_to_collision_ms));
    if (warning->required_deceleration_mmps2 != 0)
        text += format(", needs %.2f m/s^2", milli(warning->required_deceleration_mmps2));
    return text;
}

std::string motion_text(const can::Object& object) {
    return value_name(can::kinematics::kMotions, static_cast<int>(object.motion)) +
           (object.coasting ? " ~" : "");
}

/// "3 objects"; says so when the list, empty or not, is no statement about the road.
std::string list_text(const BusMonitor& monitor) {
    const can::ObjectListHeader& header = monitor.list().last_header();
    std::string text = format("%d object%s", header.count, header.count == 1 ? "" : "s");
    if (!header.valid) text += ", LIST NOT VALID";
    if (header.overflow) text += ", more than fit";
    return text;
}

struct Count {
    const char* key;
    const char* text;
    std::uint64_t value;
};

std::vector<Count> error_counts(const BusMonitor& monitor) {
    const can::ReceiveCounters& receive = monitor.receive_counters();
    const MonitorCounters& counters = monitor.counters();
    const can::ObjectListCounters& lists = monitor.list().counters();
    return {{"bad_crc", "bad CRC", receive.bad_crc},
            {"repeated", "repeated counter", receive.repeated},
            {"wrong_sequence", "counter out of sequence", receive.wrong_sequence},
            {"lost", "lost (skipped counters)", receive.lost},
            {"wrong_length", "wrong length", receive.wrong_length},
            {"out_of_range", "value out of range", receive.out_of_range},
            {"torn_lists", "torn object lists", lists.torn},
            {"stray_objects", "objects of no list", lists.stray},
            {"overdue", "overdue (no new data)", counters.overdue},
            {"error_frames", "error frames", counters.error_frames},
            {"garbage_lines", "garbage lines", counters.garbage_lines},
            {"time_backwards", "time going back", counters.time_backwards},
            {"lost_here", "not read in time", counters.lost_here}};
}

std::vector<Count> other_counts(const BusMonitor& monitor) {
    const MonitorCounters& counters = monitor.counters();
    return {{"foreign", "foreign identifiers", counters.foreign},
            {"remote", "remote frames (RTR)", counters.remote},
            {"extended", "extended identifiers", counters.extended},
            {"fd", "CAN FD frames", counters.fd},
            {"rejected", "RTR, extended, FD, error", counters.rejected}};
}

}  // namespace

std::string cycle_line(const BusMonitor& monitor) {
    std::string line =
        format("%9.3f s  cycle %3d  %s | warning %s | %s", static_cast<double>(monitor.duration_us()) * 1e-6,
               monitor.list().last_header().cycle, health_text(monitor).c_str(),
               warning_text(monitor).c_str(), list_text(monitor).c_str());
    for (const can::Object& object : monitor.list().objects())
        line += format(" | #%d %.2f m %+.2f m/s %s", object.track_id, milli(object.range_mm),
                       milli(object.range_rate_mmps), motion_text(object).c_str());
    return line;
}

std::string cycle_table(const BusMonitor& monitor) {
    std::string text = format("%.1f s  cycle %d  %s\n", static_cast<double>(monitor.duration_us()) * 1e-6,
                              monitor.list().last_header().cycle, health_text(monitor).c_str());
    text += "warning: " + warning_text(monitor);
    if (monitor.ego() && monitor.ego()->valid)
        text += format("   ego: %.2f m/s", milli(monitor.ego()->speed_mmps));
    text += "\n" + list_text(monitor) + "\n";
    text += "  id    range     rate  motion        sigma range  sigma rate  exists     SNR   age\n";
    for (const can::Object& object : monitor.list().objects()) {
        text +=
            format(" %3d %7.2f m %+7.2f  %-12s %9.2f m  %6.3f m/s  %4d %%  %5.1f dB  %4d\n", object.track_id,
                   milli(object.range_mm), milli(object.range_rate_mmps), motion_text(object).c_str(),
                   milli(object.range_sigma_mm), milli(object.range_rate_sigma_mmps),
                   object.existence_percent, static_cast<double>(object.snr_cdb) * 0.01, object.age_cycles);
    }
    return text + format("lists %u whole, %u torn   errors %llu   bus load %.1f %%\n",
                         monitor.list().counters().complete, monitor.list().counters().torn,
                         static_cast<unsigned long long>(monitor.errors()), 100 * monitor.bus_load());
}

std::string summary_text(const BusMonitor& monitor) {
    const auto row = [](const char* name, std::uint64_t value) {
        return format("  %-26s %10llu\n", name, static_cast<unsigned long long>(value));
    };
    std::string text =
        format("%llu frames in %.1f s, bus load %.1f %% of %d kbit/s\n",
               static_cast<unsigned long long>(monitor.counters().frames),
               static_cast<double>(monitor.duration_us()) * 1e-6, 100 * monitor.bus_load(), kBitrate / 1000);
    text += "radar: ";
    if (monitor.version())
        text += format("firmware %d.%d.%d, protocol %d, ", monitor.version()->major, monitor.version()->minor,
                       monitor.version()->patch, monitor.version()->protocol);
    text += health_text(monitor) + "; faults seen: " + fault_names(monitor.faults_seen()) + "\n";
    text += row("object lists", monitor.lists());
    text += row("most objects in one", monitor.most_objects());
    for (const auto& [level, count] : monitor.warning_levels())
        text +=
            row(("warnings " + value_name(can::warning::kLevels, static_cast<int>(level))).c_str(), count);
    text += format("errors: %llu\n", static_cast<unsigned long long>(monitor.errors()));
    for (const Count& count : error_counts(monitor)) text += row(count.text, count.value);
    text += "not the radar's:\n";
    for (const Count& count : other_counts(monitor)) text += row(count.text, count.value);
    return text;
}

nlohmann::ordered_json summary_json(const BusMonitor& monitor) {
    nlohmann::ordered_json json;
    json["frames"] = monitor.counters().frames;
    json["duration_s"] = static_cast<double>(monitor.duration_us()) * 1e-6;
    json["bus_load"] = monitor.bus_load();
    auto& radar = json["radar"];
    radar["mode"] = nullptr;
    if (monitor.status())
        radar["mode"] = value_name(can::status::kModes, static_cast<int>(monitor.status()->mode));
    radar["firmware"] = nullptr;
    if (monitor.version())
        radar["firmware"] =
            format("%d.%d.%d", monitor.version()->major, monitor.version()->minor, monitor.version()->patch);
    radar["faults_seen"] = fault_names(monitor.faults_seen());
    auto& lists = json["lists"];
    lists["whole"] = monitor.lists();
    lists["most_objects"] = monitor.most_objects();
    auto& warnings = json["warnings"];
    warnings = nlohmann::ordered_json::object();
    for (const auto& [level, count] : monitor.warning_levels())
        warnings[value_name(can::warning::kLevels, static_cast<int>(level))] = count;
    auto& errors = json["errors"];
    errors["total"] = monitor.errors();
    for (const Count& count : error_counts(monitor)) errors[count.key] = count.value;
    auto& other = json["other"];
    for (const Count& count : other_counts(monitor)) other[count.key] = count.value;
    return json;
}

std::string bus_load_text(int objects) {
    std::string text =
        format("CAN at %d kbit/s, %d objects in each list, worst stuffing\n", kBitrate / 1000, objects);
    text += "message             bytes  bits/frame  frames/s    bit/s   load\n";
    double frames = 0;
    double bits = 0;
    for (const MessageLoad& load : message_loads(objects)) {
        text += format("%-19.*s %5d %11d %9.0f %8.0f %5.2f %%\n", static_cast<int>(load.name.size()),
                       load.name.data(), load.data_bytes, worst_wire_bits(load.data_bytes), load.frames_per_s,
                       load.bits_per_s, 100 * load.bits_per_s / kBitrate);
        frames += load.frames_per_s;
        bits += load.bits_per_s;
    }
    return text + format("sum %42.0f %8.0f %5.2f %%   (bar: < 40 %%)\n", frames, bits, 100 * bits / kBitrate);
}

}  // namespace sim
