// What data association costs on a board, in instructions: one line a figure on the console,
// `bench <name> <instructions>`. First the arithmetic is checked: exit code 1 if it gives other bits than the
// PC's. The image has all associators, whatever the firmware was configured with.
//
//   step.4x7.<associator>[.<part>]      4 tracks, 7 detections, every one in every gate and each with its own
//                                       accuracy: predict, gate, associate, update
//   step.4x7-equal.<associator>         the same with one accuracy for all, as Lee and Kim (2000) have it
//   growth.<tracks>x<detections>.<associator>   tracks apart, one detection each, the rest is clutter
//   cluster.<tracks>x<detections>.<associator>  all in one cluster
//   tracker.<mean|worst>.<associator>   the whole step of a tracker with 16 confirmed tracks, as many
//   tentative
//                                       ones as fit, and 64 detections
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "firmware/text_line.hpp"
#include "hal/common/uart_console.hpp"
#include "independent_timer.hpp"
#include "tests/target/patient_uart.hpp"
#include "tests/target/semihosting.hpp"
#include "tracking/tracker.hpp"

namespace {

using dsp::Real;
using namespace tracking;
using Measurements = std::array<Measurement<Real>, kMaxMeasurements>;

constexpr MotionModel<Real> kMotion;
constexpr OrderStatisticsConfig<Real> kOrder = TrackerConfig<Real>{}.order_statistics;
constexpr IjipdaConfig kIterative;
constexpr int kRepetitions = 40;  // the MPS2's timer has a grain of 40 instructions

enum Part : std::size_t { predicting, gating, associating, updating, kParts };
constexpr std::array<std::string_view, kParts> kPartNames{"predict", "gate", "associate", "update"};

struct Scene {
    std::array<Track<Real>, kMaxConfirmed> track{};
    std::size_t tracks = 0;
    Measurements measurement{};
    std::size_t measurements = 0;
};

target::PatientUart patient_uart(target::uart);
hal::UartConsole figures(patient_uart);

// Too large for a stack.
Scene scene;
std::array<Track<Real>, kMaxConfirmed> track;
std::array<AssociationRow<Real>, kMaxConfirmed> row;
AssociatorWorkspace<Real> work;
Tracker<Real> tracker{TrackerConfig<Real>{}};

/// Numerical Recipes' linear congruential generator; the upper bits are good enough to place things.
class Random {
  public:
    /// 0 <= value < below
    int operator()(int below) {
        state_ = state_ * 1'664'525U + 1'013'904'223U;
        return static_cast<int>((std::uint64_t{state_} * static_cast<std::uint32_t>(below)) >> 32);
    }

