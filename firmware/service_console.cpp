#include "firmware/service_console.hpp"

#include <array>

#include "can/messages.hpp"
#include "firmware/text_line.hpp"
#include "firmware/version.hpp"

namespace firmware {
namespace {

constexpr std::array<std::string_view, 4> kModes{"starting", "operating", "degraded", "failed"};
constexpr std::array<std::string_view, 4> kCanStates{"active", "passive", "bus off", "down"};
constexpr std::array<std::string_view, 4> kWarnings{"none", "inform", "warn", "brake"};
/// By bit of can::Fault.
constexpr std::array<std::string_view, 12> kFaults{
    "adc dead",     "adc stuck", "adc saturated", "frame missing", "frame invalid", "blocked",
    "interference", "capacity",  "ego stale",     "can error",     "overrun",       "internal"};
static_assert(static_cast<int>(can::Fault::internal) == 1 << (kFaults.size() - 1));

template <std::size_t N, class Enum>
std::string_view name(const std::array<std::string_view, N>& names, Enum value) {
    const auto i = static_cast<std::size_t>(value);
    return i < N ? names[i] : "unknown";
}

}  // namespace

void ServiceConsole::banner(const BoardFacts& facts) {
    TextLine line;
    line.text("fmcw radar ")
        .number(kVersionMajor)
        .text(".")
        .number(kVersionMinor)
        .text(".")
        .number(kVersionPatch);
    line.text(" on ").text(facts.name);
    board_.console.line(line.view());

    const dsp::Waveform& w = radar_.config().waveform;
    line = {};
    line.text("waveform: carrier ").number(w.carrier_hz / 1'000'000).text(" MHz, sweep ");
    line.number(w.bandwidth_hz / 1000).text(" kHz, ").number(dsp::kChirps).text(" chirps of ");
    line.number(w.chirp_interval_ns).text(" ns, ").number(dsp::kSamples).text(" samples each, period ");
    line.number(w.period_ms).text(" ms");
    board_.console.line(line.view());

    line = {};
    line.text("cell: range ").number(w.range_cell_um() / 1000).text(" mm, range rate ");
    line.number(w.rate_cell_umps() / 1000).text(" mm/s");
    board_.console.line(line.view());

    line = {};
    line.text("memory: rom ").number(facts.rom_bytes).text(", static ram ").number(facts.static_ram_bytes);
    line.text(", stack reserved ").number(facts.stack_bytes).text(" bytes");
    board_.console.line(line.view());

    line = {};
    line.text("last run ended by: ").text(facts.last_run_ended_by);
    if (facts.fault_pc != 0) {
        line.text(", pc ").hex(facts.fault_pc).text(", status ").hex(facts.fault_status).text(", address ");
        line.hex(facts.fault_address);
    }
    board_.console.line(line.view());
    board_.console.line("h for help");
}

void ServiceConsole::poll(std::uint32_t stack_used_bytes) {
    switch (board_.console.read()) {
        case -1:
        case '\r':
        case '\n':
            break;
        case 's':
            status(stack_used_bytes);
            break;
        case 't':
            tracks();
            break;
        case 'c':
            counters();
            break;
        default:
            help();
    }
    if (++since_status_ < kCyclesPerStatus) return;
    since_status_ = 0;
    status(stack_used_bytes);
}

void ServiceConsole::status(std::uint32_t stack_used_bytes) {
    TextLine line;
    line.text("t ")
        .number(board_.clock.now_us() / 1000)
        .text(" ms ")
        .text(name(kModes, radar_.health().mode()));
    for (std::size_t bit = 0, shown = 0; bit < kFaults.size(); ++bit) {
        if ((radar_.health().faults() >> bit & 1) == 0) continue;
        line.text(shown++ == 0 ? ": " : " + ").text(kFaults[bit]);
    }
    line.text(", detections ").number(static_cast<std::uint32_t>(radar_.detections().count));
    line.text(", tracks ").number(radar_.tracks().size());
    line.text(", warning ").text(name(kWarnings, radar_.warning().level));
    line.text(", can ").text(name(kCanStates, board_.can.state()));
    line.text(", stack ").number(stack_used_bytes);
    board_.console.line(line.view());
}

void ServiceConsole::tracks() {
    for (const tracking::Track<Real>& t : radar_.tracks()) {
        if (!t.is_confirmed()) continue;
        const std::int32_t rate_mmps = t.x[1].in_units(1000);
        TextLine line;
        line.text("track ")
            .number(t.id)
            .text(": range ")
            .number(static_cast<std::uint32_t>(t.x[0].in_units(1000)));
        line.text(" mm, rate ").text(rate_mmps < 0 ? "-" : "");
        line.number(static_cast<std::uint32_t>(rate_mmps < 0 ? -rate_mmps : rate_mmps)).text(" mm/s, age ");
        line.number(t.age);
        board_.console.line(line.view());
    }
}

void ServiceConsole::counters() {
    const RadarCounters& r = radar_.counters();
    TextLine line;
    line.text("cycles ").number(r.cycles).text(", overruns ").number(r.overruns);
    line.text(", frames lost ").number(r.frames_lost).text(" missing ").number(r.frames_missing);
    line.text(" invalid ").number(r.frames_invalid);
    board_.console.line(line.view());

    line = {};
    line.text("dropped: detections ").number(r.detections_dropped).text(", tracks ").number(r.tracks_dropped);
    line.text("; commands refused ").number(r.commands_refused);
    board_.console.line(line.view());

    const hal::CanCounters c = board_.can.counters();
    line = {};
    line.text("can: sent ")
        .number(c.sent)
        .text(", dropped ")
        .number(c.dropped)
        .text(", received ")
        .number(c.received);
    line.text(", overflow ").number(c.receive_overflow).text(", rejected ").number(c.rejected);
    line.text(", bus off ").number(c.bus_off);
    board_.console.line(line.view());
}

void ServiceConsole::help() {
    board_.console.line("s status, t tracks, c counters, h help");
}

}  // namespace firmware
