#include "tests/bench/accuracy_dsp.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "dsp/detect.hpp"
#include "tests/bench/dsp_reference.hpp"

namespace bench {

namespace {

constexpr double kPi = std::numbers::pi;

double value(dsp::Real x) {
    return std::ldexp(static_cast<double>(x.raw()), -dsp::Real::fraction_bits);
}
double decibel(double ratio) {
    return 10 * std::log10(ratio);
}

struct FftError {
    double sqnr_db;
    double largest_bias;  ///< in units of the last place of the output
};

FftError measure_fft(double peak, int transforms) {
    Random random(1965);
    std::uniform_real_distribution<double> uniform(-peak, peak);
    double signal = 0;
    double noise = 0;
    std::array<Complex, 64> mean{};
    for (int t = 0; t < transforms; ++t) {
        dsp::Spectrum64 data;
        std::array<Complex, 64> x;
        for (std::size_t n = 0; n < 64; ++n) {
            data[n] = {static_cast<std::int16_t>(std::lrint(uniform(random))),
                       static_cast<std::int16_t>(std::lrint(uniform(random)))};
            x[n] = {static_cast<double>(data[n].re), static_cast<double>(data[n].im)};
        }
        const int exponent = scale_for_fft(data) + dsp::kFftExponent;
        dsp::fft64(data);
        const auto exact = dft64(x);
        for (std::size_t k = 0; k < 64; ++k) {
            const Complex scaled = exact[k] * std::ldexp(1.0, -exponent);
            const Complex error = Complex(data[k].re, data[k].im) - scaled;
            signal += std::norm(scaled);
            noise += std::norm(error);
            mean[k] += error / static_cast<double>(transforms);
        }
    }
    double bias = 0;
    for (const Complex& m : mean) bias = std::max({bias, std::abs(m.real()), std::abs(m.imag())});
    return {decibel(signal / noise), bias};
}

}  // namespace

std::vector<Row> fft_accuracy() {
    const FftError full = measure_fft(32767, 1000);
    const FftError quiet = measure_fft(327.67, 1000);
    return {{"64-point FFT, int16, full-scale random, SQNR against double", full.sqnr_db, 70, true, "dB"},
            {"  constant bias, worst bin, full scale", full.largest_bias, 0.1, false, "LSB"},
            {"  the same at -40 dBFS with block floating point", quiet.sqnr_db, 65, true, "dB"},
            {"  constant bias, worst bin, -40 dBFS", quiet.largest_bias, 0.1, false, "LSB"}};
}

std::vector<Row> noise_floor() {
    // On the Doppler grid, so that the tone's own sidelobes do not hide what the arithmetic adds to its row.
    const dsp::DspConfig config;
    const auto workspace = std::make_unique<dsp::Workspace>();
    Random random(7);
    std::uniform_real_distribution<double> uniform(0, 1);
    const double rate_cell = value(dsp::kDefaultWaveform.scale().rate_cell_mps);
    double fixed_all = 0;
    double exact_all = 0;
    double worst_row = -100;
    constexpr int kSites = 12;
    constexpr int kFrames = 20;
    for (int site = 0; site < kSites; ++site) {
        const int doppler_cell = site < 4 ? 0 : static_cast<int>(uniform(random) * 64) - 32;
        double fixed_row = 0;
        double exact_row = 0;
        for (int frame_number = 0; frame_number < kFrames; ++frame_number) {
            Samples samples(4096, 0.0);
            Tone tone;
            tone.range_m = 20 + 120 * uniform(random);
            tone.range_rate_mps = doppler_cell * rate_cell;
            tone.phase = 2 * kPi * uniform(random);
            tone.amplitude = 2048 * std::pow(10, -14.0 / 20);
            add_tone(samples, tone);
            add_noise(samples, 1, random);
            const dsp::BeatFrame frame = convert(samples, 2047);
            dsp::range_doppler(frame, config.range_window, config.doppler_window, workspace->spectrum,
                               workspace->map);
            const std::vector<double> exact = power_map(frame, config.range_window, config.doppler_window);
            const auto peak = static_cast<int>(std::ranges::max_element(exact) - exact.begin());
            for (int r = 2; r < 32; ++r) {
                for (int d = 0; d < 64; ++d) {
                    const int distance = std::abs((d - peak % 64 + 96) % 64 - 32);
                    if (distance < 5) continue;
                    const double e = exact[static_cast<std::size_t>(64 * r + d)];
                    const double f = std::exp2(
                        workspace->map.cell[static_cast<std::size_t>(r)][static_cast<std::size_t>(d)] /
                        1024.0);
                    fixed_all += f;
                    exact_all += e;
                    if (r == peak / 64) {
                        fixed_row += f;
                        exact_row += e;
                    }
                }
            }
        }
        worst_row = std::max(worst_row, decibel(fixed_row / exact_row));
    }
    return {{"noise floor of the map over double, 12 bits, tone -14 dBFS: mean",
             decibel(fixed_all / exact_all), 0.5, false, "dB"},
            {"  in the row of the tone, worst of 12 velocities", worst_row, 2.5, false, "dB"}};
}

namespace {

/// The definition: gather the N reference cells, sort, take the k-th.
int select_by_sorting(const dsp::PowerMap& map, const dsp::CfarConfig& config, int r, int d) {
    std::vector<int> cells;
    for (int side : {-1, 1}) {
        for (int i = 0; i < config.doppler_reference; ++i) {
            const int at = d + side * (config.doppler_guard + 1 + config.spacing * i);
            cells.push_back(map.cell[static_cast<std::size_t>(r)][static_cast<std::size_t>((at + 128) % 64)]);
        }
    }
    // Range cells by distance, both sides where they exist, until there are enough.
    std::vector<int> arm;
    for (int distance = config.range_guard + 1; distance < 64; distance += config.spacing) {
        for (int at : {r + distance, r - distance}) {
            if (at >= config.first_range_cell && at < 32 &&
                arm.size() < static_cast<std::size_t>(2 * config.range_reference)) {
                arm.push_back(map.cell[static_cast<std::size_t>(at)][static_cast<std::size_t>(d)]);
            }
        }
    }
    cells.insert(cells.end(), arm.begin(), arm.end());
    std::ranges::sort(cells);
    return cells[static_cast<std::size_t>(config.rank - 1)];
}

/// log2 of exponentially distributed power as the map stores it, 40 octaves' room below and 6 above the mean.
std::uint16_t exponential_cell(Random& random) {
    const double uniform = (static_cast<double>(random() >> 11) + 0.5) * 0x1p-53;
    return static_cast<std::uint16_t>(std::lrint(1024 * (40 + std::log2(-std::log(uniform)))));
}

}  // namespace

std::vector<Row> os_cfar_exactness(int rank_step) {
    Random random(3);
    const auto map = std::make_unique<dsp::PowerMap>();
    long compared = 0;
    long different = 0;
    long different_noise = 0;
    const auto compare = [&](const dsp::CfarConfig& config) {
        const dsp::OsCfar cfar(config);
        const int offset = dsp::os_cfar_noise_offset(config.reference_cells(), config.rank);
        for (int r = config.first_range_cell; r < 32; ++r) {
            for (int d = 0; d < 64; ++d) {
                const int x = map->at(r, d);
                const int selected = select_by_sorting(*map, config, r, d);
                ++compared;
                different += cfar.detects(*map, r, d) != (x > 0 && x > selected + cfar.threshold()) ? 1 : 0;
                different_noise += cfar.noise(*map, r, d) != std::max(selected + offset, 0) ? 1 : 0;
            }
        }
    };
    std::vector<dsp::CfarConfig> shapes(5);
    shapes[1] = {2, 8, 2, 0, 1, 1, 2, 100'000, 0};
    shapes[2] = {1, 4, 1, 4, 1, 1, 0, 1'000'000, 0};
    shapes[3] = {0, 0, 2, 3, 2, 1, 2, 100'000'000, -300};
    shapes[4] = {8, 11, 3, 6, 2, 1, 2, 50'000'000, 0};
    for (const auto& shape : shapes) {
        for (int kind = 0; kind < 4; ++kind) {
            for (auto& row : map->cell) {
                for (auto& cell : row) {
                    cell = kind == 0   ? exponential_cell(random)                         // noise
                           : kind == 1 ? static_cast<std::uint16_t>(random() % 8 * 2000)  // many ties
                           : kind == 2 ? static_cast<std::uint16_t>(random() % 65536)     // whole range
                                       : static_cast<std::uint16_t>(random() % 40 == 0 ? 30000 : 0);
                }
            }
            for (int rank = 1; rank <= shape.reference_cells(); rank += rank_step) {
                dsp::CfarConfig config = shape;
                config.rank = static_cast<std::int16_t>(rank);
                compare(config);
            }
        }
    }
    for (const int level : {0, 1, 20000, 65535}) {
        for (auto& row : map->cell) row.fill(static_cast<std::uint16_t>(level));
        compare(dsp::CfarConfig{});
    }
    return {{"OS-CFAR against sorting, cells decided differently of " + std::to_string(compared),
             static_cast<double>(different), 0, false, "cells"},
            {"  noise levels that differ", static_cast<double>(different_noise), 0, false, "cells"}};
}

std::vector<Row> false_alarm_rate() {
    std::vector<Row> rows;
    const auto map = std::make_unique<dsp::PowerMap>();
    for (const std::int32_t ppb : {1'000'000, 100'000}) {
        Random random(11);
        dsp::CfarConfig config;
        config.false_alarm_ppb = ppb;
        const dsp::OsCfar cfar(config);
        const int maps = ppb < 1'000'000 ? 10'500 : 5'300;
        long alarms = 0;
        long cells = 0;
        for (int m = 0; m < maps; ++m) {
            for (auto& row : map->cell) {
                for (auto& cell : row) cell = exponential_cell(random);
            }
            for (int r = config.first_range_cell; r < dsp::kRangeCells; ++r) {
                for (int d = 0; d < dsp::kDopplerCells; ++d) alarms += cfar.detects(*map, r, d) ? 1 : 0;
            }
            cells += (dsp::kRangeCells - config.first_range_cell) * dsp::kDopplerCells;
        }
        const double measured = static_cast<double>(alarms) / static_cast<double>(cells);
        const double design = ppb * 1e-9;
        rows.push_back({ppb < 1'000'000 ? "  at 1e-4, over 2e7 cells"
                                        : "measured Pfa off design at 1e-3, over 1e7 cells",
                        100 * std::abs(measured / design - 1), ppb < 1'000'000 ? 20.0 : 10.0, false, "%"});
    }
    return rows;
}

namespace {

struct SiteResult {
    double range_rmse = 0;  ///< cells
    double rate_rmse = 0;
    double range_bias = 0;
    double rate_bias = 0;
    double detected = 0;  ///< share of the trials
};

SiteResult measure_site(double range_m, double rate_mps, double snr_db, int trials, Random& random,
                        dsp::Workspace& workspace) {
    const dsp::CellScale scale = dsp::kDefaultWaveform.scale();
    const double sigma = 20;
    std::uniform_real_distribution<double> phase(0, 2 * kPi);
    SiteResult site;
    double range_square = 0;
    double rate_square = 0;
    int detected = 0;
    for (int t = 0; t < trials; ++t) {
        Samples samples(4096, 0.0);
        add_tone(samples, {range_m, rate_mps, amplitude_for(snr_db, sigma), phase(random)});
        add_noise(samples, sigma, random);
        dsp::DetectionList list;
        dsp::detect(convert(samples), dsp::DspConfig{}, scale, workspace, list);
        double nearest = 1.5;  // cells; further away is another thing
        double range_error = 0;
        double rate_error = 0;
        for (const dsp::Detection& d : list.view()) {
            const double er = (value(d.range_m) - range_m) / value(scale.range_cell_m);
            const double ev = (value(d.range_rate_mps) - rate_mps) / value(scale.rate_cell_mps);
            if (std::max(std::abs(er), std::abs(ev)) >= nearest) continue;
            nearest = std::max(std::abs(er), std::abs(ev));
            range_error = er;
            rate_error = ev;
        }
        if (nearest >= 1.5) continue;
        ++detected;
        range_square += range_error * range_error;
        rate_square += rate_error * rate_error;
        site.range_bias += range_error;
        site.rate_bias += rate_error;
    }
    site.detected = static_cast<double>(detected) / trials;
    site.range_rmse = std::sqrt(range_square / detected);
    site.rate_rmse = std::sqrt(rate_square / detected);
    site.range_bias /= detected;
    site.rate_bias /= detected;
    return site;
}

}  // namespace

std::vector<Row> single_target(int trials) {
    const auto workspace = std::make_unique<dsp::Workspace>();
    const dsp::CellScale scale = dsp::kDefaultWaveform.scale();
    const double range_cell = value(scale.range_cell_m);
    const double rate_cell = value(scale.rate_cell_mps);
    const double coupling = value(scale.coupling_s);
    Random random(77);

    // Sites on a grid of places inside a cell, 0 to 1/2 in both directions, in cells all over the area.
    double worst_range = 0;
    double worst_rate = 0;
    double least_detected = 1;
    for (const double snr : {20.0, 25.0, 30.0, 40.0}) {
        const double bound = std::sqrt(6 / (4 * kPi * kPi * std::pow(10, snr / 10)));
        for (int i = 0; i < 25; ++i) {
            const int rate_site = static_cast<int>(random() % 57) - 28;
            const int range_site = 7 + static_cast<int>(random() % 19);
            const double rate = (rate_site + 0.125 * (i % 5)) * rate_cell;
            const double range = (range_site + 0.125 * (i / 5)) * range_cell - coupling * rate;
            const SiteResult site = measure_site(range, rate, snr, trials, random, *workspace);
            worst_range = std::max(worst_range, site.range_rmse / bound);
            worst_rate = std::max(worst_rate, site.rate_rmse / bound);
            least_detected = std::min(least_detected, site.detected);
        }
    }
    double worst_bias_range = 0;
    double worst_bias_rate = 0;
    for (int i = 0; i < 120; ++i) {
        const double rate = -30 + 60.0 * i / 119;
        const double range = 20 + 120.0 * ((i * 37) % 120) / 119;
        const SiteResult site = measure_site(range, rate, 50, std::max(trials / 10, 4), random, *workspace);
        worst_bias_range = std::max(worst_bias_range, std::abs(site.range_bias));
        worst_bias_rate = std::max(worst_bias_rate, std::abs(site.rate_bias));
    }
    return {{"one target, 20..140 m, +-28 m/s, SNR 20..40 dB: range RMSE over Cramer-Rao, worst", worst_range,
             2.6, false, ""},
            {"  range rate RMSE over Cramer-Rao, worst", worst_rate, 2.6, false, ""},
            {"  detected, worst place, 20 dB", least_detected, 0.8, true, ""},
            {"  range bias at 50 dB over +-30 m/s, worst", worst_bias_range, 0.02, false, "cells"},
            {"  range rate bias at 50 dB over +-30 m/s, worst", worst_bias_rate, 0.02, false, "cells"}};
}

std::vector<Row> accuracy_dsp() {
    std::vector<Row> rows;
    for (const auto& measured :
         {fft_accuracy(), noise_floor(), os_cfar_exactness(), false_alarm_rate(), single_target()}) {
        rows.insert(rows.end(), measured.begin(), measured.end());
    }
    return rows;
}

}  // namespace bench
