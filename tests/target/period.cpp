// An hour of the firmware's loop on the board's own clock, measured with another timer of the board. Exit
// code 0: 36,000 cycles took an hour, none began late.
#include <cstdint>

#include "firmware/radar.hpp"
#include "firmware/text_line.hpp"
#include "independent_timer.hpp"
#include "tests/target/quiet_board.hpp"
#include "tests/target/semihosting.hpp"

namespace {

/// Nothing comes: the shortest cycle there is. Looks at the other timer, which turns over more often than
/// once an hour.
class NoBeat final : public hal::BeatSource {
  public:
    hal::BeatResult acquire(dsp::BeatFrame&, std::uint32_t&) override {
        const std::uint32_t passed_ns = target::independent_ns();
        if (started) elapsed_ns += passed_ns;
        started = true;
        return hal::BeatResult::missing;
    }
    std::uint64_t elapsed_ns = 0;  ///< since the first cycle
    bool started = false;
};

NoBeat beat;
target::QuietCan port;
target::QuietWatchdog watchdog;
const hal::Board board{beat, port, target::timer, watchdog, target::console};
firmware::Radar radar(firmware::radar_config(dsp::kDefaultWaveform), board);

constexpr std::uint32_t kCycles = 36'000;
constexpr std::uint64_t kLastBegins_us = (kCycles - 1) * std::uint64_t{100'000};
constexpr std::uint64_t kMost_us = 20'000;  ///< 6 ppm: the emulator's TTC rounds at each look

}  // namespace

int main() {
    target::start();
    radar.start();
    for (std::uint32_t i = 0; i < kCycles; ++i) radar.run_cycle();
    const std::uint64_t elapsed_us = beat.elapsed_ns / 1000;
    const std::uint64_t off_us =
        elapsed_us > kLastBegins_us ? elapsed_us - kLastBegins_us : kLastBegins_us - elapsed_us;
    firmware::TextLine line;
    line.text("cycles ")
        .number(radar.counters().cycles)
        .text(", overruns ")
        .number(radar.counters().overruns);
    line.text(", the last began ").number(elapsed_us);
    line.text(" us after the first by another timer, ").number(off_us).text(" us off");
    target::console.line(line.view());
    semihosting::exit(
        radar.counters().cycles == kCycles && radar.counters().overruns == 0 && off_us <= kMost_us ? 0 : 1);
}
