// What the signal processing and the CAN encoding cost on this board: see bench.hpp. Exit code 0: measured;
// 1: a frame did not give what it is here for.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "can/transmitter.hpp"
#include "dsp/detect.hpp"
#include "dsp/log2.hpp"
#include "dsp/sine.hpp"
#include "firmware/radar.hpp"
#include "tests/target/bench.hpp"
#include "tests/target/quiet_board.hpp"
#include "tests/target/semihosting.hpp"

namespace {

using target::measure;

constexpr dsp::DspConfig kConfig{};
constexpr dsp::CellScale kScale = dsp::kDefaultWaveform.scale();
constexpr std::uint32_t kRepeats = 64;       ///< of a kernel
constexpr std::uint32_t kFrameRepeats = 16;  ///< of what takes a whole frame

/// Knuth's and Lewis's generator: the same numbers everywhere.
class Random {
  public:
    /// Uniform in 0..65535.
    std::int32_t next() {
        state_ = state_ * 1664525U + 1013904223U;
        return static_cast<std::int32_t>(state_ >> 16);
    }

  private:
    std::uint32_t state_ = 1;
};

/// A point target in the middle of its cells.
struct Tone {
    int range_cell;
    int doppler_cell;
    int amplitude;  ///< converter codes
};

/// Nearly Gaussian noise of 20 codes RMS, four uniform numbers to a sample.
void make_noise(dsp::BeatFrame& frame) {
    Random random;
    for (auto& chirp : frame.chirp) {
        for (auto& sample : chirp) {
            const std::int32_t sum =
                random.next() + random.next() + random.next() + random.next() - 2 * 65535;
            sample = static_cast<std::int16_t>(sum * 20 / 37837);
        }
    }
}

/// Adds tones, each with its own phase, limited to what a converter of 12 bits gives.
template <std::size_t N>
void add(dsp::BeatFrame& frame, const std::array<Tone, N>& tones) {
    for (int k = 0; k < dsp::kChirps; ++k) {
        for (int n = 0; n < dsp::kSamples; ++n) {
            std::int64_t sum = 0;
            for (std::size_t t = 0; t < N; ++t) {
                const int phase = static_cast<int>(t * t * 11);
                const int turn = 16 * (tones[t].range_cell * n + tones[t].doppler_cell * k) + phase;
                sum += std::int64_t{dsp::cosine_q30(turn % 1024, 1024)} * tones[t].amplitude;
            }
            auto& sample = frame.chirp[static_cast<std::size_t>(k)][static_cast<std::size_t>(n)];
            const auto code = static_cast<std::int32_t>(sample + (sum >> 30));
            sample = static_cast<std::int16_t>(std::clamp<std::int32_t>(code, -2047, 2047));
        }
    }
}

constexpr std::array<Tone, 4> kFourTargets{{{6, 58, 300}, {11, 3, 120}, {17, 60, 60}, {25, 0, 30}}};

/// Equal targets as close as they may be without masking each other: as many detections as a frame can hold,
/// and for each all reference cells are counted. In a row, half the cells along Doppler are those beside
/// other targets, just as many as the rank tolerates; the rows are shifted so that range brings no more.
constexpr std::array<Tone, dsp::kMaxDetections> crowded_targets() {
    constexpr std::array<int, 4> kShift{0, 4, 2, 6};
    std::array<Tone, dsp::kMaxDetections> tones{};
    for (std::size_t i = 0; i < tones.size(); ++i) {
        const std::size_t row = i / 8;
        tones[i] = {2 + 4 * static_cast<int>(row), 8 * static_cast<int>(i % 8) + kShift[row % 4], 90};
    }
    return tones;
}

/// The most that OS-CFAR can have to do, as far as we know. No two maxima of the map are neighbours; each is
/// compared with all its reference cells. Four in a row that are every second cell share much of it, so here
/// they are every fourth cell, half of them even and half of them odd, and the rows are shifted by two.
/// Halfway between them every row has a maximum that is as strong as it may be, but not in its column.
void make_worst(dsp::PowerMap& map, std::int32_t threshold) {
    for (std::size_t r = 0; r < dsp::kRangeCells; ++r) {
        for (std::size_t d = 0; d < dsp::kDopplerCells; ++d) {
            const std::size_t place = (d + 2 * (r % 2) + (d < dsp::kDopplerCells / 2 ? 0 : 3)) % 4;
            const bool peak = place == 0 && d < dsp::kDopplerCells - 2;  // whose neighbour cell 0 may be
            map.cell[r][d] = static_cast<std::uint16_t>(
                20'000 + (peak ? threshold + 1 : (place % 2 == 0 ? threshold : 0)));
        }
    }
}

dsp::BeatFrame noise;
dsp::BeatFrame four;
dsp::BeatFrame crowded;
dsp::Workspace workspace;
dsp::DetectionList detections;
dsp::CellMask hits;
std::array<dsp::Spectrum64, kRepeats> spectra;

void fill(std::array<dsp::Spectrum64, kRepeats>& data) {
    Random random;
    constexpr std::int32_t kTop = 1 << dsp::kFftInputBits;
    const auto draw = [&random] { return static_cast<std::int16_t>(random.next() % (2 * kTop) - kTop); };
    for (auto& spectrum : data) {
        for (auto& x : spectrum) x = {draw(), draw()};
    }
}

void measure_transforms() {
    fill(spectra);
    measure("fft64", kRepeats, [](std::uint32_t i) { dsp::fft64(spectra[i]); });

    const dsp::Window& window = dsp::window(kConfig.range_window);
    dsp::DcLevels levels;
    measure("inspect", kFrameRepeats,
            [&](std::uint32_t) { (void)dsp::inspect(four, kConfig.adc_full_scale, levels); });
    measure("range_transform", kFrameRepeats,
            [&](std::uint32_t) { dsp::range_transform(four, levels, window, workspace.spectrum); });
    const dsp::ChirpTaper taper(window, workspace.spectrum.chirp_exponent);
    measure("doppler_transform", dsp::kRangeCells,
            [&](std::uint32_t r) { dsp::doppler_transform(workspace.spectrum, taper, static_cast<int>(r)); });
    measure("log_power", dsp::kRangeCells, [](std::uint32_t r) {
        dsp::log_power(workspace.spectrum.row[r], workspace.spectrum.row_exponent[r], workspace.map.cell[r]);
    });
    measure("noise_level", kFrameRepeats,
            [](std::uint32_t) { (void)dsp::noise_level(workspace.map, kConfig.cfar.first_range_cell); });
}

/// Local maxima and OS-CFAR of the map in the workspace.
void measure_cfar(std::string_view name) {
    const auto level = static_cast<std::uint16_t>(workspace.noise_level - dsp::kLogOne * 5 / 4);
    measure(name, kFrameRepeats,
            [level](std::uint32_t) { dsp::cfar_peaks(workspace.map, workspace.cfar, level, hits); });
}

void measure_frame(const dsp::BeatFrame& frame, std::string_view cfar, std::string_view peaks,
                   std::string_view whole) {
    dsp::DcLevels levels;
    (void)dsp::inspect(frame, kConfig.adc_full_scale, levels);
    measure(whole, kFrameRepeats,
            [&](std::uint32_t) { dsp::detect(frame, levels, kConfig, kScale, workspace, detections); });
    measure_cfar(cfar);
    measure(peaks, kFrameRepeats, [](std::uint32_t) {
        dsp::extract_peaks(workspace.spectrum, workspace.map, hits, workspace.cfar, kConfig.range_window,
                           kConfig.doppler_window, kConfig.peaks, kScale, detections);
    });
}

void expect_detections(int least, int most) {
    target::print_figure("count", "detections", static_cast<std::uint32_t>(detections.count));
    if (detections.count < least || detections.count > most) semihosting::exit(1);
}

void measure_frames() {
    measure_frame(noise, "cfar.noise", "extract_peaks.noise", "detect.noise");
    expect_detections(0, 3);
    measure_frame(four, "cfar.four", "extract_peaks.four", "detect.four");
    expect_detections(4, 6);
    measure_frame(crowded, "cfar.crowded", "extract_peaks.crowded", "detect.crowded");
    expect_detections(dsp::kMaxDetections - 4, dsp::kMaxDetections);
    make_worst(workspace.map, workspace.cfar.threshold());
    workspace.noise_level = dsp::noise_level(workspace.map, kConfig.cfar.first_range_cell);
    measure_cfar("cfar.adversarial");
}

void measure_can() {
    can::Transmitter transmitter;
    measure("can.frame", kRepeats, [&](std::uint32_t i) {
        const can::Object object{.index = static_cast<std::uint8_t>(i / 2 % 16),
                                 .cycle = 1,
                                 .track_id = 7,
                                 .range_mm = 50'000,
                                 .range_rate_mmps = -12'345,
                                 .motion = can::Motion::moving,
                                 .coasting = false,
                                 .range_sigma_mm = 120,
                                 .range_rate_sigma_mmps = 60,
                                 .existence_percent = 99,
                                 .snr_cdb = 2'500,
                                 .age_cycles = 300};
        (void)(i % 2 == 0 ? transmitter.kinematics(object) : transmitter.quality(object));
    });
}

/// The crowded frame in every period, its first sample now and then another: a converter that repeats itself
/// is a fault.
class CrowdedBeat final : public hal::BeatSource {
  public:
    hal::BeatResult acquire(dsp::BeatFrame& frame, std::uint32_t& sequence) override {
        const std::uint32_t begin = target::instructions();
        frame = crowded;
        frame.chirp[0][0] = static_cast<std::int16_t>(next_ % 2);
        sequence = next_++;
        copying_ = target::instructions() - begin;
        return hal::BeatResult::ok;
    }
    /// Instructions of the last copy, which a DMA does on a board.
    [[nodiscard]] std::uint32_t copying() const { return copying_; }

  private:
    std::uint32_t next_ = 0;
    std::uint32_t copying_ = 0;
};

struct StoppedClock final : hal::Clock {
    std::uint64_t now_us() override { return now; }
    void wait_until(std::uint64_t time_us) override { now = time_us; }
    std::uint64_t now = 0;
};

CrowdedBeat beat;
target::QuietCan port;
StoppedClock timer;
target::QuietWatchdog watchdog;
firmware::Radar radar(firmware::radar_config(dsp::kDefaultWaveform),
                      {beat, port, timer, watchdog, target::uart_console});

/// The firmware's loop with as many detections as it can have, worst cycle; all but the CAN driver. The
/// targets stay where they are whatever their Doppler shift says: tracks start and end all the time.
void measure_loop() {
    constexpr int kCycles = 40;
    std::uint32_t worst = 0;
    radar.start();
    for (int i = 0; i < kCycles; ++i) {
        const std::uint32_t begin = target::instructions();
        radar.run_cycle();
        worst = std::max(worst, target::instructions() - begin - beat.copying());
    }
    target::print_figure("bench", "loop.crowded", worst);
}

/// The parts of the one large object.
void print_sizes() {
    const auto bytes = [](std::string_view name, std::size_t size) {
        target::print_figure("bytes", name, static_cast<std::uint32_t>(size));
    };
    bytes("beat frame", sizeof(dsp::BeatFrame));
    bytes("signal processing", sizeof(dsp::Workspace) + sizeof(dsp::DetectionList));
    bytes("tracker", sizeof(tracking::Tracker<dsp::Real>));
    bytes("radar, all of it", sizeof(firmware::Radar));
}

}  // namespace

int main() {
    target::start_bench();
    make_noise(noise);
    make_noise(four);
    add(four, kFourTargets);
    make_noise(crowded);
    add(crowded, crowded_targets());
    measure_transforms();
    measure_frames();
    measure_can();
    measure_loop();
    print_sizes();
    semihosting::exit(0);
}
