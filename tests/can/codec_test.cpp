// Expected bytes worked out by hand from the layout; saturation and round trips by the signals' own ranges.
#include <cstdint>
#include <limits>

#include "can/codec.hpp"
#include "can/signals.hpp"

#include <CppUTest/TestHarness.h>

namespace {

/// A frame with every payload bit set or cleared.
can::Frame filled(const can::Message& message, std::uint8_t byte) {
    can::Frame frame{.id = message.id, .length = message.length};
    for (unsigned i = 0; i < message.length; ++i) frame.data[i] = byte;
    return frame;
}

}  // namespace

TEST_GROUP(Codec){};

TEST(Codec, KinematicsBytesByHand) {
    can::Object object;
    object.index = 3;
    object.cycle = 0xAB;
    object.track_id = 17;
    object.range_mm = 102400;         // 20480 counts of 5 mm = 0x5000
    object.range_rate_mmps = -12345;  // -2469 counts = 0xF65B
    object.motion = can::Motion::oncoming;
    object.coasting = true;
    const can::Encoded encoded = can::encode_kinematics(object);
    CHECK(!encoded.limited);
    LONGS_EQUAL(0x414, encoded.frame.id);
    LONGS_EQUAL(8, encoded.frame.length);
    // Cycle from bit 12: low nibble in byte 1, high nibble in byte 2, then motion 3 and coasting.
    const std::uint8_t expected[8] = {0x00, 0xB0, 0xBA, 0x11, 0x00, 0x50, 0x5B, 0xF6};
    MEMCMP_EQUAL(expected, encoded.frame.data.data(), 8);
}

TEST(Codec, StatusBytesByHand) {
    const can::Status status{
        .mode = can::Mode::degraded, .faults = 0x0842, .cycle = 0x12, .detections = 9, .overruns = 5};
    const can::Frame frame = can::encode(status).frame;
    LONGS_EQUAL(0x400, frame.id);
    LONGS_EQUAL(7, frame.length);
    const std::uint8_t expected[7] = {0x00, 0x20, 0x21, 0x42, 0x08, 0x09, 0x05};
    MEMCMP_EQUAL(expected, frame.data.data(), 7);
}

TEST(Codec, RoundsToNearestHalvesAwayFromZero) {
    can::EgoMotion read;
    const struct {
        std::int32_t value, sent;
    } cases[] = {{0, 0}, {2, 0}, {3, 5}, {7, 5}, {8, 10}, {-2, 0}, {-3, -5}, {-7, -5}, {-8, -10}};
    for (const auto& c : cases) {
        CHECK(can::decode(can::encode(can::EgoMotion{.speed_mmps = c.value, .valid = true}).frame, read));
        LONGS_EQUAL(c.sent, read.speed_mmps);
    }
    can::Object object;
    object.snr_cdb = 25;  // half a count of 50
    can::Object read_object;
    CHECK(can::decode(can::encode_quality(object).frame, read_object));
    LONGS_EQUAL(50, read_object.snr_cdb);
}

TEST(Codec, LimitsInsteadOfWrapping) {
    constexpr auto kMax = std::numeric_limits<std::int32_t>::max();
    constexpr auto kMin = std::numeric_limits<std::int32_t>::min();
    can::Object read;
    for (const std::int32_t extreme : {kMax, kMin}) {
        can::Object object;
        object.range_mm = extreme;
        object.range_rate_mmps = extreme;
        const can::Encoded encoded = can::encode_kinematics(object);
        CHECK(encoded.limited);
        CHECK(can::decode(encoded.frame, read));
        LONGS_EQUAL(extreme > 0 ? 65535 * 5 : 0, read.range_mm);
        LONGS_EQUAL(extreme > 0 ? 32767 * 5 : -32768 * 5, read.range_rate_mmps);
    }
    can::EgoMotion ego;
    const can::Encoded fast =
        can::encode(can::EgoMotion{.speed_mmps = kMin, .acceleration_mmps2 = kMax, .valid = true});
    CHECK(fast.limited);
    CHECK(can::decode(fast.frame, ego));
    CHECK(ego.valid);  // limited, not mistaken for "not available" next to it
    LONGS_EQUAL(-32767 * 5, ego.speed_mmps);
    LONGS_EQUAL(32767 * 5, ego.acceleration_mmps2);

    can::Object certain;
    certain.existence_percent = 101;
    CHECK(can::encode_quality(certain).limited);
    CHECK(can::decode(can::encode_quality(certain).frame, read));
    LONGS_EQUAL(100, read.existence_percent);

    can::ObjectListHeader header;
    CHECK(can::encode(can::ObjectListHeader{.count = 17}).limited);
    CHECK(can::decode(can::encode(can::ObjectListHeader{.count = 17}).frame, header));
    LONGS_EQUAL(16, header.count);
}

