// The committed DBC, read by a small reader of its own, against the codec, bit by bit. Nothing here knows
// can/signals.hpp: expected counts come from the DBC's start bit, length, factor and offset alone.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <functional>
#include <map>
#include <random>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "can/codec.hpp"
#include "can/e2e.hpp"
#include "can/receiver.hpp"
#include "can/transmitter.hpp"

#include <CppUTest/TestHarness.h>

namespace {

struct DbcSignal {
    std::string name, unit, receivers;
    unsigned start = 0, length = 0;
    bool intel = false, is_signed = false;
    double factor = 0, offset = 0, min = 0, max = 0;
    std::map<long, std::string> values = {};
    std::string comment = {};

    std::int64_t extract(const can::Frame& frame) const {
        std::int64_t count = 0;
        for (unsigned bit = 0; bit < length; ++bit)
            if ((frame.data[(start + bit) / 8] >> ((start + bit) % 8) & 1) != 0)
                count += std::int64_t{1} << bit;
        if (is_signed && count >= std::int64_t{1} << (length - 1)) count -= std::int64_t{1} << length;
        return count;
    }

    void insert(can::Frame& frame, std::int64_t count) const {
        for (unsigned bit = 0; bit < length; ++bit) {
            const auto mask = static_cast<std::uint8_t>(1u << ((start + bit) % 8));
            std::uint8_t& byte = frame.data[(start + bit) / 8];
            const bool set = ((count >> bit) & 1) != 0;
            byte = static_cast<std::uint8_t>(set ? byte | mask : byte & ~mask);
        }
    }

