// The firmware on an emulated board, fed with a recording: frames.bin (beat frames, see
// hal/host/frame_file_source.hpp) and bus.bin (what the radar received from the bus in each cycle). Writes
// sent.bin (what it sent) and instructions.bin (what each stage took). The CAN frames go through the board's
// real driver. scenario_test.py makes and compares these files.

#include <array>
#include <cstdint>

#include "firmware/radar.hpp"
#include "hal/bare_metal/startup.hpp"
#include "hal/contract/board.hpp"
#include "target_board.hpp"
#include "tests/target/semihosting.hpp"
#include "tests/target/stages.hpp"

namespace {

using semihosting::File;
using target::instructions;
using target::Stage;

/// As in the files: a CAN frame of 12 bytes, little-endian; `count` of them follow a cycle's first word.
struct FrameRecord {
    std::uint16_t id;
    std::uint8_t length;
    std::uint8_t reserved;
    std::array<std::uint8_t, 8> data;
};
static_assert(sizeof(FrameRecord) == 12);

enum ExitCode : std::uint32_t {
    ok = 0,
    no_input = 2,
    short_input = 3,
    cannot_write = 4,
    lost_frames = 5,
    no_tracker = 6
};

/// Time passes only where somebody waits for it, as in the simulator that made the recording.
class WaitingClock final : public hal::Clock {
  public:
    std::uint64_t now_us() override { return now_us_; }
    void wait_until(std::uint64_t time_us) override {
        if (time_us > now_us_) now_us_ = time_us;
    }

  private:
    std::uint64_t now_us_ = 0;
};

/// Of the period everything counts but the copy of the frame, which a DMA does.
class RecordedBeat final : public hal::BeatSource {
  public:
    explicit RecordedBeat(File& file) : file_(file) {}
    hal::BeatResult acquire(dsp::BeatFrame& frame, std::uint32_t& sequence) override {
        const std::uint32_t begin = instructions();
        const bool more = file_.read(&frame, sizeof frame);
        sequence = next_++;
        excluded_ += instructions() - begin;
        return more ? hal::BeatResult::ok : hal::BeatResult::ended;
    }
    [[nodiscard]] std::uint32_t excluded() const { return excluded_; }

  private:
    File& file_;
    std::uint32_t next_ = 0;
    std::uint32_t excluded_ = 0;  ///< instructions spent in the file
};

using Port = target::TestBus::Port<WaitingClock>;

/// The board's port; notes when the cycle's first frame is sent and when its last was.
class MeasuredPort final : public hal::CanPort {
  public:
    explicit MeasuredPort(Port& port) : port_(port) {}
    bool send(const can::Frame& frame) override {
        if (sent_ == 0) first_ = instructions();
        const bool taken = port_.send(frame);
        last_ = instructions();
        ++sent_;
        return taken;
    }
    bool receive(can::Frame& frame) override { return port_.receive(frame); }
    void begin_cycle() override { port_.begin_cycle(); }
    hal::CanState state() override { return port_.state(); }
    hal::CanCounters counters() override { return port_.counters(); }

    std::uint32_t spent_sending() {
        const std::uint32_t spent = sent_ == 0 ? 0 : last_ - first_;
        sent_ = 0;
        return spent;
    }

  private:
    Port& port_;
    std::uint32_t first_ = 0, last_ = 0, sent_ = 0;
};

struct QuietWatchdog final : hal::Watchdog {
    void start() override {}
    void kick() override {}
};
struct QuietConsole final : hal::Console {
    void line(std::string_view) override {}
    int read() override { return -1; }
};

WaitingClock timer;
target::TestBus bus(timer);
Port port(target::TestBus::make_port(bus, timer));
MeasuredPort measured_port(port);
QuietWatchdog watchdog;
QuietConsole console;

File open_or_exit(const char* name, std::uint32_t length, File::Mode mode) {
    File file(name, length, mode);
    if (!file.is_open()) semihosting::exit(mode == File::Mode::read ? no_input : cannot_write);
    return file;
}

File frames = open_or_exit("frames.bin", 10, File::Mode::read);
File received = open_or_exit("bus.bin", 7, File::Mode::read);
RecordedBeat beat(frames);

const hal::Board board{beat, measured_port, timer, watchdog, console};

/// The radar's, but for the data association that tracker.txt names, if there is such a file.
firmware::RadarConfig config_of_run() {
    firmware::RadarConfig config = firmware::radar_config(dsp::kDefaultWaveform);
    File file("tracker.txt", 11, File::Mode::read);
    if (!file.is_open()) return config;
    std::array<char, 16> text{};
    std::size_t length = 0;
    while (length < text.size() && file.read(&text[length], 1)) ++length;
    const auto choice = tracking::associator_chosen({text.data(), length});
    if (!choice) semihosting::exit(no_tracker);
    config.tracker.associator = choice->associator;
    if (choice->level) config.tracker.ijipda.level = *choice->level;
    if (!config.valid()) semihosting::exit(no_tracker);
    return config;
}
firmware::Radar radar(config_of_run(), board);

void feed_bus() {
    std::uint32_t count = 0;
    if (!received.read(&count, sizeof count)) semihosting::exit(short_input);
    for (; count > 0; --count) {
        FrameRecord r;
        if (!received.read(&r, sizeof r)) semihosting::exit(short_input);
        bus.to_radar({r.id, r.length, r.data});
    }
}

void write_sent(File& sent) {
    std::array<FrameRecord, 64> records;
    std::uint32_t count = 0;
    can::Frame f;
    while (count < records.size() && bus.from_radar(f)) records[count++] = {f.id, f.length, 0, f.data};
    if (!sent.write(&count, sizeof count) || !sent.write(records.data(), count * sizeof(FrameRecord))) {
        semihosting::exit(cannot_write);
    }
}

}  // namespace

int main() {
    File sent = open_or_exit("sent.bin", 8, File::Mode::write);
    File counts = open_or_exit("instructions.bin", 16, File::Mode::write);
    bus.start(port);
    target::calibrate_stages();
    radar.start();
    for (std::uint32_t cycle = 0;; ++cycle) {
        feed_bus();
        target::stage_instructions = {};
        const std::uint32_t excluded = beat.excluded();
        const std::uint32_t begin = instructions();
        const bool more = radar.run_cycle();
        const std::uint32_t total =
            instructions() - begin - (beat.excluded() - excluded) - target::take_wrapper_instructions();
        if (!more) break;
        instructions_of(Stage::can) = measured_port.spent_sending();
        std::uint32_t known = 0;
        for (const std::uint32_t n : target::stage_instructions) known += n;
        instructions_of(Stage::rest) = total - known;
        if (!counts.write(target::stage_instructions.data(), sizeof target::stage_instructions)) {
            semihosting::exit(cannot_write);
        }
        write_sent(sent);
    }
    if (port.counters().dropped != 0) semihosting::exit(lost_frames);
    const hal::MemoryUse memory = hal::memory_use();
    if (!counts.write(&memory, sizeof memory)) semihosting::exit(cannot_write);
    semihosting::exit(ok);
}
