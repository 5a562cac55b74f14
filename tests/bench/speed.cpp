#include "tests/bench/speed.hpp"

#include <algorithm>
#include <array>
#include <benchmark/benchmark.h>
#include <cmath>
#include <complex>
#include <cstdio>
#include <fftw3.h>
#include <functional>
#include <kiss_fft.h>
#include <map>
#include <memory>
#include <numbers>
#include <random>
#include <stdexcept>
#include <unsupported/Eigen/FFT>

#include "dsp/detect.hpp"
#include "firmware/radar.hpp"
#include "hal/host/counting_watchdog.hpp"
#include "hal/host/loopback_bus.hpp"
#include "hal/host/virtual_clock.hpp"
#include "host_sim/beat_synthesis.hpp"
#include "host_sim/world.hpp"
#include "tests/bench/dsp_reference.hpp"
#include "tests/bench/os_cfar_by_selection.hpp"
#include "tests/bench/peer_kissfft16.hpp"
#include "tests/tracking/joint_events.hpp"
#include "tracking/jpda.hpp"

namespace bench {

namespace {

using ComplexFloat = std::complex<float>;
using benchmark::DoNotOptimize;

constexpr const char* kFft = "64-point complex FFT";
constexpr const char* kMap = "range-Doppler map of a frame";
constexpr const char* kCfar = "OS-CFAR of a map";
constexpr const char* kJpda = "JPDA, 8 tracks x 12 measurements";
constexpr const char* kLoop = "firmware loop alone";

struct Task {
    std::string task;
    std::string by;
    std::function<void()> run;
    bool once = false;  ///< too long to repeat
};
using Tasks = std::vector<Task>;

void require(bool same, const std::string& who) {
    if (!same) throw std::runtime_error(who + " does not compute the same: the comparison means nothing");
}

// --- 64-point FFT ---

/// What all FFTs get: int16 noise at half of full scale, and its transform.
struct FftCase {
    dsp::Spectrum64 input{};
    dsp::Spectrum64 scaled{};  ///< for ours: in the firmware the window before it scales
    std::array<ComplexFloat, 64> samples{};
    std::array<Complex, 64> expected{};