TEST(Codec, EnumeratorsOutsideTheirTableAreLimited) {
    CHECK(can::encode(can::Status{.mode = static_cast<can::Mode>(9)}).limited);
    can::Object object;
    object.motion = static_cast<can::Motion>(200);
    CHECK(can::encode_kinematics(object).limited);
    can::Status status;
    CHECK(can::decode(can::encode(can::Status{.mode = static_cast<can::Mode>(9)}).frame, status));
    CHECK(can::Mode::failed == status.mode);
}

TEST(Codec, GreatestCountOfAnOpenRangeIsNoError) {
    can::Object object;
    object.range_sigma_mm = std::numeric_limits<std::uint32_t>::max();
    object.range_rate_sigma_mmps = std::numeric_limits<std::uint32_t>::max();
    object.age_cycles = 65535;
    object.snr_cdb = std::numeric_limits<std::int32_t>::max();
    const can::Encoded encoded = can::encode_quality(object);
    CHECK(!encoded.limited);
    can::Object read;
    CHECK(can::decode(encoded.frame, read));
    LONGS_EQUAL(10230, read.range_sigma_mm);
    LONGS_EQUAL(5115, read.range_rate_sigma_mmps);
    LONGS_EQUAL(255, read.age_cycles);
    LONGS_EQUAL(12750, read.snr_cdb);
    object.snr_cdb = -1000;
    CHECK(can::encode_quality(object).limited);
}

TEST(Codec, IndexBeyondTheListStaysInsideOurIdentifiers) {
    can::Object object;
    object.index = 16;
    CHECK(can::encode_kinematics(object).limited);
    LONGS_EQUAL(0x420, can::encode_kinematics(object).frame.id);
    object.index = 255;
    CHECK(can::encode_quality(object).limited);
    LONGS_EQUAL(0x430, can::encode_quality(object).frame.id);
}

TEST(Codec, InvalidWarningCanNotBeReadAsNone) {
    const can::CollisionWarning silent{.valid = false, .level = can::WarningLevel::none, .cycle = 77};
    const can::Frame frame = can::encode(silent).frame;
    LONGS_EQUAL(7, (frame.data[2] >> 4) & 7);
    LONGS_EQUAL(0, frame.data[2] >> 7);
    can::CollisionWarning read{.valid = true};
    CHECK(can::decode(frame, read));
    CHECK(!read.valid);
    LONGS_EQUAL(77, read.cycle);
    CHECK(!read.time_to_collision_ms.has_value());
}

TEST(Codec, NoTimeToCollisionIsNotATime) {
    can::CollisionWarning read;
    CHECK(can::decode(can::encode(can::CollisionWarning{.valid = true}).frame, read));
    CHECK(read.valid && !read.time_to_collision_ms);
    const can::CollisionWarning far{.valid = true, .time_to_collision_ms = 70000};
    CHECK(!can::encode(far).limited);
    CHECK(can::decode(can::encode(far).frame, read));
    LONGS_EQUAL(65534, *read.time_to_collision_ms);
}

