// Expected values: the scene as described, and what detection of 12-sigma points must reach.
#include <algorithm>
#include <cmath>
#include <vector>

#include "host_sim/infrared_scene.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(InfraredScene){};

TEST(InfraredScene, FormationsCrossInFrames13To15) {
    LONGS_EQUAL(0, sim::infrared_targets(5).size());
    LONGS_EQUAL(14, sim::infrared_targets(6).size());
    const auto gap = [](int frame) {  // leading target of the left one to that of the right one
        double right = 0;
        double left = 0;
        for (const auto& t : sim::infrared_targets(frame)) {
            if (t.id == 4) right = t.position[0];
            if (t.id == 11) left = t.position[0];
        }
        return left - right;
    };
    DOUBLES_EQUAL(320, gap(6), 1e-9);
    DOUBLES_EQUAL(0, gap(14), 1e-9);
    CHECK(gap(13) > 0 && gap(15) < 0);
}

TEST(InfraredScene, DetectsTheTargetsAndLittleElse) {
    int targets = 0;
    int found = 0;
    int others = 0;
    double square = 0;
    constexpr int kImages = 6;
    for (int i = 0; i < kImages; ++i) {
        const int frame = 7 + i;  // the formations are apart
        const auto detections = sim::detect_points(sim::infrared_image(1, 3, frame));
        others += static_cast<int>(detections.size());
        for (const auto& t : sim::infrared_targets(frame)) {
            ++targets;
            for (const auto& d : detections) {
                const double e = (d.z - t.position).norm();
                if (e > 2) continue;
                ++found;
                --others;
                square += e * e;
                break;
            }
        }
    }
    CHECK(found >= targets - 2);
    CHECK(std::sqrt(square / found) < 0.2);
    // Flashes and noise, Poisson: within 4 sigma.
    const double expected = kImages * (sim::kFlashes + sim::kNoiseAlarms);
    CHECK(std::abs(others - expected) < 4 * std::sqrt(expected));
}

TEST(InfraredScene, EmptyImageHasNoTargets) {
    const std::vector<float> flat(static_cast<std::size_t>(sim::kImageWidth) * sim::kImageHeight, 100.0F);
    LONGS_EQUAL(0, sim::detect_points(flat).size());
}
