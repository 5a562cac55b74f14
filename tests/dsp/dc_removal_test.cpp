// Expected values: exact rational arithmetic, or worked by hand.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "dsp/dc_removal.hpp"
#include "dsp/frame_quality.hpp"

#include <CppUTest/TestHarness.h>

namespace {

std::uint32_t lcg(std::uint32_t& state) {
    state = state * 1664525U + 1013904223U;
    return state >> 8;
}

dsp::DcLevels levels_of(const dsp::BeatFrame& frame) {
    dsp::DcLevels levels;
    (void)dsp::inspect(frame, 32767, levels);
    return levels;
}

}  // namespace

TEST_GROUP(DcRemoval) {
    dsp::BeatFrame frame;
    dsp::Spectrum64 out;
    dsp::Window window = dsp::window(dsp::WindowKind::rectangular);

    /// Every sample of every chirp against window (x - mean) / 2^exponent, rounded down: the step below, and
    /// a little for the mean's own rounding. Returns the largest output.
    int check_all() {
        const dsp::DcLevels levels = levels_of(frame);
        int largest = 0;
        const auto check = [&](std::size_t k, std::size_t n, int part) {
            const double mean = static_cast<double>(levels.sum[k]) / 64;
            const double exact =
                std::ldexp((frame.chirp[k][n] - mean) * window[n] / 32768, -levels.exponent[k / 2]);
            DOUBLES_EQUAL(exact - 0.5, part, 0.5 + 1.0 / 4);
            largest = std::max(largest, std::abs(part));
        };
        for (std::size_t k = 0; k < 64; k += 2) {
            for (std::size_t i = k; i < k + 2; ++i) {
                long sum = 0;
                for (const auto s : frame.chirp[i]) sum += s;
                LONGS_EQUAL(sum, levels.sum[i]);
            }
            dsp::remove_dc(frame.chirp[k], levels.sum[k], frame.chirp[k + 1], levels.sum[k + 1],
                           levels.exponent[k / 2], window, out);
            for (std::size_t n = 0; n < 64; ++n) {
                check(k, n, out[n].re);
                check(k + 1, n, out[n].im);
            }
        }
        return largest;
    }

    void fill(int scale) {
        std::uint32_t state = 1;
        for (std::size_t k = 0; k < 64; ++k) {
            for (auto& s : frame.chirp[k]) {
                const int offset = scale / 3 - static_cast<int>(k) * scale / 200;
                s = static_cast<std::int16_t>(std::clamp(
                    offset + static_cast<int>(lcg(state) % static_cast<std::uint32_t>(2 * scale + 1)) - scale,
                    -32768, 32767));
            }
        }
    }
};

TEST(DcRemoval, RemovesTheMeanOfEachChirpAndUsesTheFormat) {
    for (const int scale : {1, 3, 100, 2047, 32767}) {
        fill(scale);
        CHECK(check_all() >= 2000);
    }
}

TEST(DcRemoval, TheExponentIsThatOfTheLargestDeviation) {
    for (const int scale : {1, 5, 60, 700, 9000, 32767}) {
        fill(scale);
        const auto got = levels_of(frame).exponent;
        std::array<int, 32> expected{};
        for (std::size_t i = 0; i < 32; ++i) {
            double largest = 0;
            for (const auto& chirp : {frame.chirp[2 * i], frame.chirp[2 * i + 1]}) {
                double mean = 0;
                for (const auto x : chirp) mean += x / 64.0;
                for (const auto x : chirp) largest = std::max(largest, std::abs(x - mean));
            }
            expected[i] = std::ilogb(largest) + 1 - 12;
        }
        const int highest = *std::ranges::max_element(expected);
        for (std::size_t i = 0; i < 32; ++i)
            LONGS_EQUAL(highest - expected[i] <= 2 ? highest : expected[i], got[i]);
    }
}

TEST(DcRemoval, AppliesTheWindow) {
    for (const auto kind : {dsp::WindowKind::hann, dsp::WindowKind::blackman}) {
        window = dsp::window(kind);
        for (const int scale : {1, 300, 32767}) {
            fill(scale);
            check_all();
        }
    }
}

TEST(DcRemoval, FullScaleStepsFit) {
    // 63 samples at one end and one at the other: the largest possible deviation, 65535 * 63/64.
    for (const int sign : {-1, 1}) {
        for (auto& chirp : frame.chirp) {
            chirp.fill(static_cast<std::int16_t>(sign > 0 ? -32768 : 32767));
            chirp[17] = static_cast<std::int16_t>(sign > 0 ? 32767 : -32768);
        }
        CHECK(check_all() <= 1 << dsp::kFftInputBits);
        for (const auto exponent : levels_of(frame).exponent) LONGS_EQUAL(4, exponent);
    }
}

TEST(DcRemoval, OneCodeIsLifted) {
    frame.chirp[5][7] = 1;  // deviation 63/64 and -1/64
    const dsp::DcLevels levels = levels_of(frame);
    LONGS_EQUAL(-11, levels.exponent[2]);
    dsp::remove_dc(frame.chirp[4], levels.sum[4], frame.chirp[5], levels.sum[5], levels.exponent[2], window,
                   out);
    DOUBLES_EQUAL(2048.0 * 63 / 64, out[7].im, 1);
    DOUBLES_EQUAL(-2048.0 / 64, out[8].im, 1);
    LONGS_EQUAL(0, out[7].re);
}

TEST(DcRemoval, ABurstHasItsOwnScaleAndTheOthersShareOne) {
    fill(200);
    for (auto& s : frame.chirp[21]) s = static_cast<std::int16_t>(100 * s);
    for (auto& s : frame.chirp[40]) s = static_cast<std::int16_t>(s / 2);
    for (auto& s : frame.chirp[41]) s = static_cast<std::int16_t>(s / 2);
    const auto exponent = levels_of(frame).exponent;
    for (std::size_t i = 0; i < 32; ++i)
        CHECK(i == 10 ? exponent[i] > exponent[0] + 4 : exponent[i] <= exponent[0] + 1);
    for (auto& s : frame.chirp[21]) s = static_cast<std::int16_t>(s / 100);
    const auto calm = levels_of(frame).exponent;
    for (const auto e : calm) LONGS_EQUAL(calm[0], e);
}

TEST(DcRemoval, AConstantFrameBecomesZero) {
    for (auto& chirp : frame.chirp) chirp.fill(1234);
    LONGS_EQUAL(0, check_all());
    for (const auto exponent : levels_of(frame).exponent) LONGS_EQUAL(-11, exponent);
}

TEST(DcRemoval, ATargetAtTheSameSpeedStays) {
    // Zero Doppler shift: every chirp equal. Only what does not change along the chirp may go.
    for (auto& chirp : frame.chirp) {
        for (std::size_t n = 0; n < 64; ++n) {
            chirp[n] =
                static_cast<std::int16_t>(500 + std::lrint(100 * std::cos(0.6 * static_cast<double>(n))));
        }
    }
    CHECK(check_all() >= 2000);
}
