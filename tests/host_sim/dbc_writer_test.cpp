// The committed file against the table it is made from. Its content is checked by tests/can/dbc_test.cpp.
#include <fstream>
#include <sstream>
#include <string>

#include "host_sim/dbc_writer.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(DbcWriter){};

TEST(DbcWriter, CommittedFileIsTheGeneratedOne) {
    std::ifstream file(RADAR_SOURCE_DIR "/can/radar.dbc", std::ios::binary);
    std::stringstream committed;
    committed << file.rdbuf();
    CHECK_TEXT(committed.str() == sim::dbc_text(),
               "radar_monitor --write-dbc can/radar.dbc, and look at the difference");
}

TEST(DbcWriter, NumbersAreExactDecimals) {
    const std::string text = sim::dbc_text();
    for (const char* line : {" SG_ Range : 32|16@1+ (0.005,0) [0|327.675] \"m\" Ecu\n",
                             " SG_ RangeRate : 48|16@1- (0.005,0) [-163.84|163.835] \"m/s\" Ecu\n",
                             " SG_ Snr : 40|8@1+ (0.5,0) [0|127.5] \"dB\" Ecu\n",
                             " SG_ Value : 24|32@1- (1,0) [-2147483648|2147483647] \"\" Radar\n"})
        STRCMP_CONTAINS(line, text.c_str());
}
