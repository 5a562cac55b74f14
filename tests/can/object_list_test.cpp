// Lists with something missing, late or foreign; expected results by construction.
#include <cstdint>

#include "can/object_list.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(ObjectList) {
    can::ObjectListReader list;

    static can::ObjectListHeader header(std::uint8_t count, std::uint8_t cycle) {
        return {.count = count, .cycle = cycle, .valid = true};
    }

    /// All halves of a list except those of `without`; true if the last one completed it.
    bool send_objects(std::uint8_t count, std::uint8_t cycle, int without = -1) {
        bool complete = false;
        for (std::uint8_t i = 0; i < count; ++i) {
            can::Object object;
            object.index = i;
            object.cycle = cycle;
            object.track_id = static_cast<std::uint8_t>(100 + i);
            object.existence_percent = static_cast<std::uint8_t>(50 + i);
            if (i == without) continue;
            complete = list.kinematics(object) || complete;
            complete = list.quality(object) || complete;
        }
        return complete;
    }
};

TEST(ObjectList, BeforeTheFirstThereIsNoStatement) {
    CHECK(!list.last_header().valid);
    LONGS_EQUAL(0, list.objects().size());
}

TEST(ObjectList, WholeListsOfEveryLengthAreShown) {
    for (std::uint8_t count = 0; count <= can::kMaxObjects; ++count) {
        const bool complete = list.header(header(count, count));
        CHECK(complete == (count == 0));
        CHECK(send_objects(count, count) == (count != 0));
        CHECK(!list.pending());
        LONGS_EQUAL(count, list.objects().size());
        for (std::uint8_t i = 0; i < count; ++i) {
            LONGS_EQUAL(100 + i, list.objects()[i].track_id);
            LONGS_EQUAL(50 + i, list.objects()[i].existence_percent);
        }
    }
    LONGS_EQUAL(17, list.counters().complete);
    LONGS_EQUAL(0, list.counters().torn);
    LONGS_EQUAL(0, list.counters().stray);
}

TEST(ObjectList, ListWithAMissingObjectIsTornAndNeverShown) {
    list.header(header(2, 1));
    CHECK(send_objects(2, 1));
    list.header(header(3, 2));
    CHECK(!send_objects(3, 2, 1));
    CHECK(list.pending());
    LONGS_EQUAL(2, list.objects().size());
    LONGS_EQUAL(1, list.last_header().cycle);
    list.header(header(1, 3));
    LONGS_EQUAL(1, list.counters().torn);
    CHECK(send_objects(1, 3));
    LONGS_EQUAL(1, list.objects().size());
}

TEST(ObjectList, HalfAnObjectIsNotEnough) {
    list.header(header(1, 1));
    CHECK(!list.kinematics({.index = 0, .cycle = 1}));
    CHECK(!list.kinematics({.index = 0, .cycle = 1}));
    CHECK(list.quality({.index = 0, .cycle = 1}));
    list.header(header(1, 2));
    CHECK(!list.quality({.index = 0, .cycle = 2}));
    list.header(header(0, 3));
    LONGS_EQUAL(1, list.counters().torn);
}

TEST(ObjectList, ObjectsOfALostHeaderAreStray) {
    list.header(header(2, 1));
    send_objects(2, 1);
    send_objects(2, 2);
    LONGS_EQUAL(4, list.counters().stray);
    LONGS_EQUAL(1, list.last_header().cycle);
}

TEST(ObjectList, ObjectsOfAnotherCycleDoNotMix) {
    list.header(header(1, 5));
    CHECK(!list.kinematics({.index = 0, .cycle = 4}));
    CHECK(!list.kinematics({.index = 1, .cycle = 5}));
    CHECK(!list.kinematics({.index = 255, .cycle = 5}));
    LONGS_EQUAL(3, list.counters().stray);
    CHECK(list.pending());
}

TEST(ObjectList, ImpossibleCountIsLimited) {
    list.header(header(255, 1));
    CHECK(send_objects(16, 1));
    LONGS_EQUAL(16, list.objects().size());
}
