// Expected: PD and clutter of the 2020 paper.
#include <cmath>
#include <cstdint>

#include "host_sim/study_lowsnr.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(StudyLowSnr){};

TEST(StudyLowSnr, SceneOfThe2020Paper) {
    double detected = 0;
    double clutter = 0;
    constexpr int kRuns = 100;
    for (std::uint64_t run = 0; run < kRuns; ++run) {
        for (const auto& frame : sim::simulate_low_snr(13, 1, 9, run)) {
            for (const auto& m : frame.measurements) {
                // Targets come first and within 120 m of the truth; clutter anywhere is counted by the rest.
                CHECK(m.amplitude > -std::log(0.01));
            }
            std::size_t mine = 0;
            for (const auto& x : frame.truth) {
                if (mine < frame.measurements.size() &&
                    (frame.measurements[mine].z - x.head<2>()).norm() < 110)
                    ++mine;
            }
            detected += static_cast<double>(mine);
            clutter += static_cast<double>(frame.measurements.size() - mine);
        }
    }
    // PD = exp(-ln 100 / (1 + 10^1.3)) = .8027; 25 false alarms a frame. 3 sigma each, and the odd neighbour
    // taken.
    DOUBLES_EQUAL(0.8027, detected / kRuns / sim::kLowSnrFrames / 5, 0.02);
    DOUBLES_EQUAL(25, clutter / kRuns / sim::kLowSnrFrames, 0.4);
    const auto a = sim::simulate_low_snr(13, 1, 9, 3);
    const auto b = sim::simulate_low_snr(13, 1, 9, 3);
    CHECK(a.back().measurements.back().z == b.back().measurements.back().z);
}