    FftCase() {
        Random random(1);
        std::array<Complex, 64> exact;
        for (std::size_t n = 0; n < 64; ++n) {
            input[n] = {static_cast<std::int16_t>(static_cast<int>(random() % 32768) - 16384),
                        static_cast<std::int16_t>(static_cast<int>(random() % 32768) - 16384)};
            exact[n] = {static_cast<double>(input[n].re), static_cast<double>(input[n].im)};
            samples[n] = ComplexFloat(exact[n]);
        }
        expected = dft64(exact);
    }
    /// `scale`: true value of one unit of `x`.
    template <class X>
    [[nodiscard]] bool agrees(const X& x, double scale, double relative) const {
        double error = 0;
        double power = 0;
        for (std::size_t k = 0; k < 64; ++k) {
            const Complex got(static_cast<double>(x[k].real()) * scale,
                              static_cast<double>(x[k].imag()) * scale);
            error += std::norm(got - expected[k]);
            power += std::norm(expected[k]);
        }
        return error < relative * relative * power;
    }
};

template <class Complex16>
std::array<std::complex<int>, 64> widened(const Complex16& data) {
    std::array<std::complex<int>, 64> wide;
    for (std::size_t k = 0; k < 64; ++k) wide[k] = {data[k].re, data[k].im};
    return wide;
}

void add_fft(Tasks& tasks) {
    const auto data = std::make_shared<FftCase>();
    {
        dsp::Spectrum64 z = data->input;
        const int exponent = scale_for_fft(z) + dsp::kFftExponent;
        data->scaled = z;
        dsp::fft64(z);
        require(data->agrees(widened(z), std::ldexp(1.0, exponent), 1e-3), "our FFT");
    }
    tasks.push_back({kFft, "ours, int16", [data] {
                         dsp::Spectrum64 z = data->scaled;
                         dsp::fft64(z);
                         DoNotOptimize(z);
                     }});

#ifdef RADAR_HAS_KISSFFT16
    const auto run_kiss16 = [data, out16 = std::make_shared<dsp::Spectrum64>()] {
        kissfft16(data->input, *out16);
        DoNotOptimize(*out16);
        return out16;
    };
    require(data->agrees(widened(*run_kiss16()), 64, 2e-2), "KissFFT of 16 bit");
    tasks.push_back({kFft, "KissFFT, int16", run_kiss16});
#endif

    auto out = std::make_shared<std::array<ComplexFloat, 64>>();
    const std::shared_ptr<kiss_fft_state> kiss(kiss_fft_alloc(64, 0, nullptr, nullptr), kiss_fft_free);
    const auto run_kiss = [data, out, kiss] {
        kiss_fft(kiss.get(), reinterpret_cast<const kiss_fft_cpx*>(data->samples.data()),
                 reinterpret_cast<kiss_fft_cpx*>(out->data()));
        DoNotOptimize(*out);
    };
    run_kiss();
    require(data->agrees(*out, 1, 1e-5), "KissFFT");
    tasks.push_back({kFft, "KissFFT, float", run_kiss});

    const std::shared_ptr<std::remove_pointer_t<fftwf_plan>> plan(
        fftwf_plan_dft_1d(64, reinterpret_cast<fftwf_complex*>(data->samples.data()),
                          reinterpret_cast<fftwf_complex*>(out->data()), FFTW_FORWARD,
                          FFTW_PATIENT | FFTW_PRESERVE_INPUT),
        fftwf_destroy_plan);
    *data = FftCase();  // planning writes over it
    const auto run_fftw = [out, plan, data] {
        fftwf_execute(plan.get());
        DoNotOptimize(*out);
    };
    run_fftw();
    require(data->agrees(*out, 1, 1e-5), "FFTW");
    tasks.push_back({kFft, "FFTW, float", run_fftw});

    auto eigen = std::make_shared<Eigen::FFT<float>>();
    const auto run_eigen = [data, out, eigen] {
        eigen->fwd(out->data(), data->samples.data(), 64);
        DoNotOptimize(*out);
    };
    run_eigen();
    require(data->agrees(*out, 1, 1e-5), "Eigen's FFT");
    tasks.push_back({kFft, "Eigen, float", run_eigen});
}

// --- Range-Doppler map ---

dsp::BeatFrame four_targets() {
    Samples samples(4096, 0.0);
    Random random(1);
    for (const Tone& tone :
         {Tone{30, -20, 300, 0}, Tone{55, 3, 120, 1}, Tone{85, -4, 60, 2}, Tone{120, 0, 30, 3}})
        add_tone(samples, tone);
    add_noise(samples, 5, random);
    return convert(samples, 2047);
}

/// The same map in single precision: mean of each chirp removed, windows, real transforms, corner turn,
/// transforms along the chirps, log2 of the power.
class FloatMap {
  public:
    FloatMap() {
        const int length = 64;
        range_ = fftwf_plan_many_dft_r2c(1, &length, 64, time_.data(), nullptr, 1, 64, spectra(), nullptr, 1,
                                         33, FFTW_PATIENT);
        doppler_ = fftwf_plan_many_dft(1, &length, 32, turned(), nullptr, 1, 64, turned(), nullptr, 1, 64,
                                       FFTW_FORWARD, FFTW_PATIENT);
        for (std::size_t n = 0; n < 64; ++n)
            window_[n] = static_cast<float>(dsp::window(dsp::WindowKind::hann)[n]) / 32768.0F;
    }
    FloatMap(const FloatMap&) = delete;
    FloatMap& operator=(const FloatMap&) = delete;
    ~FloatMap() {
        fftwf_destroy_plan(range_);
        fftwf_destroy_plan(doppler_);
    }

    void run(const dsp::BeatFrame& frame) {
        for (std::size_t k = 0; k < 64; ++k) {
            float sum = 0;
            for (const std::int16_t x : frame.chirp[k]) sum += static_cast<float>(x);
            for (std::size_t n = 0; n < 64; ++n)
                time_[64 * k + n] = (static_cast<float>(frame.chirp[k][n]) - sum / 64) * window_[n];
        }
        fftwf_execute(range_);
        for (std::size_t r = 0; r < 32; ++r) {
            for (std::size_t k = 0; k < 64; ++k) turned_[64 * r + k] = spectra_[33 * k + r] * window_[k];
        }
        fftwf_execute(doppler_);
        for (std::size_t i = 0; i < power.size(); ++i) power[i] = std::log2(std::norm(turned_[i]));
    }
    std::array<float, 2048> power{};

  private:
    fftwf_complex* spectra() { return reinterpret_cast<fftwf_complex*>(spectra_.data()); }
    fftwf_complex* turned() { return reinterpret_cast<fftwf_complex*>(turned_.data()); }

