// Expected values: exact rational arithmetic, or worked by hand.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numeric>

#include "dsp/dc_levels.hpp"
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

TEST_GROUP(DcLevels) {
    dsp::BeatFrame frame;

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

TEST(DcLevels, SumsAreExact) {
    for (const int scale : {1, 3, 100, 2047, 32767}) {
        fill(scale);
        const auto sum = levels_of(frame).sum;
        for (std::size_t k = 0; k < 64; ++k) {
            LONGS_EQUAL(std::accumulate(frame.chirp[k].begin(), frame.chirp[k].end(), 0), sum[k]);
        }
    }
}

TEST(DcLevels, TheExponentIsThatOfTheLargestDeviation) {
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

TEST(DcLevels, ExponentsOfTheLargestAndTheSmallestDeviation) {
    // 63 samples at one end and one at the other: 65535 * 63/64.
    for (const int sign : {-1, 1}) {
        for (auto& chirp : frame.chirp) {
            chirp.fill(static_cast<std::int16_t>(sign > 0 ? -32768 : 32767));
            chirp[17] = static_cast<std::int16_t>(sign > 0 ? 32767 : -32768);
        }
        for (const auto exponent : levels_of(frame).exponent) LONGS_EQUAL(4, exponent);
    }
    for (auto& chirp : frame.chirp) chirp.fill(1234);
    for (const auto exponent : levels_of(frame).exponent) LONGS_EQUAL(-11, exponent);
    frame.chirp[5][7] = 1235;  // deviation 63/64 and -1/64
    LONGS_EQUAL(-11, levels_of(frame).exponent[2]);
}

TEST(DcLevels, ExponentsAreSharedFromTheLargestDown) {
    std::array<std::int16_t, 32> exponent{};
    exponent.fill(-6);
    exponent[3] = 4;
    exponent[4] = 2;
    exponent[5] = 1;
    exponent[6] = -1;
    exponent[7] = -2;
    exponent[8] = -4;
    dsp::share_exponent(exponent);
    for (std::size_t i = 0; i < 32; ++i) {
        constexpr std::array<int, 6> kExpected{4, 4, 1, 1, -2, -2};
        LONGS_EQUAL(i >= 3 && i < 9 ? kExpected[i - 3] : -6, exponent[i]);
    }
}

TEST(DcLevels, ABurstHasItsOwnScaleAndTheOthersShareOne) {
    fill(200);
    for (auto& s : frame.chirp[21]) s = static_cast<std::int16_t>(100 * s);
    for (auto& s : frame.chirp[40]) s = static_cast<std::int16_t>(s / 2);
    for (auto& s : frame.chirp[41]) s = static_cast<std::int16_t>(s / 2);
    const auto exponent = levels_of(frame).exponent;
    for (std::size_t i = 0; i < 32; ++i)
        CHECK(i == 10 ? exponent[i] > exponent[0] + 4 : exponent[i] == exponent[0]);
    for (auto& s : frame.chirp[21]) s = static_cast<std::int16_t>(s / 100);
    const auto calm = levels_of(frame).exponent;
    for (const auto e : calm) LONGS_EQUAL(calm[0], e);
}
