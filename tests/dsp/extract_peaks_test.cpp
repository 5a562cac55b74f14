// Expected values: the motion put into the synthetic beat signal (tests/bench/dsp_reference), and constructed
// spectra.
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <vector>

#include "dsp/detect.hpp"
#include "tests/bench/dsp_reference.hpp"

#include <CppUTest/TestHarness.h>

using dsp::WindowKind;

namespace {

double value(dsp::Real x) {
    return std::ldexp(static_cast<double>(x.raw()), -dsp::Real::fraction_bits);
}

constexpr dsp::CellScale kScale = dsp::kDefaultWaveform.scale();
const double kRangeCell = value(kScale.range_cell_m);
const double kRateCell = value(kScale.rate_cell_mps);
const double kCoupling = value(kScale.coupling_s);

}  // namespace

TEST_GROUP(ExtractPeaks) {
    std::unique_ptr<dsp::Workspace> workspace = std::make_unique<dsp::Workspace>();
    dsp::DspConfig config;
    dsp::DetectionList list;
    bench::Samples samples = bench::Samples(4096, 0.0);
    bench::Random random{8};

    double uniform(double low, double high) {
        return std::uniform_real_distribution<double>(low, high)(random);
    }
    /// A tone that peaks at these cells of the map.
    void add_at(double range_cell, double doppler_cell, double snr_db, double sigma) {
        const double rate = doppler_cell * kRateCell;
        bench::add_tone(samples, {range_cell * kRangeCell - kCoupling * rate, rate,
                                  bench::amplitude_for(snr_db, sigma), uniform(0, 2 * std::numbers::pi)});
    }
    void detect(double sigma) {
        bench::add_noise(samples, sigma, random);
        dsp::detect(bench::convert(samples), config, kScale, *workspace, list);
        std::ranges::fill(samples, 0.0);
    }
    /// Distance in cells of the nearest detection to a place in the map, the larger of the two directions.
    double nearest(double range_cell, double doppler_cell) const {
        double best = 100;
        for (const dsp::Detection& d : list.view()) {
            const double doppler = value(d.range_rate_mps) / kRateCell;
            const double range = (value(d.range_m) + kCoupling * value(d.range_rate_mps)) / kRangeCell;
            best = std::min(best, std::max(std::abs(range - range_cell), std::abs(doppler - doppler_cell)));
        }
        return best;
    }
};

TEST(ExtractPeaks, AnyWindowPlacesATarget) {
    for (const auto range :
         {WindowKind::rectangular, WindowKind::hann, WindowKind::hamming, WindowKind::blackman}) {
        for (const auto doppler :
             {WindowKind::rectangular, WindowKind::hann, WindowKind::hamming, WindowKind::blackman}) {
            config.range_window = range;
            config.doppler_window = doppler;
            for (int t = 0; t < 15; ++t) {
                const double r = uniform(6, 28);
                const double d = uniform(-31, 31);
                add_at(r, d, 55, 20);
                detect(20);
                CHECK(list.count >= 1);
                CHECK(nearest(r, d) < 0.03);
            }
        }
    }
}

TEST(ExtractPeaks, NoGhostsOfAStrongTarget) {
    int others = 0;
    constexpr int kFrames = 150;
    for (int t = 0; t < kFrames; ++t) {
        const double r = uniform(3, 30);
        const double d = uniform(-32, 32);
        add_at(r, d, uniform(50, 75), 5);
        detect(5);
        CHECK(list.count >= 1);
        others += list.count - 1;
    }
    // 1920 cells at Pfa 1e-4 are 0.19 false alarms a frame, fewer as local maxima.
    CHECK(others < 0.25 * kFrames);
}

TEST(ExtractPeaks, ACleanStrongTargetIsOneDetection) {
    // Without noise nothing hides what the window and the arithmetic leave beside the peak.
    for (int t = 0; t < 100; ++t) {
        const double r = uniform(3, 30);
        const double d = uniform(-32, 32);
        add_at(r, d, 60, 30);
        detect(1);
        LONGS_EQUAL_TEXT(1, std::min(list.count, 1), "found");
        int strong = 0;
        for (const auto& x : list.view()) strong += value(x.snr_db) > 25 ? 1 : 0;
        LONGS_EQUAL(1, strong);
    }
}

