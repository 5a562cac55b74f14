// Expected values: constructed frames; the median by sorting.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <vector>

#include "dsp/frame_quality.hpp"
#include "tests/bench/dsp_reference.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(FrameQuality) {
    dsp::BeatFrame frame;
    dsp::DcLevels levels;  // tested with the removal
    bench::Random random{4};

    dsp::FrameQuality inspect(const dsp::BeatFrame& of, std::int16_t full_scale) {
        return dsp::inspect(of, full_scale, levels);
    }

    void fill_noise(double sigma) {
        bench::Samples samples(4096, 0.0);
        bench::add_noise(samples, sigma, random);
        frame = bench::convert(samples, 2047);
    }
};

TEST(FrameQuality, AHealthyFrame) {
    fill_noise(100);
    const dsp::FrameQuality q = inspect(frame, 2047);
    CHECK_FALSE(q.dead());
    CHECK_FALSE(q.stuck());
    LONGS_EQUAL(0, q.saturated);
    LONGS_EQUAL(0, q.repeated_chirps);
    CHECK(q.min < -250 && q.max > 250);
}

TEST(FrameQuality, ExtremesAndSaturationAgreeWithLooking) {
    for (int trial = 0; trial < 200; ++trial) {
        fill_noise(trial % 2 == 0 ? 10 : 800);
        const auto place = static_cast<std::size_t>(random() % 4096);
        auto& odd_one = frame.chirp[place / 64][place % 64];
        odd_one = static_cast<std::int16_t>(random());
        std::int16_t low = 32767;
        std::int16_t high = -32768;
        long saturated = 0;
        for (const auto& chirp : frame.chirp) {
            for (const auto x : chirp) {
                low = std::min(low, x);
                high = std::max(high, x);
                saturated += x >= 1000 || x <= -1000 ? 1 : 0;
            }
        }
        const dsp::FrameQuality q = inspect(frame, 1000);
        LONGS_EQUAL(low, q.min);
        LONGS_EQUAL(high, q.max);
        LONGS_EQUAL(saturated, q.saturated);
    }
}

TEST(FrameQuality, DeadWhenEverySampleIsEqual) {
    for (auto& chirp : frame.chirp) chirp.fill(-7);
    const dsp::FrameQuality q = inspect(frame, 2047);
    CHECK(q.dead());
    CHECK_FALSE(q.stuck());
    LONGS_EQUAL(-7, q.min);
    frame.chirp[63][63] = -8;
    CHECK_FALSE(inspect(frame, 2047).dead());
}

TEST(FrameQuality, CountsSamplesAtBothEnds) {
    fill_noise(10);
    frame.chirp[0][0] = 2047;
    frame.chirp[9][5] = -2047;
    frame.chirp[63][63] = -2048;
    frame.chirp[7][7] = 2046;
    frame.chirp[8][8] = -2046;
    LONGS_EQUAL(3, inspect(frame, 2047).saturated);
    for (auto& chirp : frame.chirp) chirp.fill(32767);
    LONGS_EQUAL(4096, inspect(frame, 32767).saturated);
}

TEST(FrameQuality, RepeatedChirps) {
    fill_noise(10);
    frame.chirp[12] = frame.chirp[11];
    dsp::FrameQuality q = inspect(frame, 2047);
    LONGS_EQUAL(1, q.repeated_chirps);
    CHECK_FALSE(q.stuck());
    for (auto& chirp : frame.chirp) chirp = frame.chirp[0];
    q = inspect(frame, 2047);
    LONGS_EQUAL(63, q.repeated_chirps);
    CHECK(q.stuck());
}

TEST(FrameQuality, TheHashTellsFramesApart) {
    fill_noise(10);
    const std::uint32_t hash = inspect(frame, 2047).hash;
    const dsp::BeatFrame copy = frame;
    LONGS_EQUAL(hash, inspect(copy, 2047).hash);
    for (int i = 0; i < 4096; i += 13) {
        for (const int bit : {0, 7, 15}) {
            dsp::BeatFrame changed = frame;
            auto& sample = changed.chirp[static_cast<std::size_t>(i / 64)][static_cast<std::size_t>(i % 64)];
            sample = static_cast<std::int16_t>(sample ^ (1 << bit));
            CHECK(inspect(changed, 2047).hash != hash);
        }
    }
    dsp::BeatFrame swapped = frame;
    std::swap(swapped.chirp[3], swapped.chirp[4]);
    CHECK(inspect(swapped, 2047).hash != hash);
}

TEST(FrameQuality, NoiseLevelIsTheMedian) {
    const auto map = std::make_unique<dsp::PowerMap>();
    for (const int first : {0, 2, 8}) {
        for (const double level : {3.0, 9.0, 31.4, 60.0}) {
            std::vector<int> cells;
            for (std::size_t r = 0; r < 32; ++r) {
                for (std::size_t d = 0; d < 64; ++d) {
                    auto& cell = map->cell[r][d];
                    const double u = (static_cast<double>(random() >> 11) + 0.5) * 0x1p-53;
                    cell = static_cast<std::uint16_t>(
                        std::clamp(1024 * (level + std::log2(-std::log(u))), 0.0, 65535.0));
                    if (r >= static_cast<std::size_t>(first) && r % 2 == 0 && d % 2 == 0)
                        cells.push_back(cell);
                }
            }
            std::ranges::sort(cells);
            DOUBLES_EQUAL(cells[cells.size() / 2], dsp::noise_level(*map, first), 40);
        }
    }
}

TEST(FrameQuality, NoiseLevelIgnoresTargetsAndRidges) {
    const auto map = std::make_unique<dsp::PowerMap>();
    for (auto& row : map->cell) {
        row.fill(9000);
        for (std::size_t d = 10; d < 20; ++d) row[d] = 40000;
    }
    DOUBLES_EQUAL(9000, dsp::noise_level(*map, 2), 256);
    for (auto& row : map->cell) row.fill(0);
    DOUBLES_EQUAL(0, dsp::noise_level(*map, 2), 256);
    for (auto& row : map->cell) row.fill(65535);
    DOUBLES_EQUAL(65535, dsp::noise_level(*map, 2), 256);
}
