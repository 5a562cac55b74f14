// Expected values: the motion put into the synthetic beat signal; the published reference of the recordings;
// one golden sum that every compiler and board must reproduce.
#include <cmath>
#include <memory>

#include "dsp/detect.hpp"
#include "dsp/sine.hpp"
#include "tests/bench/dsp_reference.hpp"

#include <CppUTest/TestHarness.h>

namespace {

double value(dsp::Real x) {
    return std::ldexp(static_cast<double>(x.raw()), -dsp::Real::fraction_bits);
}

}  // namespace

TEST_GROUP(Detect) {
    std::unique_ptr<dsp::Workspace> workspace = std::make_unique<dsp::Workspace>();
    dsp::DspConfig config;
    dsp::DetectionList list;
    bench::Samples samples = bench::Samples(4096, 0.0);

    void process(const dsp::BeatFrame& frame, const dsp::CellScale& scale = dsp::kDefaultWaveform.scale()) {
        dsp::detect(frame, config, scale, *workspace, list);
    }
};

TEST(Detect, FindsATargetWhereItIs) {
    bench::add_tone(samples, {75.3, -12.4, 200, 1});
    process(bench::convert(samples, 2047));
    LONGS_EQUAL(1, list.count);
    DOUBLES_EQUAL(75.3, value(list.item[0].range_m), 0.02);
    DOUBLES_EQUAL(-12.4, value(list.item[0].range_rate_mps), 0.005);
}

TEST(Detect, ACarAtTheSameSpeedIsSeen) {
    bench::add_tone(samples, {40, 0, 30, 1});
    bench::Random random(3);
    bench::add_noise(samples, 1, random);
    process(bench::convert(samples, 2047));
    CHECK(list.count >= 1);
    DOUBLES_EQUAL(40, value(list.item[0].range_m), 0.05);
    DOUBLES_EQUAL(0, value(list.item[0].range_rate_mps), 0.02);
    LONGS_EQUAL(0, list.item[0].doppler_cell);
}

TEST(Detect, FramesWithoutSignalGiveNothing) {
    dsp::BeatFrame frame;
    for (const int level : {0, 1, -2048, 2047, 32767, -32768}) {
        for (auto& chirp : frame.chirp) chirp.fill(static_cast<std::int16_t>(level));
        process(frame);
        LONGS_EQUAL(0, list.count);
        LONGS_EQUAL(0, list.dropped);
    }
}

TEST(Detect, AnyFrameIsSurvived) {
    dsp::BeatFrame frame;
    bench::Random random(17);
    for (int t = 0; t < 60; ++t) {
        const auto kind = random() % 4;
        for (auto& chirp : frame.chirp) {
            for (auto& s : chirp) {
                const auto bits = static_cast<std::int16_t>(random());
                s = kind == 0   ? bits
                    : kind == 1 ? static_cast<std::int16_t>(bits < 0 ? -32768 : 32767)
                    : kind == 2 ? static_cast<std::int16_t>(random() % 100 == 0 ? bits : 0)
                                : static_cast<std::int16_t>(bits & 1);
            }
        }
        config.range_window = static_cast<dsp::WindowKind>(t % 4);
        config.doppler_window = static_cast<dsp::WindowKind>(t / 4 % 4);
        process(frame);
        CHECK(list.count >= 0 && list.count <= dsp::kMaxDetections && list.dropped >= 0);
        for (const auto& d : list.view()) {
            CHECK(d.range_variance_m2 > dsp::Real(0) && d.rate_variance_m2ps2 > dsp::Real(0));
            CHECK(std::abs(value(d.range_rate_mps)) <= 30.5);
        }
    }
}

TEST(Detect, AChangedConfigurationTakesEffect) {
    bench::Random random(5);
    bench::add_tone(samples, {60, 7, bench::amplitude_for(28, 10), 0});
    bench::add_noise(samples, 10, random);
    const dsp::BeatFrame frame = bench::convert(samples);
    process(frame);
    CHECK(list.count >= 1);
    config.cfar.offset_cdb = 2000;
    process(frame);
    LONGS_EQUAL(0, list.count);
    config.cfar.offset_cdb = 0;
    process(frame);
    CHECK(list.count >= 1);
}

TEST(Detect, TheSameBitsEverywhere) {
    // Integers only, so that the frame itself is the same on every machine.
    std::uint32_t state = 20;
    dsp::BeatFrame frame;
    for (int k = 0; k < 64; ++k) {
        for (int n = 0; n < 64; ++n) {
            std::int64_t sum = 0;
            for (int t = 0; t < 6; ++t) {
                const int turn = (t * 7 + 5) * n * 15 + (t * 11 - 30) * k * 16 + 100 * t;
                sum += std::int64_t{dsp::cosine_q30(turn % 1024, 1024)} * (300 >> t);
            }
            state = state * 1664525U + 1013904223U;
            sum += (static_cast<std::int64_t>(state >> 16) - 32768) * (1 << 17);
            frame.chirp[static_cast<std::size_t>(k)][static_cast<std::size_t>(n)] =
                static_cast<std::int16_t>(sum >> 30);
        }
    }
    process(frame);
    std::uint32_t hash = 2166136261U;
    const auto add = [&hash](std::int64_t v) {
        for (int i = 0; i < 8; ++i) hash = (hash ^ static_cast<std::uint8_t>(v >> (8 * i))) * 16777619U;
    };
    for (const auto& row : workspace->map.cell) {
        for (const auto x : row) add(x);
    }
    add(list.count);
    for (const auto& d : list.view()) {
        for (const dsp::Real x :
             {d.range_m, d.range_rate_mps, d.range_variance_m2, d.rate_variance_m2ps2, d.snr_db}) {
            add(x.raw());
        }
    }
    LONGS_EQUAL(6, list.count);
    UNSIGNED_LONGS_EQUAL(0xf2f2a71fU, hash);
}