TEST(ExtractPeaks, ErrorsAreNearTheBoundAndMatchTheVariances) {
    // Both within twice the Cramer-Rao bound in cells; normalised by the variance: 1 in the mean where noise
    // rules, less where the model's error is added.
    for (const double snr : {20.0, 26.0}) {
        const double bound = 6 / (4 * std::numbers::pi * std::numbers::pi * std::pow(10, snr / 10));
        double range_square = 0;
        double rate_square = 0;
        double range_ratio = 0;
        double rate_ratio = 0;
        int count = 0;
        for (int t = 0; t < 600; ++t) {
            const double rate = uniform(-28, 28);
            const double range = uniform(20, 140);
            bench::add_tone(samples, {range, rate, bench::amplitude_for(snr, 20), uniform(0, 6.28)});
            detect(20);
            for (const dsp::Detection& d : list.view()) {
                const double er = value(d.range_m) - range;
                const double ev = value(d.range_rate_mps) - rate;
                if (std::abs(er) > kRangeCell || std::abs(ev) > kRateCell) continue;
                range_ratio += er * er / value(d.range_variance_m2);
                rate_ratio += ev * ev / value(d.rate_variance_m2ps2);
                range_square += er * er / (kRangeCell * kRangeCell);
                rate_square += ev * ev / (kRateCell * kRateCell);
                ++count;
            }
        }
        CHECK(count > 540);
        CHECK(range_square / count < 4 * bound);
        CHECK(rate_square / count < 4 * bound);
        CHECK(range_ratio / count > 0.6 && range_ratio / count < 1.3);
        CHECK(rate_ratio / count > 0.6 && rate_ratio / count < 1.3);
    }
}

TEST(ExtractPeaks, ReportsTheSignalToNoiseRatioOfThePeakCell) {
    double sum = 0;
    constexpr int kFrames = 200;
    for (int t = 0; t < kFrames; ++t) {
        add_at(uniform(10, 20) > 15 ? 16 : 12, 5, 40, 20);  // on the grid: no loss between cells
        detect(20);
        sum += value(list.item[0].snr_db) / kFrames;
    }
    // A Hann window loses 1.76 dB in each direction.
    DOUBLES_EQUAL(40 - 2 * 1.76, sum, 0.5);
}

TEST(ExtractPeaks, VelocityWrapsAtTheEnds) {
    for (const double d : {-32.0, -31.7, -31.5, 31.2, 31.6, 31.9}) {
        add_at(15, d, 45, 20);
        detect(20);
        const double doppler = value(list.item[0].range_rate_mps) / kRateCell;
        CHECK(doppler >= -32 && doppler < 32);
        DOUBLES_EQUAL(0, std::remainder(doppler - d, 64), 0.05);
    }
}

TEST(ExtractPeaks, TheLastRangeCellsAreServedWithALargerVariance) {
    for (const double r : {2.6, 3.1, 29.6, 30.4, 30.9, 31.3}) {
        for (const double d : {0.0, 12.3}) {
            add_at(r, d, 45, 20);
            detect(20);
            CHECK(list.count >= 1);
            CHECK(nearest(r, d) < (r > 29.5 ? 0.12 : 0.05));
        }
    }
}

TEST(ExtractPeaks, BelowCellZeroTheSpectrumIsTheMirroredOne) {
    config.cfar.first_range_cell = 0;
    for (const double r : {1.0, 1.2, 1.4}) {
        for (const double d : {12.3, -20.6, 30.8}) {
            add_at(r, d, 45, 20);
            detect(20);
            CHECK(list.count >= 1);
            CHECK(nearest(r, d) < 0.1);
        }
    }
}

TEST(ExtractPeaks, LeakageIsNoTarget) {
    for (auto& s : samples) s = 900;
    for (std::size_t i = 0; i < 4096; ++i) {
        samples[i] += 300 * std::cos(2 * std::numbers::pi * 0.3 * static_cast<double>(i % 64) / 64);
    }
    add_at(12.3, 0, 40, 5);  // at the leakage's own Doppler shift
    detect(5);
    LONGS_EQUAL(12, list.item[0].range_cell);
    CHECK(nearest(12.3, 0) < 0.05);
    for (const auto& x : list.view()) CHECK(x.range_cell >= 2);
}

TEST(ExtractPeaks, TwoTargetsApartAreTwo) {
    struct {
        double separation, difference_db, least;
    } const table[] = {{2.0, 0, 0.6}, {2.5, 0, 0.97}, {3.0, 0, 0.98}, {3.0, -6, 0.95}, {4.0, -12, 0.95}};
    for (const auto& row : table) {
        for (const bool in_range : {false, true}) {
            int both = 0;
            constexpr int kFrames = 60;
            for (int t = 0; t < kFrames; ++t) {
                const double r = uniform(6, 24);
                const double d = uniform(-28, 24);
                const double r2 = r + (in_range ? row.separation : 0);
                const double d2 = d + (in_range ? 0 : row.separation);
                add_at(r, d, 35, 20);
                add_at(r2, d2, 35 + row.difference_db, 20);
                detect(20);
                both += nearest(r, d) < 0.75 && nearest(r2, d2) < 0.75 ? 1 : 0;
            }
            CHECK(both >= row.least * kFrames - 2);
        }
    }
}

