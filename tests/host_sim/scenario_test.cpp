// Bad input by the error it must name; motion against integrals worked by hand.
#include <filesystem>
#include <fstream>
#include <string>

#include <nlohmann/json.hpp>

#include "host_sim/scenario.hpp"

#include <CppUTest/TestHarness.h>

namespace {

const char* const kGood = R"({
  "description": "one vehicle", "duration_s": 10,
  "waveform": {"period_ms": 50}, "front_end": {"adc_bits": 14, "noise_lsb": 2.5},
  "ego": {"speed_mps": 20, "acceleration_mps2": [[1, -2], [3, 0]]},
  "targets": [{"name": "a", "range_m": 50, "speed_mps": 10, "rcs_dbsm": 3, "fluctuation": "swerling1", "end_s": 8}],
  "guard_rail": {"spacing_m": 20}, "road": {}, "interference": [{"amplitude_lsb": 5}],
  "false_echoes": {"per_frame": 3}
})";

std::string error_of(const nlohmann::json& json) {
    try {
        (void)sim::parse_scenario(json, "test.json");
    } catch (const sim::InputError& e) {
        return e.what();
    }
    return "";
}

std::string error_after(const std::string& pointer, const nlohmann::json& value) {
    auto json = nlohmann::json::parse(kGood);
    json[nlohmann::json::json_pointer(pointer)] = value;
    return error_of(json);
}

std::string error_without(const char* key) {
    auto json = nlohmann::json::parse(kGood);
    json.erase(key);
    return error_of(json);
}

void check_names(const std::string& error, const char* field, const char* reason) {
    STRCMP_CONTAINS("test.json", error.c_str());
    STRCMP_CONTAINS(field, error.c_str());
    STRCMP_CONTAINS(reason, error.c_str());
}

}  // namespace

TEST_GROUP(Scenario){};

