// Expected values: the motion put into the synthetic beat signal.
#include <cmath>
#include <numbers>

#include "dsp/detect.hpp"

#include <CppUTest/TestHarness.h>

namespace {

double metres(dsp::Real x) {
    return static_cast<double>(x.raw()) / (1 << dsp::Real::fraction_bits);
}

}  // namespace

TEST_GROUP(Detect) {
    dsp::BeatFrame frame;
    dsp::DspConfig config;
    dsp::Workspace workspace;
    dsp::DetectionList detections;

    void add_target(double range_m, double rate_mps, double amplitude) {
        const dsp::Waveform wave;
        const double start_hz = static_cast<double>(wave.carrier_hz - wave.bandwidth_hz / 2);
        const double slope =
            static_cast<double>(wave.bandwidth_hz) / (static_cast<double>(wave.sampled_ns()) * 1e-9);
        for (std::size_t k = 0; k < dsp::kChirps; ++k) {
            for (std::size_t n = 0; n < dsp::kSamples; ++n) {
                const double t = static_cast<double>(n) / static_cast<double>(wave.sample_rate_hz);
                const double now =
                    static_cast<double>(k) * static_cast<double>(wave.chirp_interval_ns) * 1e-9 + t;
                const double delay = 2 * (range_m + rate_mps * (now - 1.024e-3)) / 299792458.0;
                const double phase = 2 * std::numbers::pi * delay * (start_hz + slope * t);
                frame.chirp[k][n] =
                    static_cast<std::int16_t>(frame.chirp[k][n] + std::lround(amplitude * std::cos(phase)));
            }
        }
    }
};

TEST(Detect, FindsATargetWhereItIs) {
    add_target(75.3, -12.4, 200);
    dsp::detect(frame, config, dsp::kDefaultWaveform.scale(), workspace, detections);
    LONGS_EQUAL(1, detections.count);
    DOUBLES_EQUAL(75.3, metres(detections.item[0].range_m), 0.05);
    DOUBLES_EQUAL(-12.4, metres(detections.item[0].range_rate_mps), 0.01);
}

TEST(Detect, AFrameWithoutSignalGivesNothing) {
    dsp::detect(frame, config, dsp::kDefaultWaveform.scale(), workspace, detections);
    LONGS_EQUAL(0, detections.count);
    LONGS_EQUAL(0, detections.dropped);
}