    alignas(64) std::array<float, 4096> time_{};
    alignas(64) std::array<ComplexFloat, 33 * 64> spectra_{};
    alignas(64) std::array<ComplexFloat, 2048> turned_{};
    std::array<float, 64> window_{};
    fftwf_plan range_ = nullptr;
    fftwf_plan doppler_ = nullptr;
};

struct MapCase {
    dsp::BeatFrame frame = four_targets();
    dsp::Workspace workspace{};
    FloatMap reference;
};

void add_map(Tasks& tasks) {
    const auto data = std::make_shared<MapCase>();
    const auto ours = [data] {
        dsp::range_doppler(data->frame, dsp::WindowKind::hann, dsp::WindowKind::hann,
                           data->workspace.spectrum, data->workspace.map);
        DoNotOptimize(data->workspace.map);
    };
    const auto theirs = [data] {
        data->reference.run(data->frame);
        DoNotOptimize(data->reference.power);
    };
    ours();
    theirs();
    double sum = 0;
    for (std::size_t i = 2 * 64; i < 2048; ++i) {
        sum += std::abs(data->workspace.map.cell[i / 64][i % 64] / 1024.0 -
                        static_cast<double>(data->reference.power[i]));
    }
    // Octaves of power, most of the cells noise: 16 bits keep it within a third of a decibel, on average.
    require(sum / 1920 < 0.1, "the map by FFTW");
    tasks.push_back({kMap, "ours, int16", ours});
    tasks.push_back({kMap, "FFTW, float", theirs});
}

// --- OS-CFAR ---

struct CfarCase {
    dsp::PowerMap map{};
    dsp::OsCfar cfar{dsp::CfarConfig{}};
    std::uint16_t level = 0;
    dsp::CellMask ours;
    dsp::CellMask theirs;
};

void add_cfar(Tasks& tasks) {
    const auto data = std::make_shared<CfarCase>();
    {
        MapCase map;
        dsp::range_doppler(map.frame, dsp::WindowKind::hann, dsp::WindowKind::hann, map.workspace.spectrum,
                           map.workspace.map);
        data->map = map.workspace.map;
        data->level = dsp::noise_level(data->map, data->cfar.config().first_range_cell);
    }
    const auto ours = [data] {
        dsp::cfar_peaks(data->map, data->cfar, data->level, data->ours);
        DoNotOptimize(data->ours);
    };
    const auto sorting = [data] {
        os_cfar_by_selection(data->map, data->cfar, data->theirs,
                             [](auto first, auto, auto last) { std::sort(first, last); });
        DoNotOptimize(data->theirs);
    };
    const auto selecting = [data] {
        os_cfar_by_selection(data->map, data->cfar, data->theirs,
                             [](auto first, auto kth, auto last) { std::nth_element(first, kth, last); });
        DoNotOptimize(data->theirs);
    };
    const auto same = [&] {
        for (std::size_t r = 0; r < dsp::kRangeCells; ++r)
            if ((data->theirs.row[r] & data->ours.row[r]) != data->ours.row[r]) return false;
        return true;
    };
    ours();
    sorting();
    require(same(), "OS-CFAR by sorting");
    selecting();
    require(same(), "OS-CFAR by selection");
    tasks.push_back({kCfar, "ours, local maxima included", ours});
    tasks.push_back({kCfar, "sorting, every cell", sorting});
    tasks.push_back({kCfar, "std::nth_element, every cell", selecting});
}

// --- JPDA ---

struct JpdaCase {
    joint_events::Rows rows;
    std::vector<tracking::AssociationRow<dsp::Real>> fixed;
    tracking::JpdaWorkspace<double> work;
    tracking::JpdaWorkspace<dsp::Real> fixed_work;
};

void add_jpda(Tasks& tasks) {
    const auto data = std::make_shared<JpdaCase>();
    std::mt19937 random(1);
    data->rows = joint_events::random_rows(random, {8, 12, 1.0, 8.0, -2.3});
    data->fixed = joint_events::to_fixed(data->rows);
    // Tasks run in any order: what the listing is compared with is there from the start.
    tracking::jpda<double>(data->rows, data->work);
    tasks.push_back({kJpda, "ours, double", [data] {
                         tracking::jpda<double>(data->rows, data->work);
                         DoNotOptimize(data->rows);
                     }});
    tasks.push_back({kJpda, "ours, fixed point", [data] {
                         tracking::jpda<dsp::Real>(data->fixed, data->fixed_work);
                         DoNotOptimize(data->fixed);
                     }});
    tasks.push_back({kJpda, "listing all events, double",
                     [data] {
                         const joint_events::EventList events(data->rows);
                         require(joint_events::largest_error(data->rows, events) < 1e-8, "listing events");
                     },
                     true});
}

// --- The firmware ---

/// Frames in memory, again and again; the copy is what a DMA would do, and is measured too.
class FramesInMemory final : public hal::BeatSource {
  public:
    explicit FramesInMemory(const std::string& scenario) {
        const sim::Scenario s = sim::load_scenario(scenario);
        const sim::World world(s, 1);
        const sim::BeatSynthesis synthesis(s.waveform, s.front_end, 1);
        frames_.resize(std::min<std::size_t>(world.frames(), 200));
        for (std::size_t i = 0; i < frames_.size(); ++i)
            synthesis.synthesise(world.echoes(i), world.bursts(i), i, frames_[i]);
    }
    hal::BeatResult acquire(dsp::BeatFrame& frame, std::uint32_t& sequence) override {
        frame = frames_[next_ % frames_.size()];
        sequence = next_++;
        return hal::BeatResult::ok;
    }

