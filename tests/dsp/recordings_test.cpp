// Frames of a real 77 GHz radar (OpenRadar, see the data's README beside the source tree): a person walking
// towards it. Expected values: the reference made in double precision from the original complex samples.
#include <cmath>
#include <cstdio>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "dsp/detect.hpp"

#include <CppUTest/TestHarness.h>

namespace {

double value(dsp::Real x) {
    return std::ldexp(static_cast<double>(x.raw()), -dsp::Real::fraction_bits);
}

/// Beside the source tree, see the data's own README there.
std::string recordings() {
    return std::string(RADAR_SOURCE_DIR) + "/../shared/data/openradar_77ghz/";
}

struct Reference {
    double range_cell;    ///< of a 64-point range transform
    double doppler_cell;  ///< -32..32
};

/// The strongest moving maximum of each frame of a file.
std::vector<Reference> read_reference(const std::string& file) {
    std::vector<Reference> references;
    std::ifstream csv(recordings() + "reference.csv");
    for (std::string line; std::getline(csv, line);) {
        std::vector<std::string> fields;
        std::stringstream stream(line);
        for (std::string field; std::getline(stream, field, ',');) fields.push_back(field);
        if (fields.size() < 9 || fields[0] != file || fields[3] != "0") continue;
        references.push_back({std::stod(fields[8]), std::stod(fields[5])});
    }
    return references;
}

}  // namespace

TEST_GROUP(Recordings){};

TEST(Recordings, TheWalkingPersonIsDetected) {
    const auto workspace = std::make_unique<dsp::Workspace>();
    dsp::DspConfig config;
    dsp::DetectionList list;
    dsp::Waveform wave;
    wave.carrier_hz = 78'956'000'000;
    wave.bandwidth_hz = 3'072'000'000;
    wave.sample_rate_hz = 1'250'000;
    wave.chirp_interval_ns = 184'000;
    wave.range_offset_um = 1'171'064;
    CHECK(wave.valid());
    const dsp::CellScale scale = wave.scale();
    config.adc_full_scale = 32767;
    for (const std::string file : {"simple_gate64_slide.bin", "simple_gate64.bin"}) {
        std::ifstream in(recordings() + file, std::ios::binary);
        if (!in) {
            std::printf("SKIPPED: no %s\n", (recordings() + file).c_str());
            return;
        }
        const auto references = read_reference(file);
        std::size_t near = 0;
        std::size_t frames = 0;
        for (dsp::BeatFrame frame; in.read(reinterpret_cast<char*>(&frame), sizeof frame); ++frames) {
            dsp::detect(frame, config, scale, *workspace, list);
            CHECK(frames < references.size());
            CHECK(list.count <= 16);
            for (const auto& d : list.view()) {
                const double apparent = value(d.range_m) + value(scale.coupling_s) * value(d.range_rate_mps);
                const double range = (apparent - value(scale.range_offset_m)) / value(scale.range_cell_m);
                const double doppler = value(d.range_rate_mps) / value(scale.rate_cell_mps);
                if (std::abs(range - references[frames].range_cell) <= 1 &&
                    std::abs(doppler - references[frames].doppler_cell) <= 1) {
                    ++near;
                    break;
                }
            }
        }
        LONGS_EQUAL(references.size(), frames);
        CHECK(10 * near >= 9 * frames);
    }
}
