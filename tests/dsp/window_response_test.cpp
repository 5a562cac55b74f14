// Expected values: the same quantities from their definitions in double precision, the weights by Eigen.
#include <Eigen/Dense>
#include <cmath>
#include <complex>
#include <numbers>

#include "dsp/window_response.hpp"

#include <CppUTest/TestHarness.h>

namespace {

constexpr double kPi = std::numbers::pi;
using dsp::WindowResponse;

double response(const dsp::Window& w, double x) {
    double sum = 0;
    double all = 0;
    for (std::size_t n = 0; n < 64; ++n) {
        sum += w[n] * std::cos(2 * kPi * x * (static_cast<double>(n) - 32) / 64);
        all += w[n];
    }
    return sum / all;
}

double covariance(const dsp::Window& w, int lag) {
    double sum = 0;
    double all = 0;
    for (std::size_t n = 0; n < 64; ++n) {
        const double square = static_cast<double>(w[n]) * w[n];
        sum += square * std::cos(2 * kPi * lag * (static_cast<double>(n) - 32) / 64);
        all += square;
    }
    return sum / all;
}

}  // namespace

TEST_GROUP(WindowResponse){};

TEST(WindowResponse, WeightsAreTheLeastSquaresSolution) {
    for (std::size_t kind = 0; kind < 4; ++kind) {
        const dsp::Window& w = dsp::kWindows[kind];
        const WindowResponse& r = dsp::kWindowResponses[kind];
        for (std::size_t grid = 0; grid < WindowResponse::kGrid; ++grid) {
            const double d = static_cast<double>(grid) / 16;
            Eigen::Matrix<double, 5, 2> h;
            Eigen::Matrix<double, 5, 5> c;
            for (int i = 0; i < 5; ++i) {
                h(i, 0) = response(w, i - 2 - d);
                h(i, 1) = (response(w, i - 2 - d - 1e-5) - response(w, i - 2 - d + 1e-5)) / 2e-5;
                for (int j = 0; j < 5; ++j) c(i, j) = covariance(w, i - j);
            }
            const Eigen::Matrix<double, 5, 5> stiff = c + 0.03 * Eigen::Matrix<double, 5, 5>::Identity();
            const Eigen::Matrix<double, 5, 2> u = stiff.ldlt().solve(h);
            const Eigen::Matrix<double, 2, 5> k = (h.transpose() * u).inverse() * u.transpose();
            for (int i = 0; i < 5; ++i) {
                const auto tap = static_cast<std::size_t>(i);
                const double sign = i % 2 == 0 ? 1 : -1;  // the lobe's, from cell to cell
                DOUBLES_EQUAL(sign * k(0, i), r.lobe[grid].weight[tap].amplitude / 4096.0, 3e-4);
                DOUBLES_EQUAL(sign * k(1, i), r.lobe[grid].weight[tap].offset / 4096.0, 3e-4);
            }
            const Eigen::Matrix2d variance = k * c * k.transpose();
            DOUBLES_EQUAL(1024 * std::log2(4096 * variance(0, 0)), r.lobe[grid].amplitude_variance, 2);
            DOUBLES_EQUAL(1024 * std::log2(4096 * variance(1, 1)), r.lobe[grid].offset_variance, 2);
        }
    }
}

TEST(WindowResponse, SidelobesAreAnUpperBoundAndATightOne) {
    for (std::size_t kind = 0; kind < 4; ++kind) {
        const dsp::Window& w = dsp::kWindows[kind];
        const WindowResponse& r = dsp::kWindowResponses[kind];
        LONGS_EQUAL(0, r.sidelobe[0]);
        LONGS_EQUAL(0, r.sidelobe[1]);
        for (std::size_t m = 1; m <= 32; ++m) LONGS_EQUAL(r.sidelobe[m], r.sidelobe[64 - m]);
        for (int m = 2; m <= 32; ++m) {
            double largest = -1000;
            for (int d = -50; d <= 50; ++d) {
                // With the true phases: the response seen by a transform is not symmetric for w[0] != 0.
                std::complex<double> far;
                std::complex<double> near;
                for (std::size_t n = 0; n < 64; ++n) {
                    far += std::polar<double>(w[n], 2 * kPi * (d / 100.0 - m) * static_cast<double>(n) / 64);
                    near += std::polar<double>(w[n], 2 * kPi * (d / 100.0) * static_cast<double>(n) / 64);
                }
                largest = std::max(largest, 20 * std::log10(std::abs(far) / std::abs(near)));
            }
            const double table = r.sidelobe[static_cast<std::size_t>(m)] / 1024.0 * 10 * std::log10(2.0);
            if (largest > -80) DOUBLES_EQUAL(largest, table, m == 32 && kind != 1 ? 60 : 1.0);
            CHECK(r.sidelobe[static_cast<std::size_t>(m)] <= 0);
        }
    }
    // Hann, closed form at half a cell: W(x) = sin(pi x) / (pi x (1 - x^2)).
    const auto hann = [](double x) { return std::sin(kPi * x) / (kPi * x * (1 - x * x)); };
    for (int m = 2; m < 8; ++m) {
        const double expected = 1024 * 2 * std::log2(std::abs(hann(m - 0.5) / hann(0.5)));
        DOUBLES_EQUAL(expected,
                      dsp::window_response(dsp::WindowKind::hann).sidelobe[static_cast<std::size_t>(m)], 20);
    }
}

TEST(WindowResponse, TheRatioToANeighbourTellsTheOffset) {
    for (std::size_t kind = 0; kind < 4; ++kind) {
        // log2 of |W(d)|^2 / |W(1-d)|^2 falls as d grows, for a rectangular window from 0 on.
        const auto ratio = [&](double d) {
            return 2 * std::log2(
                           std::abs(response(dsp::kWindows[kind], d) / response(dsp::kWindows[kind], 1 - d)));
        };
        for (std::size_t i = 0; i < WindowResponse::kRatios; ++i) {
            const double middle = (static_cast<double>(i) + 0.5) / 8;
            double d = 0.5;
            const double least = kind == 0 ? 0 : -0.5;
            while (d > least && ratio(d) < middle) d -= 1e-3;
            // Half a step of the table, and a little for the logarithms' rounding.
            DOUBLES_EQUAL(d, dsp::kWindowResponses[kind].offset_by_ratio[i] / 16.0, 0.5 / 16 + 0.003);
        }
    }
    // Hann, closed form: |W(d)| / |W(1-d)| = (2-d)/(1+d).
    const auto& hann = dsp::window_response(dsp::WindowKind::hann).offset_by_ratio;
    for (int offset = -8; offset <= 8; ++offset) {
        const double d = offset / 16.0;
        const double log2_ratio = 2 * std::log2((2 - d) / (1 + d));
        LONGS_EQUAL(offset, hann[static_cast<std::size_t>(log2_ratio * 8)]);
    }
}