TEST(Codec, UnavailableEgoMotionIsInvalid) {
    can::EgoMotion read{.valid = true};
    CHECK(can::decode(can::encode(can::EgoMotion{.speed_mmps = 10000, .valid = false}).frame, read));
    CHECK(!read.valid);
    // A sender that claims valid but marks one signal as not available is believed in the latter.
    can::Frame frame = can::encode(can::EgoMotion{.speed_mmps = 10000, .valid = true}).frame;
    frame.data[4] = 0x00;
    frame.data[5] = 0x80;
    CHECK(can::decode(frame, read));
    CHECK(!read.valid);
}

TEST(Codec, UnknownCommandsPassSoThatTheyCanBeAnswered) {
    can::Command read;
    const can::Command command{
        .code = static_cast<can::CommandCode>(13), .sequence = 200, .value = -2147483647 - 1};
    const can::Encoded encoded = can::encode(command);
    CHECK(!encoded.limited);
    CHECK(can::decode(encoded.frame, read));
    LONGS_EQUAL(13, static_cast<int>(read.code));
    LONGS_EQUAL(200, read.sequence);
    LONGS_EQUAL(-2147483647 - 1, read.value);
}

TEST(Codec, OutOfRangeCountsAreRefusedAndLeaveTheMessage) {
    can::Status status{.detections = 42};
    CHECK(!can::decode(filled(can::status::kMessage, 0xFF), status));
    LONGS_EQUAL(42, status.detections);
    can::Object object;
    object.range_mm = 42;
    CHECK(!can::decode(filled(can::kinematics::kMessage, 0xFF), object));  // motion 7
    LONGS_EQUAL(42, object.range_mm);
    CHECK(!can::decode(filled(can::quality::kMessage, 0xFF), object));  // existence 255
    can::ObjectListHeader header{.count = 5};
    CHECK(!can::decode(filled(can::object_list::kMessage, 0xFF), header));  // count 255
    LONGS_EQUAL(5, header.count);
    can::CommandEcho echo;
    CHECK(!can::decode(filled(can::command::kEchoMessage, 0xFF), echo));  // result 255
}

TEST(Codec, WrongLengthAndWrongIdentifierAreRefused) {
    can::Status status;
    can::Object object;
    for (std::uint16_t id = 0x3F0; id < 0x450; ++id) {
        for (std::uint8_t length = 0; length <= 8; ++length) {
            const can::Frame frame{.id = id, .length = length};
            CHECK((id == 0x400 && length == 7) == can::decode(frame, status));
            CHECK((id >= 0x411 && id <= 0x430 && length == 8) == can::decode(frame, object));
        }
    }
}

TEST(Codec, HalvesOfAnObjectMeet) {
    can::Object object;
    object.index = 15;
    object.cycle = 9;
    object.track_id = 255;
    object.range_mm = 159995;
    object.range_rate_mmps = -30400;
    object.motion = can::Motion::stopped;
    object.range_sigma_mm = 250;
    object.range_rate_sigma_mmps = 45;
    object.existence_percent = 99;
    object.snr_cdb = 2350;
    object.age_cycles = 33;
    can::Object read;
    CHECK(can::decode(can::encode_kinematics(object).frame, read));
    CHECK(can::decode(can::encode_quality(object).frame, read));
    LONGS_EQUAL(15, read.index);
    LONGS_EQUAL(9, read.cycle);
    LONGS_EQUAL(255, read.track_id);
    LONGS_EQUAL(159995, read.range_mm);
    LONGS_EQUAL(-30400, read.range_rate_mmps);
    CHECK(can::Motion::stopped == read.motion);
    CHECK(!read.coasting);
    LONGS_EQUAL(250, read.range_sigma_mm);
    LONGS_EQUAL(45, read.range_rate_sigma_mmps);
    LONGS_EQUAL(99, read.existence_percent);
    LONGS_EQUAL(2350, read.snr_cdb);
    LONGS_EQUAL(33, read.age_cycles);
}