    double physical(std::int64_t count) const { return static_cast<double>(count) * factor + offset; }
};

struct DbcMessage {
    unsigned id = 0;
    std::string name, sender;
    unsigned length = 0;
    std::string comment = {};
    std::map<std::string, DbcSignal> signals = {};
    std::map<std::string, long> attributes = {};
};

struct Dbc {
    std::map<unsigned, DbcMessage> messages;
    std::set<std::string> nodes;
};

Dbc read_dbc() {
    std::ifstream file(RADAR_SOURCE_DIR "/can/radar.dbc");
    Dbc dbc;
    DbcMessage* message = nullptr;
    const std::regex bo(R"(BO_ (\d+) (\w+): (\d+) (\w+))");
    const std::regex sg(
        R"re( SG_ (\w+) : (\d+)\|(\d+)@([01])([+-]) \(([^,]+),([^)]+)\) \[([^|]+)\|([^\]]+)\] "([^"]*)" ([\w,]+))re");
    const std::regex ba(R"re(BA_ "(\w+)" BO_ (\d+) (-?\d+);)re");
    const std::regex val(R"(VAL_ (\d+) (\w+) (.*) ;)");
    const std::regex pair(R"re((-?\d+) "([^"]*)")re");
    const std::regex cm_signal(R"re(CM_ SG_ (\d+) (\w+) "([^"]*)";)re");
    const std::regex cm_message(R"re(CM_ BO_ (\d+) "([^"]*)";)re");
    for (std::string line; std::getline(file, line);) {
        std::smatch m;
        if (line.starts_with("BU_:")) {
            std::istringstream names(line.substr(4));
            for (std::string name; names >> name;) dbc.nodes.insert(name);
        } else if (std::regex_match(line, m, bo)) {
            const auto id = static_cast<unsigned>(std::stoul(m[1]));
            message = &dbc.messages[id];
            *message = {
                .id = id, .name = m[2], .sender = m[4], .length = static_cast<unsigned>(std::stoul(m[3]))};
        } else if (std::regex_match(line, m, sg)) {
            message->signals[m[1]] = {.name = m[1],
                                      .unit = m[10],
                                      .receivers = m[11],
                                      .start = static_cast<unsigned>(std::stoul(m[2])),
                                      .length = static_cast<unsigned>(std::stoul(m[3])),
                                      .intel = m[4] == "1",
                                      .is_signed = m[5] == "-",
                                      .factor = std::stod(m[6]),
                                      .offset = std::stod(m[7]),
                                      .min = std::stod(m[8]),
                                      .max = std::stod(m[9])};
        } else if (std::regex_match(line, m, ba)) {
            dbc.messages.at(static_cast<unsigned>(std::stoul(m[2]))).attributes[m[1]] = std::stol(m[3]);
        } else if (std::regex_match(line, m, val)) {
            DbcSignal& signal = dbc.messages.at(static_cast<unsigned>(std::stoul(m[1]))).signals.at(m[2]);
            const std::string list = m[3];
            for (std::sregex_iterator it(list.begin(), list.end(), pair), end; it != end; ++it)
                signal.values[std::stol((*it)[1])] = (*it)[2];
        } else if (std::regex_match(line, m, cm_signal)) {
            dbc.messages.at(static_cast<unsigned>(std::stoul(m[1]))).signals.at(m[2]).comment = m[3];
        } else if (std::regex_match(line, m, cm_message)) {
            dbc.messages.at(static_cast<unsigned>(std::stoul(m[1]))).comment = m[2];
        }
    }
    return dbc;
}

/// All messages at once, so that one table of members serves them all.
struct Everything {
    can::Status status;
    can::Version version;
    can::CollisionWarning warning{.valid = true, .time_to_collision_ms = 0};
    can::CommandEcho echo;
    can::ObjectListHeader header;
    can::Object object;
    can::EgoMotion ego{.valid = true};
    can::Command command;
};

/// One struct member: what one unit of the DBC is in the member's unit, and how to reach it.
struct Member {
    double per_unit;
    std::function<void(Everything&, std::int64_t)> set;
    std::function<std::int64_t(const Everything&)> get;
};

template <class Struct, class T>
Member member(Struct Everything::*part, T Struct::*field, double per_unit = 1) {
    return {per_unit,
            [=](Everything& all, std::int64_t value) { (all.*part).*field = static_cast<T>(value); },
            [=](const Everything& all) { return static_cast<std::int64_t>((all.*part).*field); }};
}

using Members = std::map<std::string, Member>;

/// A message of the codec: its members by the DBC's names, and its two functions.
struct Binding {
    Members members;
    std::function<can::Frame(const Everything&)> encode;
    std::function<bool(const can::Frame&, Everything&)> decode;
};

template <class Struct>
Binding binding(Struct Everything::*part, Members members) {
    return {std::move(members), [=](const Everything& all) { return can::encode(all.*part).frame; },
            [=](const can::Frame& frame, Everything& all) { return can::decode(frame, all.*part); }};
}

Binding object_binding(unsigned index, can::Encoded (*encode)(const can::Object&), Members members) {
    return {std::move(members),
            [=](const Everything& all) {
                can::Object object = all.object;
                object.index = static_cast<std::uint8_t>(index);
                return encode(object).frame;
            },
            [=](const can::Frame& frame, Everything& all) {
                return can::decode(frame, all.object) && all.object.index == index;
            }};
}

Binding bind(unsigned id) {
    using E = Everything;
    switch (id) {
        case 0x400:
            return binding(&E::status, {{"Cycle", member(&E::status, &can::Status::cycle)},
                                        {"Mode", member(&E::status, &can::Status::mode)},
                                        {"Faults", member(&E::status, &can::Status::faults)},
                                        {"Detections", member(&E::status, &can::Status::detections)},
                                        {"Overruns", member(&E::status, &can::Status::overruns)}});
        case 0x401:
            return binding(&E::version, {{"Protocol", member(&E::version, &can::Version::protocol)},
                                         {"Major", member(&E::version, &can::Version::major)},
                                         {"Minor", member(&E::version, &can::Version::minor)},
                                         {"Patch", member(&E::version, &can::Version::patch)},
                                         {"WaveformId", member(&E::version, &can::Version::waveform_id)}});
        case 0x402:
            return binding(
                &E::warning,
                {{"Cycle", member(&E::warning, &can::CollisionWarning::cycle)},
                 {"Level", member(&E::warning, &can::CollisionWarning::level)},
                 {"Valid", member(&E::warning, &can::CollisionWarning::valid)},
                 {"TrackId", member(&E::warning, &can::CollisionWarning::track_id)},
                 {"TimeToCollision",
                  {1000,
                   [](E& all, std::int64_t v) {
                       all.warning.time_to_collision_ms = static_cast<std::int32_t>(v);
                   },
                   [](const E& all) { return std::int64_t{all.warning.time_to_collision_ms.value_or(-1)}; }}},
                 {"RequiredDeceleration",
                  member(&E::warning, &can::CollisionWarning::required_deceleration_mmps2, 1000)}});
        case 0x403:
            return binding(&E::echo, {{"Code", member(&E::echo, &can::CommandEcho::code)},
                                      {"Sequence", member(&E::echo, &can::CommandEcho::sequence)},
                                      {"Result", member(&E::echo, &can::CommandEcho::result)},
                                      {"ValueInForce", member(&E::echo, &can::CommandEcho::value)}});
        case 0x410:
            return binding(&E::header, {{"Cycle", member(&E::header, &can::ObjectListHeader::cycle)},
                                        {"Valid", member(&E::header, &can::ObjectListHeader::valid)},
                                        {"Overflow", member(&E::header, &can::ObjectListHeader::overflow)},
                                        {"Count", member(&E::header, &can::ObjectListHeader::count)}});
        case 0x431:
            return binding(&E::ego,
                           {{"Valid", member(&E::ego, &can::EgoMotion::valid)},
                            {"Speed", member(&E::ego, &can::EgoMotion::speed_mmps, 1000)},
                            {"Acceleration", member(&E::ego, &can::EgoMotion::acceleration_mmps2, 1000)}});
        case 0x432:
            return binding(&E::command, {{"Code", member(&E::command, &can::Command::code)},
                                         {"Sequence", member(&E::command, &can::Command::sequence)},
                                         {"Value", member(&E::command, &can::Command::value)}});
        default:
            break;
    }
    if (id >= 0x411 && id <= 0x420) {
        return object_binding(id - 0x411, can::encode_kinematics,
                              {{"Cycle", member(&E::object, &can::Object::cycle)},
                               {"Motion", member(&E::object, &can::Object::motion)},
                               {"Coasting", member(&E::object, &can::Object::coasting)},
                               {"TrackId", member(&E::object, &can::Object::track_id)},
                               {"Range", member(&E::object, &can::Object::range_mm, 1000)},
                               {"RangeRate", member(&E::object, &can::Object::range_rate_mmps, 1000)}});
    }
    return object_binding(id - 0x421, can::encode_quality,
                          {{"Cycle", member(&E::object, &can::Object::cycle)},
                           {"RangeSigma", member(&E::object, &can::Object::range_sigma_mm, 1000)},
                           {"RangeRateSigma", member(&E::object, &can::Object::range_rate_sigma_mmps, 1000)},
                           {"Snr", member(&E::object, &can::Object::snr_cdb, 100)},
                           {"Existence", member(&E::object, &can::Object::existence_percent)},
                           {"Age", member(&E::object, &can::Object::age_cycles)}});
}

bool is_protection(const DbcSignal& signal) {
    return signal.name == "Crc" || signal.name == "Counter";
}

/// Valid = 0 makes every other signal of its message "not available"; tested with the codec.
bool is_validity(const DbcSignal& signal) {
    return signal.name == "Valid";
}

}  // namespace

TEST_GROUP(Dbc) {
    Dbc dbc = read_dbc();
    std::mt19937_64 random{1};

    std::int64_t random_count(const DbcSignal& signal) {
        const std::int64_t low = std::llround(signal.min / signal.factor);
        const std::int64_t high = std::llround(signal.max / signal.factor);
        return std::uniform_int_distribution<std::int64_t>(low, high)(random);
    }
};

TEST(Dbc, HasEveryMessageOfTheBus) {
    std::set<unsigned> expected = {0x400, 0x401, 0x402, 0x403, 0x410, 0x431, 0x432};
    for (unsigned id = 0x411; id <= 0x430; ++id) expected.insert(id);
    std::set<unsigned> found;
    for (const auto& [id, message] : dbc.messages) found.insert(id);
    CHECK(expected == found);
    CHECK((std::set<std::string>{"Radar", "Ecu", "Driver"} == dbc.nodes));
}

TEST(Dbc, EveryMessageAndSignalIsDescribed) {
    for (const auto& [id, message] : dbc.messages) {
        CHECK(!message.comment.empty());
        CHECK(dbc.nodes.contains(message.sender));
        LONGS_EQUAL(id, message.attributes.at("E2EDataId"));
        for (const auto& [name, signal] : message.signals) {
            CHECK_TEXT(!signal.comment.empty(), name.c_str());
            CHECK(signal.intel);
            CHECK(signal.min <= signal.max);
            std::istringstream receivers(signal.receivers);
            for (std::string node; std::getline(receivers, node, ',');) CHECK(dbc.nodes.contains(node));
        }
    }
    LONGS_EQUAL(100, dbc.messages.at(0x400).attributes.at("GenMsgCycleTime"));
    LONGS_EQUAL(1000, dbc.messages.at(0x401).attributes.at("GenMsgCycleTime"));
    LONGS_EQUAL(100, dbc.messages.at(0x431).attributes.at("GenMsgCycleTime"));
    STRCMP_EQUAL("Radar", dbc.messages.at(0x410).sender.c_str());
    STRCMP_EQUAL("Ecu", dbc.messages.at(0x431).sender.c_str());
}

TEST(Dbc, ValueTablesNameTheEnumerators) {
    const auto& levels = dbc.messages.at(0x402).signals.at("Level").values;
    STRCMP_EQUAL("Brake", levels.at(static_cast<long>(can::WarningLevel::brake)).c_str());
    STRCMP_EQUAL("NotAvailable", levels.at(7).c_str());
    const auto& modes = dbc.messages.at(0x400).signals.at("Mode").values;
    STRCMP_EQUAL("Failed", modes.at(static_cast<long>(can::Mode::failed)).c_str());
    LONGS_EQUAL(4, modes.size());
    const auto& motions = dbc.messages.at(0x420).signals.at("Motion").values;
    STRCMP_EQUAL("Stopped", motions.at(static_cast<long>(can::Motion::stopped)).c_str());
    const auto& codes = dbc.messages.at(0x432).signals.at("Code").values;
    STRCMP_EQUAL("Restart", codes.at(static_cast<long>(can::CommandCode::restart)).c_str());
    const auto& results = dbc.messages.at(0x403).signals.at("Result").values;
    STRCMP_EQUAL("NotSupported", results.at(static_cast<long>(can::CommandResult::not_supported)).c_str());
    const auto& faults = dbc.messages.at(0x400).signals.at("Faults").values;
    LONGS_EQUAL(12, faults.size());
    STRCMP_EQUAL("EgoStale", faults.at(static_cast<long>(can::Fault::ego_stale)).c_str());
    STRCMP_EQUAL("Internal", faults.at(static_cast<long>(can::Fault::internal)).c_str());
}

TEST(Dbc, EverySignalIsAMemberAndBack) {
    for (const auto& [id, message] : dbc.messages) {
        const Binding codec = bind(id);
        std::set<std::string> described;
        std::set<std::string> bound;
        for (const auto& [name, signal] : message.signals)
            if (!is_protection(signal)) described.insert(name);
        for (const auto& [name, unused] : codec.members) bound.insert(name);
        CHECK_TEXT(described == bound, message.name.c_str());
    }
}

TEST(Dbc, CodecPacksWhatTheDbcReads) {
    for (const auto& [id, message] : dbc.messages) {
        const Binding codec = bind(id);
        for (int run = 0; run < 300; ++run) {
            Everything all;
            std::map<std::string, double> wanted;
            for (const auto& [name, signal] : message.signals) {
                if (is_protection(signal) || is_validity(signal)) continue;
                const Member& member = codec.members.at(name);
                // A physical value anywhere between two counts, in steps of the member's unit.
                const double lowest = std::ceil(signal.min * member.per_unit);
                const double highest = std::floor(signal.max * member.per_unit);
                const auto value = std::uniform_int_distribution<std::int64_t>(
                    static_cast<std::int64_t>(lowest), static_cast<std::int64_t>(highest))(random);
                member.set(all, value);
                wanted[name] = static_cast<double>(value) / member.per_unit;
            }
            const can::Frame frame = codec.encode(all);
            LONGS_EQUAL(id, frame.id);
            LONGS_EQUAL(message.length, frame.length);
            can::Frame rebuilt{.id = frame.id, .length = frame.length};
            for (const auto& [name, signal] : message.signals) {
                const std::int64_t count = signal.extract(frame);
                signal.insert(rebuilt, count);
                if (wanted.contains(name))
                    DOUBLES_EQUAL(wanted[name], signal.physical(count), 0.5 * signal.factor + 1e-9);
            }
            CHECK(rebuilt == frame);  // no bit set outside the DBC's signals
        }
    }
}

TEST(Dbc, CodecReadsWhatTheDbcPacks) {
    for (const auto& [id, message] : dbc.messages) {
        const Binding codec = bind(id);
        for (int run = 0; run < 300; ++run) {
            can::Frame frame{.id = static_cast<std::uint16_t>(id),
                             .length = static_cast<std::uint8_t>(message.length)};
            std::map<std::string, std::int64_t> counts;
            for (const auto& [name, signal] : message.signals) {
                counts[name] = random_count(signal);
                signal.insert(frame, counts[name]);
            }
            Everything all;
            CHECK(codec.decode(frame, all));
            for (const auto& [name, member] : codec.members) {
                const DbcSignal& signal = message.signals.at(name);
                DOUBLES_EQUAL(signal.physical(counts[name]),
                              static_cast<double>(member.get(all)) / member.per_unit, 1e-9);
            }
        }
    }
}

TEST(Dbc, CodecRefusesWhatIsOutsideTheDbcsRange) {
    for (const auto& [id, message] : dbc.messages) {
        const Binding codec = bind(id);
        for (const auto& [name, signal] : message.signals) {
            if (is_protection(signal)) continue;
            const std::int64_t highest =
                (std::int64_t{1} << (signal.is_signed ? signal.length - 1 : signal.length)) - 1;
            const std::int64_t count = std::llround(signal.max / signal.factor) + 1;
            if (count > highest) continue;
            can::Frame frame{.id = static_cast<std::uint16_t>(id),
                             .length = static_cast<std::uint8_t>(message.length)};
            signal.insert(frame, count);
            const auto value = signal.values.find(static_cast<long>(count));
            const bool means_nothing = value != signal.values.end() && value->second == "NotAvailable";
            Everything all;
            CHECK_TEXT(means_nothing == codec.decode(frame, all), name.c_str());
        }
    }
}

TEST(Dbc, TransmitterProtectsByTheDbcsDataIds) {
    can::Transmitter transmitter;
    for (int turn = 0; turn < 20; ++turn) {
        const can::Frame frames[] = {
            transmitter.frame(can::Status{}),           transmitter.frame(can::Version{}),
            transmitter.frame(can::CollisionWarning{}), transmitter.frame(can::CommandEcho{}),
            transmitter.frame(can::ObjectListHeader{}), transmitter.kinematics({.index = 7}),
            transmitter.quality({.index = 7}),          transmitter.frame(can::EgoMotion{}),
            transmitter.frame(can::Command{})};
        for (const can::Frame& frame : frames) {
            const DbcMessage& message = dbc.messages.at(frame.id);
            const auto data_id = static_cast<std::uint16_t>(message.attributes.at("E2EDataId"));
            LONGS_EQUAL(turn % 15, message.signals.at("Counter").extract(frame));
            LONGS_EQUAL(can::e2e_crc(std::span(frame.data).first(frame.length), data_id),
                        message.signals.at("Crc").extract(frame));
        }
    }
}