  private:
    std::uint32_t state_ = 1;
};

Real centi(int hundredths) {
    return Real::ratio(hundredths, 100);
}

/// A detection at an accuracy that goes with its SNR, 24 dB - index / 2.
Measurement<Real> detection(Real range, Real rate, int index) {
    Measurement<Real> m;
    m.z = {range, rate};
    m.variance = {Real::ratio(25 + 3 * index, 1000), Real::ratio(26 + 3 * index, 10'000)};
    m.snr_db = Real(24) - Real::ratio(index, 2);
    return m;
}

void add_track(Real range, Real rate) {
    Track<Real>& t = scene.track[scene.tracks++];
    t = {};
    t.id = static_cast<std::uint8_t>(scene.tracks);
    t.state = TrackState::confirmed;
    t.x = {range, rate};
    t.covariance << Real::ratio(1, 100), Real::ratio(2, 1000), Real::ratio(2, 1000), Real::ratio(3, 1000);
    t.existence = Real::ratio(99, 100);
    t.snr_db = Real(20);
}

/// Tracks and detections so near that everything is in every gate.
void make_cluster(std::size_t tracks, std::size_t detections, bool equal) {
    scene.tracks = scene.measurements = 0;
    for (std::size_t t = 0; t < tracks; ++t)
        add_track(Real(60) + centi(6 * static_cast<int>(t)), Real(-5) + centi(5 * static_cast<int>(t)));
    for (std::size_t j = 0; j < detections; ++j) {
        const int i = static_cast<int>(j);
        scene.measurement[scene.measurements++] =
            detection(centi(5946 + 11 * (5 * i % static_cast<int>(detections)) / 2), centi(-500 + 7 * i / 2),
                      equal ? 0 : i);
    }
}

/// Tracks 9 m and 2.5 m/s apart, a detection near each as far as they go, clutter for the rest.
void make_road(std::size_t tracks, std::size_t detections) {
    Random random;
    scene.tracks = scene.measurements = 0;
    for (std::size_t t = 0; t < tracks; ++t)
        add_track(Real(10 + 9 * static_cast<int>(t)), Real(-20) + Real::ratio(5, 2) * static_cast<int>(t));
    for (std::size_t j = 0; j < detections; ++j) {
        const int i = static_cast<int>(j);
        if (j < tracks) {
            const Vec2<Real>& x = scene.track[j].x;
            scene.measurement[scene.measurements++] = detection(
                x[0] + x[1] * kMotion.period_s + centi(random(20)), x[1] + centi(random(10)), i % 24);
        } else {
            scene.measurement[scene.measurements++] =
                detection(centi(random(16000)), centi(random(6000) - 3000), i % 24);
        }
    }
}

/// Runs a step of the scene; adds what its parts took to `spent`. The start of the steps is always the same.
void run_step(const Gate<Real>& gate, Associator associator, std::array<std::uint32_t, kParts>& spent) {
    const std::span<const Measurement<Real>> measurements(scene.measurement.data(), scene.measurements);
    const std::uint64_t all = ~std::uint64_t{0} >> (64 - scene.measurements);
    track = scene.track;
    std::array<Real, kMaxConfirmed> existence;
    std::array<RankInput<Real>, kMaxConfirmed> rank;
    std::array<Real, kMaxMeasurements> strength;
    for (std::size_t j = 0; j < scene.measurements; ++j) strength[j] = scene.measurement[j].snr_db;
    for (std::size_t t = 0; t < scene.tracks; ++t) existence[t] = track[t].existence;

    target::independent_ns();
    const ProcessNoise<Real> noise = process_noise(kMotion);
    for (std::size_t t = 0; t < scene.tracks; ++t) {
        track[t].x = predict_state(track[t].x, kMotion);
        track[t].covariance = predict_covariance(track[t].covariance, kMotion, noise);
    }
    spent[predicting] += target::independent_ns();
    for (std::size_t t = 0; t < scene.tracks; ++t) {
        gate.fill(row[t], track[t].x, track[t].covariance, measurements, all, false);
        if (uses_rank(associator)) rank[t] = gate.rank_input(row[t], track[t], measurements);
    }
    spent[gating] += target::independent_ns();
    associate<Real>({row.data(), scene.tracks},
                    {{existence.data(), scene.tracks},
                     {strength.data(), scene.measurements},
                     {rank.data(), scene.tracks}},
                    associator, kOrder, kIterative, work);
    spent[associating] += target::independent_ns();
    for (std::size_t t = 0; t < scene.tracks; ++t)
        update_with_row(track[t].x, track[t].covariance, row[t], measurements, gate);
    spent[updating] += target::independent_ns();
}

firmware::TextLine line_of(std::string_view kind, std::size_t tracks, std::size_t detections,
                           std::string_view variant, Associator associator) {
    firmware::TextLine line;
    line.text("bench ").text(kind).text(".").number(tracks).text("x").number(detections).text(variant);
    line.text(".").text(name_of(associator));
    return line;
}

/// Measures the scene, checks how many pairs are gated, and prints.
void measure(std::string_view kind, std::string_view variant, Associator associator, int repetitions,
             bool by_part) {
    const Gate<Real> gate{GateConfig<Real>{}};
    std::array<std::uint32_t, kParts> spent{};
    for (int i = 0; i < repetitions; ++i) run_step(gate, associator, spent);
    std::uint32_t sum = 0;
    for (std::size_t part = 0; part < kParts; ++part) {
        sum += spent[part];
        if (!by_part) continue;
        firmware::TextLine line = line_of(kind, scene.tracks, scene.measurements, variant, associator);
        line.text(".")
            .text(kPartNames[part])
            .text(" ")
            .number(spent[part] / static_cast<std::uint32_t>(repetitions));
        figures.line(line.view());
    }
    firmware::TextLine line = line_of(kind, scene.tracks, scene.measurements, variant, associator);
    line.text(" ").number(sum / static_cast<std::uint32_t>(repetitions));
    figures.line(line.view());
}

void all_must_be_gated() {
    for (std::size_t t = 0; t < scene.tracks; ++t) {
        if (row[t].count != static_cast<int>(scene.measurements)) semihosting::exit(1);
    }
}

/// 16 vehicles that stay, and clutter enough for 64 detections a frame.
void measure_tracker(Associator associator) {
    TrackerConfig<Real> config;
    config.associator = associator;
    tracker.configure(config);
    Random random;
    constexpr std::uint32_t kFrames = 60;
    std::uint32_t worst = 0;
    std::uint32_t sum = 0;
    for (std::uint32_t frame = 0; frame < kFrames; ++frame) {
        for (std::size_t j = 0; j < kMaxMeasurements; ++j) {
            const int i = static_cast<int>(j);
            scene.measurement[j] =
                j < kMaxConfirmed ? detection(Real(10 + 9 * i) + centi(random(20)), centi(random(10)), i % 8)
                                  : detection(centi(random(16000)), centi(random(6000) - 3000), 8 + i % 16);
        }
        target::independent_ns();
        tracker.step(scene.measurement);
        const std::uint32_t spent = target::independent_ns();
        if (frame < kFrames / 3) continue;  // tracks are being confirmed
        sum += spent;
        worst = spent > worst ? spent : worst;
    }
    if (tracker.tracks().size() < kMaxConfirmed) semihosting::exit(2);
    const auto print = [&](std::string_view what, std::uint32_t value) {
        firmware::TextLine line;
        line.text("bench tracker.").text(what).text(".").text(name_of(associator)).text(" ").number(value);
        figures.line(line.view());
    };
    print("mean", sum / (kFrames - kFrames / 3));
    print("worst", worst);
}

/// The instructions of dsp/fixed_point.hpp against plain C++ in 64 bits, on operands of every size and at the
/// ends of the range.
bool arithmetic_agrees() {
    constexpr std::array<std::int32_t, 10> kEdges{
        0, 1, -1, 2, 1 << 21, -(1 << 21), INT32_MAX, INT32_MIN, INT32_MAX - 1, INT32_MIN + 1};
    std::uint32_t state = 1;
    const auto next = [&state] {
        state = state * 1'664'525U + 1'013'904'223U;
        return state;
    };
    const auto operand = [&](std::size_t i) {
        return i < kEdges.size() ? kEdges[i] : static_cast<std::int32_t>(next()) >> (next() >> 27);
    };
    for (std::size_t i = 0; i < 64; ++i) {
        for (std::size_t j = 0; j < 64; ++j) {
            // Volatile: the compiler must not know the values and do the sums itself.
            volatile std::int32_t left = operand(i);
            volatile std::int32_t right = operand(j);
            const std::int32_t a = left;
            const std::int32_t b = right;
            const auto unsigned_a = static_cast<std::uint32_t>(a);
            const auto unsigned_b = static_cast<std::uint32_t>(b);
            const std::int64_t wide_a = a;
            const std::int64_t wide_b = b;
            const std::int64_t sum = static_cast<std::int64_t>(std::uint64_t{next()} << 32 | next());
            const auto accumulated = static_cast<std::int64_t>(static_cast<std::uint64_t>(sum) +
                                                               static_cast<std::uint64_t>(wide_a * wide_b));
            const std::int64_t product = wide_a * wide_b;
            if (dsp::product(a, b) != product || dsp::accumulated(sum, a, b) != accumulated ||
                dsp::saturated_sum(a, b) != dsp::saturate32(wide_a + wide_b) ||
                dsp::saturated_difference(a, b) != dsp::saturate32(wide_a - wide_b) ||
                dsp::narrowed<22>(product) != dsp::saturate32(dsp::round_shift(product, 22)) ||
                dsp::narrowed<30>(product) != dsp::saturate32(dsp::round_shift(product, 30)) ||
                dsp::rounded<22>(product) != static_cast<std::int32_t>(dsp::round_shift(product, 22)) ||
                dsp::detail::high_product(a, b) != static_cast<std::int32_t>(product >> 32) ||
                dsp::detail::high_product(unsigned_a, unsigned_b) !=
                    static_cast<std::uint32_t>(std::uint64_t{unsigned_a} * unsigned_b >> 32))
                return false;
        }
    }
    return true;
}

}  // namespace

int main() {
    target::start();
    if (!arithmetic_agrees()) semihosting::exit(1);
    for (std::size_t a = 0; a < static_cast<std::size_t>(Associator::imm_pdaf); ++a) {
        const auto associator = static_cast<Associator>(a);
        make_cluster(4, 7, false);
        measure("step", "", associator, kRepetitions, true);
        all_must_be_gated();
        make_cluster(4, 7, true);
        measure("step", "-equal", associator, kRepetitions, false);
        all_must_be_gated();
    }
    for (std::size_t a = 0; a <= static_cast<std::size_t>(Associator::osjpda); ++a) {
        const auto associator = static_cast<Associator>(a);
        for (const std::size_t tracks : {1U, 2U, 4U, 8U, 16U}) {
            for (const std::size_t detections : {4U, 8U, 16U, 32U, 64U}) {
                make_road(tracks, detections);
                measure("growth", "", associator, 8, false);
            }
        }
    }
    for (const Associator associator : {Associator::ospda, Associator::jpda, Associator::osjpda}) {
        for (std::size_t tracks = 2; tracks <= 8; ++tracks) {
            make_cluster(tracks, tracks + 3, false);
            measure("cluster", "", associator, 4, false);
        }
    }
    for (std::size_t a = 0; a < kAssociatorNames.size(); ++a) measure_tracker(static_cast<Associator>(a));
    semihosting::exit(0);
}
