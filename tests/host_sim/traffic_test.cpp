#include <filesystem>
#include <fstream>
#include <vector>

#include "host_sim/csv.hpp"
#include "host_sim/traffic.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(Traffic) {
    std::filesystem::path file = std::filesystem::temp_directory_path() / "traffic_test.csv";
    void teardown() {
        std::filesystem::remove(file);
    }
};

TEST(Traffic, InterpolatesAnObjectAndSplitsItWhereTheIdIsReused) {
    std::ofstream(file) << "time_s,track_id,range_m,range_rate_mps,lateral_m\n"
                           "0.00,4,50,-2,0\n0.00,7,10,1,0\n0.05,4,49.9,-4,0\n0.05,7,10.05,1,0\n"
                           "0.10,4,80,3,0\n"                       // jumps by 30 m: another object
                           "0.50,7,10.5,1,0\n0.55,7,10.55,1,0\n";  // after a pause: another object
    const auto objects = sim::read_traffic(file);
    LONGS_EQUAL(4, objects.size());
    LONGS_EQUAL(4, objects[0].track_id);
    const auto middle = objects[0].at(0.025);
    CHECK(middle.has_value());
    DOUBLES_EQUAL(49.95, middle->range_m, 1e-12);
    DOUBLES_EQUAL(-3, middle->range_rate_mps, 1e-12);
    DOUBLES_EQUAL(50, objects[0].at(0)->range_m, 0);
    CHECK(!objects[0].at(0.06));
    CHECK(!objects[3].at(0.49));
    DOUBLES_EQUAL(10.55, objects[3].at(0.55)->range_m, 0);
}

TEST(Traffic, EgoSpeedIsLinearBetweenSamplesAndConstantOutside) {
    std::ofstream(file) << "time_s,speed_mps\n1,10\n2,20\n";
    const auto samples = sim::read_ego_speed(file);
    DOUBLES_EQUAL(10, sim::speed_at(samples, 0), 0);
    DOUBLES_EQUAL(12.5, sim::speed_at(samples, 1.25), 1e-12);
    DOUBLES_EQUAL(20, sim::speed_at(samples, 9), 0);
}

TEST(Traffic, RefusesNegativeTimesAndRanges) {
    const auto refuses = [&](const char* text) {
        std::ofstream(file) << "time_s,track_id,range_m,range_rate_mps\n" << text;
        try {
            (void)sim::read_traffic(file);
        } catch (const sim::InputError&) {
            return true;
        }
        return false;
    };
    CHECK(refuses("-1,0,10,0\n"));
    CHECK(refuses("1,0,10,0\n0.9,0,10,0\n"));
    CHECK(refuses("1,0,-10,0\n"));
    CHECK(refuses("1,0,nan,0\n"));
    CHECK(!refuses("1,0,10,0\n"));
}