TEST(ExtractPeaks, CarsAtOneVelocityOrOneRangeDoNotHideEachOther) {
    int column = 0;
    int row = 0;
    constexpr int kFrames = 100;
    for (int t = 0; t < kFrames; ++t) {
        const double d = uniform(-20, 20);
        const double r = uniform(5, 7);
        for (int i = 0; i < 5; ++i) add_at(r + 5 * i, d, i == 2 ? 24 : 44, 20);
        detect(20);
        column += nearest(r + 10, d) < 0.75 ? 1 : 0;
        for (int i = 0; i < 4; ++i) add_at(r + 8, d + 5 * i - 8, i == 1 ? 26 : 41, 20);
        detect(20);
        row += nearest(r + 8, d - 3) < 0.75 ? 1 : 0;
    }
    CHECK(column >= 97);
    CHECK(row >= 95);
}

TEST(ExtractPeaks, ARidgeOfStationaryClutterHidesNoCarBesideIt) {
    int found = 0;
    constexpr int kFrames = 60;
    for (int t = 0; t < kFrames; ++t) {
        const double ridge = uniform(-25, 10);
        for (int r = 3; r < 31; ++r) add_at(r + uniform(-0.5, 0.5), ridge, uniform(30, 40), 20);
        const double r = uniform(6, 26);
        add_at(r, ridge + 5, 25, 20);
        detect(20);
        found += nearest(r, ridge + 5) < 0.75 ? 1 : 0;
        CHECK(list.count <= 20);
    }
    CHECK(found >= 57);
}

TEST(ExtractPeaks, KeepsTheStrongestAndCountsTheRest) {
    // 150 separate single cells in an empty map: no windows, no sidelobes to speak of.
    for (auto& row : workspace->map.cell) row.fill(9000);
    for (auto& row : workspace->spectrum.row) row.fill({});
    workspace->spectrum.row_exponent.fill(0);
    dsp::CellMask peaks;
    for (int i = 0; i < 150; ++i) {
        const int r = 2 + i / 16 * 3;
        const int d = i % 16 * 4;
        workspace->map.cell[static_cast<std::size_t>(r)][static_cast<std::size_t>(d)] =
            static_cast<std::uint16_t>(40000 + i * 37 % 150);
        workspace->spectrum.row[static_cast<std::size_t>(r)][static_cast<std::size_t>(d)] = {1000, 0};
        peaks.set(r, d);
    }
    const dsp::OsCfar cfar{dsp::CfarConfig{}};
    dsp::extract_peaks(workspace->spectrum, workspace->map, peaks, cfar, WindowKind::hann, WindowKind::hann,
                       {}, kScale, list);
    LONGS_EQUAL(dsp::kMaxDetections, list.count);
    LONGS_EQUAL(150 - dsp::kMaxDetections, list.dropped);
    for (int i = 0; i < list.count; ++i) {
        const auto& d = list.item[static_cast<std::size_t>(i)];
        LONGS_EQUAL(40149 - i, workspace->map.cell[d.range_cell][d.doppler_cell]);
    }
}

TEST(ExtractPeaks, AnyNumberOfThemComesStrongestFirst) {
    const dsp::OsCfar cfar{dsp::CfarConfig{}};
    for (auto& row : workspace->spectrum.row) row.fill({});
    workspace->spectrum.row_exponent.fill(0);
    for (int number = 0; number <= 140; ++number) {
        for (auto& row : workspace->map.cell) row.fill(9000);
        dsp::CellMask peaks;
        std::vector<int> powers;
        for (int i = 0; i < number; ++i) {
            const int r = 2 + i / 16 * 3;
            const int d = i % 16 * 4;
            const int power = 40'000 + static_cast<int>(random() % 100);  // some are equal
            workspace->map.cell[static_cast<std::size_t>(r)][static_cast<std::size_t>(d)] =
                static_cast<std::uint16_t>(power);
            workspace->spectrum.row[static_cast<std::size_t>(r)][static_cast<std::size_t>(d)] = {0, -700};
            peaks.set(r, d);
            powers.push_back(power);
        }
        std::ranges::sort(powers, std::greater<>());
        dsp::extract_peaks(workspace->spectrum, workspace->map, peaks, cfar, WindowKind::hann,
                           WindowKind::hann, {}, kScale, list);
        LONGS_EQUAL(std::min(number, dsp::kMaxDetections), list.count);
        LONGS_EQUAL(number - list.count, list.dropped);
        for (int i = 0; i < list.count; ++i) {
            const auto& d = list.item[static_cast<std::size_t>(i)];
            LONGS_EQUAL(powers[static_cast<std::size_t>(i)],
                        workspace->map.cell[d.range_cell][d.doppler_cell]);
        }
    }
}

TEST(ExtractPeaks, DiscardsWhatIsBelowTheMinimumSnr) {
    add_at(12, 5, 40, 20);
    add_at(22, -9, 24, 20);
    config.peaks.min_snr_cdb = 3000;
    detect(20);
    LONGS_EQUAL(1, list.count);
    LONGS_EQUAL(0, list.dropped);
    LONGS_EQUAL(12, list.item[0].range_cell);
}