TEST(Scenario, ReadsEveryField) {
    const auto s = sim::parse_scenario(nlohmann::json::parse(kGood), "test.json");
    DOUBLES_EQUAL(10, s.duration_s, 0);
    LONGS_EQUAL(50, s.waveform.period_ms);
    LONGS_EQUAL(77, s.waveform.carrier_hz / 1'000'000'000);
    LONGS_EQUAL(14, s.front_end.adc_bits);
    DOUBLES_EQUAL(2.5, s.front_end.noise_lsb, 0);
    LONGS_EQUAL(1, s.targets.size());
    STRCMP_EQUAL("a", s.targets[0].name.c_str());
    DOUBLES_EQUAL(50, s.targets[0].range_m, 0);
    DOUBLES_EQUAL(8, s.targets[0].end_s, 0);
    DOUBLES_EQUAL(3, s.targets[0].rcs_dbsm, 0);
    CHECK(s.targets[0].fluctuation == sim::Fluctuation::swerling1);
    DOUBLES_EQUAL(20, s.guard_rail->spacing_m, 0);
    CHECK(s.road.has_value());
    DOUBLES_EQUAL(5, s.interference[0].amplitude_lsb, 0);
    DOUBLES_EQUAL(10, s.interference[0].end_s, 0);
    DOUBLES_EQUAL(3, s.false_echoes.per_frame, 0);
}

TEST(Scenario, NamesMissingFields) {
    check_names(error_without("description"), "description", "missing");
    check_names(error_without("duration_s"), "duration_s", "missing");
    check_names(error_without("ego"), "ego", "missing");
    check_names(error_after("/targets/0", nlohmann::json::parse(R"({"range_m": 5})")),
                "targets[0]: speed_mps", "missing");
    check_names(error_after("/false_echoes", nlohmann::json::object()), "false_echoes: per_frame", "missing");
}

TEST(Scenario, NamesFieldsOfTheWrongType) {
    check_names(error_after("/duration_s", "ten"), "duration_s", "wrong type: must be a number, is string");
    check_names(error_after("/description", 3), "description", "wrong type: must be a string, is number");
    check_names(error_after("/targets", 3), "targets", "wrong type: must be an array");
    check_names(error_after("/targets/0", 3), "targets[0]", "wrong type: must be an object");
    check_names(error_after("/ego/acceleration_mps2/0", 3), "acceleration_mps2[0]", "array of two numbers");
    check_names(error_after("/waveform/period_ms", 50.5), "waveform: period_ms", "whole number");
    check_names(error_of(nlohmann::json::array()), "test.json", "must be an object");
}

TEST(Scenario, NamesValuesOutOfRange) {
    check_names(error_after("/duration_s", -1), "duration_s",
                "out of range: -1 is not within 0.1 .. 86400 s");
    check_names(error_after("/targets/0/rcs_dbsm", 300), "targets[0]: rcs_dbsm", "out of range");
    check_names(error_after("/targets/0/end_s", 0), "targets[0]: end_s", "later than start_s");
    check_names(error_after("/front_end/adc_bits", 40), "front_end: adc_bits", "out of range");
    check_names(error_after("/ego/acceleration_mps2/1/0", 0.5), "acceleration_mps2", "ascend");
    check_names(error_after("/interference/0/chirp_share", 2), "interference[0]: chirp_share",
                "out of range");
    check_names(error_after("/waveform/chirp_interval_ns", 20000), "chirp_interval_ns",
                "shorter than the 64 samples");
    check_names(error_after("/waveform/chirp_interval_ns", 1000000), "period_ms", "shorter than 64 chirps");
    check_names(error_after("/waveform/bandwidth_hz", 1000000), "bandwidth_hz", "too small");
    check_names(error_after("/targets/0/fluctuation", "swerling3"), "fluctuation", "known: none, swerling1");
}

TEST(Scenario, RefusesFieldsItDoesNotKnow) {
    check_names(error_after("/durations", 3), "durations", "unknown field; known here: description");
    check_names(error_after("/targets/0/speed", 3), "targets[0]: speed", "unknown field");
    check_names(error_after("/waveform/band", 3), "waveform: band", "unknown field");
}

TEST(Scenario, NamesFilesItCannotUse) {
    const auto file = std::filesystem::temp_directory_path() / "scenario_test_broken.json";
    std::ofstream(file) << "{ \"description\": ";
    const auto error_loading = [](const std::string& name) -> std::string {
        try {
            (void)sim::load_scenario(name);
        } catch (const sim::InputError& e) {
            return e.what();
        }
        return "";
    };
    STRCMP_CONTAINS("not JSON", error_loading(file.string()).c_str());
    std::filesystem::remove(file);
    STRCMP_CONTAINS("cannot be read", error_loading("/nowhere/at-all.json").c_str());
    STRCMP_CONTAINS("no scenario named \"rush-hour\"; shipped: approach, crossing",
                    error_loading("rush-hour").c_str());
}

TEST(Scenario, ShipsTheNineScenariosAndAllCanBeRead) {
    const char* const names[] = {"approach", "crossing",     "cut-in",        "empty",      "four-targets",
                                 "highway",  "interference", "over-capacity", "stop-and-go"};
    const auto shipped = sim::shipped_scenarios();
    LONGS_EQUAL(9, shipped.size());
    for (std::size_t i = 0; i < shipped.size(); ++i) {
        STRCMP_EQUAL(names[i], shipped[i].c_str());
        const auto s = sim::load_scenario(shipped[i]);
        STRCMP_EQUAL(names[i], s.name.c_str());
        CHECK(s.description.size() > 20 && s.description.find('\n') == std::string::npos);
    }
}

TEST(Scenario, MotionIntegratesPiecewiseConstantAcceleration) {
    // 20 m/s, from 1 s to 3 s -2 m/s^2: 16 m/s; covers 20 + 36 + 16 m in 4 s.
    const sim::Motion m{0, 20, {{1, -2}, {3, 0}}};
    DOUBLES_EQUAL(20, m.speed_at(1), 1e-12);
    DOUBLES_EQUAL(18, m.speed_at(2), 1e-12);
    DOUBLES_EQUAL(16, m.speed_at(4), 1e-12);
    DOUBLES_EQUAL(20, m.distance_at(1), 1e-12);
    DOUBLES_EQUAL(56, m.distance_at(3), 1e-12);
    DOUBLES_EQUAL(72, m.distance_at(4), 1e-12);
    DOUBLES_EQUAL(-2, m.acceleration_at(2), 0);
    // A start in the middle of a piece: only what follows counts.
    const sim::Motion late{2, 10, {{1, -2}, {3, 0}}};
    DOUBLES_EQUAL(8, late.speed_at(4), 1e-12);
    DOUBLES_EQUAL(9 + 8, late.distance_at(4), 1e-12);
}
