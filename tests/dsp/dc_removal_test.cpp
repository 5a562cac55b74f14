// Expected values: exact rational arithmetic, or worked by hand.
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "dsp/dc_removal.hpp"

#include <CppUTest/TestHarness.h>

namespace {

std::uint32_t lcg(std::uint32_t& state) {
    state = state * 1664525U + 1013904223U;
    return state >> 8;
}

}  // namespace

TEST_GROUP(DcRemoval) {
    dsp::BeatFrame frame;
    std::array<std::int16_t, 64> out;

    /// Every sample of every chirp against (x - mean) / 2^exponent; returns the largest output.
    int check_all() {
        const dsp::DcLevels levels = dsp::dc_levels(frame);
        int largest = 0;
        for (std::size_t k = 0; k < 64; ++k) {
            long sum = 0;
            for (const auto s : frame.chirp[k]) sum += s;
            LONGS_EQUAL(sum, levels.sum[k]);
            dsp::remove_dc(frame.chirp[k], levels.sum[k], levels.exponent[k / 2], out);
            for (std::size_t n = 0; n < 64; ++n) {
                const double exact =
                    std::ldexp(frame.chirp[k][n] - static_cast<double>(sum) / 64, -levels.exponent[k / 2]);
                DOUBLES_EQUAL(exact, out[n], 0.5);
                largest = std::max(largest, std::abs(int{out[n]}));
            }
        }
        return largest;
    }
};

TEST(DcRemoval, RemovesTheMeanOfEachChirpExactlyAndUsesTheFormat) {
    std::uint32_t state = 1;
    for (const int scale : {1, 3, 100, 2047, 32767}) {
        for (std::size_t k = 0; k < 64; ++k) {
            for (auto& s : frame.chirp[k]) {
                const int offset = scale / 3 - static_cast<int>(k) * scale / 200;
                s = static_cast<std::int16_t>(std::clamp(
                    offset + static_cast<int>(lcg(state) % static_cast<std::uint32_t>(2 * scale + 1)) - scale,
                    -32768, 32767));
            }
        }
        const int largest = check_all();
        CHECK(largest >= 16000);
    }
}

TEST(DcRemoval, FullScaleStepsFit) {
    // 63 samples at one end and one at the other: the largest possible deviation, 65535 * 63/64.
    for (const int sign : {-1, 1}) {
        for (auto& chirp : frame.chirp) {
            chirp.fill(static_cast<std::int16_t>(sign > 0 ? -32768 : 32767));
            chirp[17] = static_cast<std::int16_t>(sign > 0 ? 32767 : -32768);
        }
        check_all();
        for (const auto exponent : dsp::dc_levels(frame).exponent) LONGS_EQUAL(1, exponent);
    }
}

TEST(DcRemoval, OneCodeIsLiftedToFullPrecision) {
    frame.chirp[5][7] = 1;  // deviation 63/64 and -1/64
    const dsp::DcLevels levels = dsp::dc_levels(frame);
    LONGS_EQUAL(-15, levels.exponent[2]);
    dsp::remove_dc(frame.chirp[5], levels.sum[5], levels.exponent[2], out);
    LONGS_EQUAL(32768 * 63 / 64, out[7]);
    LONGS_EQUAL(-32768 / 64, out[8]);
}

TEST(DcRemoval, AConstantFrameBecomesZero) {
    for (auto& chirp : frame.chirp) chirp.fill(1234);
    LONGS_EQUAL(0, check_all());
    for (const auto exponent : dsp::dc_levels(frame).exponent) LONGS_EQUAL(-15, exponent);
}

TEST(DcRemoval, ATargetAtTheSameSpeedStays) {
    // Zero Doppler shift: every chirp equal. Only what does not change along the chirp may go.
    for (auto& chirp : frame.chirp) {
        for (std::size_t n = 0; n < 64; ++n) {
            chirp[n] =
                static_cast<std::int16_t>(500 + std::lrint(100 * std::cos(0.6 * static_cast<double>(n))));
        }
    }
    CHECK(check_all() >= 16000);
}
