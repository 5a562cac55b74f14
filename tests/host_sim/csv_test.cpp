#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "host_sim/csv.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(Csv) {
    std::filesystem::path file = std::filesystem::temp_directory_path() / "csv_test.csv";
    void teardown() {
        std::filesystem::remove(file);
    }

    std::string error_of(const std::string& text) {
        std::ofstream(file) << text;
        try {
            const auto rows = sim::read_csv(file, {"time_s", "speed_mps"});
            sim::require_ascending(file, rows, 0, "time_s");
        } catch (const sim::InputError& e) {
            return e.what();
        }
        return "";
    }
};

TEST(Csv, ReadsColumnsByNameInAnyOrderAndSkipsTheOthers) {
    std::ofstream(file) << "speed_mps, note,time_s\r\n1.5\r,x,0\n\n-2e1, ,0.25\r\n";
    const auto rows = sim::read_csv(file, {"time_s", "speed_mps"});
    LONGS_EQUAL(2, rows.size());
    DOUBLES_EQUAL(0, rows[0][0], 0);
    DOUBLES_EQUAL(1.5, rows[0][1], 0);
    DOUBLES_EQUAL(0.25, rows[1][0], 0);
    DOUBLES_EQUAL(-20, rows[1][1], 0);
}

TEST(Csv, NamesFileLineColumnAndReason) {
    STRCMP_CONTAINS("csv_test.csv: is empty", error_of("").c_str());
    STRCMP_CONTAINS("csv_test.csv: no rows", error_of("time_s,speed_mps\n").c_str());
    STRCMP_CONTAINS("csv_test.csv:1: no column named speed_mps", error_of("time_s,v\n1,2\n").c_str());
    STRCMP_CONTAINS("csv_test.csv:3: 1 values, the header has 2",
                    error_of("time_s,speed_mps\n1,2\n3\n").c_str());
    STRCMP_CONTAINS("csv_test.csv:2: speed_mps: not a finite number: \"nan\"",
                    error_of("time_s,speed_mps\n1,nan\n").c_str());
    STRCMP_CONTAINS("not a finite number: \"inf\"", error_of("time_s,speed_mps\ninf,3\n").c_str());
    STRCMP_CONTAINS("not a finite number: \"\"", error_of("time_s,speed_mps\n,3\n").c_str());
    STRCMP_CONTAINS("not a finite number: \"3 m\"", error_of("time_s,speed_mps\n1,3 m\n").c_str());
    STRCMP_CONTAINS("csv_test.csv:2: time_s: is negative", error_of("time_s,speed_mps\n-1,3\n").c_str());
    STRCMP_CONTAINS("csv_test.csv:3: time_s: is less", error_of("time_s,speed_mps\n1,3\n0.5,3\n").c_str());
    STRCMP_EQUAL("", error_of("time_s,speed_mps\n1,3\n1,3\n").c_str());
}

TEST(Csv, AMissingFileIsNamed) {
    file = "/nowhere/motion.csv";
    try {
        (void)sim::read_csv(file, {"time_s"});
        FAIL("read a file that is not there");
    } catch (const sim::InputError& e) {
        STRCMP_CONTAINS("/nowhere/motion.csv: cannot be read", e.what());
    }
}