  private:
    std::vector<dsp::BeatFrame> frames_;
    std::uint32_t next_ = 0;
};

struct QuietConsole final : hal::Console {
    void line(std::string_view) override {}
    int read() override { return -1; }
};

struct LoopCase {
    explicit LoopCase(const std::string& scenario) : beat(scenario) { radar.start(); }

    FramesInMemory beat;
    hal::VirtualClock clock;
    hal::LoopbackBus bus;
    hal::CountingWatchdog watchdog;
    QuietConsole console;
    firmware::Radar radar{firmware::radar_config(dsp::kDefaultWaveform),
                          {beat, bus.add_port(), clock, watchdog, console}};
};

void add_loop(Tasks& tasks) {
    for (const char* scenario : {"four-targets", "highway", "over-capacity"}) {
        const auto data = std::make_shared<LoopCase>(scenario);
        tasks.push_back({std::string(kLoop) + ", " + scenario, "ours", [data] { data->radar.run_cycle(); }});
    }
}

// --- Measuring ---

/// Times of all runs by name; prints nothing.
class Collector final : public benchmark::BenchmarkReporter {
  public:
    bool ReportContext(const Context&) override { return true; }
    void ReportRuns(const std::vector<Run>& runs) override {
        for (const Run& run : runs) {
            if (run.run_type == Run::RT_Iteration)
                times_[run.run_name.function_name].push_back(run.GetAdjustedCPUTime());
        }
    }
    [[nodiscard]] double median_ns(const std::string& name) {
        std::vector<double>& times = times_.at(name);
        const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
        std::ranges::nth_element(times, middle);
        return *middle;
    }

  private:
    std::map<std::string, std::vector<double>> times_;
};

std::string name_of(const Task& task) {
    return task.task + ": " + task.by;
}

}  // namespace

std::vector<Timing> compare_speed(bool quick, const std::string& only) {
    Tasks tasks;
    const std::initializer_list<std::pair<std::string, void (*)(Tasks&)>> all{
        {kFft, add_fft}, {kMap, add_map}, {kCfar, add_cfar}, {kJpda, add_jpda}, {kLoop, add_loop}};
    for (const auto& [name, add] : all) {
        if (name.starts_with(only)) add(tasks);
    }
    std::vector<std::string> options{"radar_bench", "--benchmark_enable_random_interleaving=true",
                                     std::string("--benchmark_min_time=") + (quick ? "0.03" : "0.2")};
    std::vector<char*> arguments;
    for (std::string& option : options) arguments.push_back(option.data());
    auto count = static_cast<int>(arguments.size());
    benchmark::Initialize(&count, arguments.data());
    for (const Task& task : tasks) {
        auto* registered =
            benchmark::RegisterBenchmark(name_of(task).c_str(), [run = task.run](benchmark::State& state) {
                for ([[maybe_unused]] auto _ : state) run();
            });
        registered->Unit(benchmark::kNanosecond)->Repetitions(task.once ? 1 : 7);
        if (task.once) registered->Iterations(1);
    }
    Collector collector;
    benchmark::RunSpecifiedBenchmarks(&collector);
    benchmark::ClearRegisteredBenchmarks();

    std::vector<Timing> timings;
    double ours = 0;
    for (const Task& task : tasks) {
        const double time = collector.median_ns(name_of(task));
        if (timings.empty() || timings.back().task != task.task) ours = time;
        timings.push_back({task.task, task.by, time, time / ours});
    }
    return timings;
}

bool print(const std::vector<Timing>& timings) {
    bool met = true;
    std::string task;
    for (const Timing& timing : timings) {
        if (timing.task != task) std::printf("%s\n", timing.task.c_str());
        task = timing.task;
        std::printf("  %-36s %14.1f ns %10.2f x", timing.by.c_str(), timing.nanoseconds, timing.of_ours);
        if (timing.task.starts_with(kLoop)) {
            const double frames = 1e9 / timing.nanoseconds;
            const bool enough = frames >= kLeastFramesPerSecond;
            std::printf("   %.0f frames a second >= %.0f %s", frames, kLeastFramesPerSecond,
                        enough ? "met" : "MISSED");
            met = met && enough;
        }
        std::printf("\n");
    }
    return met;
}

}  // namespace bench
