// Expected values: plain arithmetic on the lanes, written out here. On a board the packed instructions
// themselves are compared with the portable twin by the recorded frames, whose CAN bytes must equal the PC's.
#include <array>
#include <cstdint>

#include "dsp/packed.hpp"
#include "tests/bench/dsp_reference.hpp"

#include <CppUTest/TestHarness.h>

using namespace dsp::packed;

namespace {

std::int64_t wrap16(std::int64_t v) {
    return static_cast<std::int16_t>(static_cast<std::uint16_t>(v & 0xFFFF));
}
std::int64_t wrap32(std::int64_t v) {
    return static_cast<std::int32_t>(static_cast<std::uint32_t>(v & 0xFFFFFFFF));
}
std::int64_t floor_half(std::int64_t v) {
    return v >= 0 ? v / 2 : -((1 - v) / 2);
}
std::int64_t clamp16(std::int64_t v) {
    return v > 32767 ? 32767 : (v < -32768 ? -32768 : v);
}

}  // namespace

TEST_GROUP(Packed){
    void lanes(std::int64_t expected0, std::int64_t expected1, Pair got){LONGS_EQUAL(expected0, lane0(got));
LONGS_EQUAL(expected1, lane1(got));
}

void check(int a0, int a1, int b0, int b1, std::int32_t sum) {
    const Pair a = pack(a0, a1);
    const Pair b = pack(b0, b1);
    lanes(a0, a1, a);
    lanes(wrap16(a0 + b0), wrap16(a1 + b1), add(a, b));
    lanes(wrap16(a0 - b0), wrap16(a1 - b1), sub(a, b));
    lanes(floor_half(a0 + b0), floor_half(a1 + b1), half_add(a, b));
    lanes(floor_half(a0 - b0), floor_half(a1 - b1), half_sub(a, b));
    // (a0 + j a1) +- j (b0 + j b1)
    lanes(wrap16(a0 - b1), wrap16(a1 + b0), add_j(a, b));
    lanes(wrap16(a0 + b1), wrap16(a1 - b0), sub_j(a, b));
    lanes(floor_half(a0 - b1), floor_half(a1 + b0), half_add_j(a, b));
    lanes(floor_half(a0 + b1), floor_half(a1 - b0), half_sub_j(a, b));
    lanes(clamp16(a0 + b0), clamp16(a1 + b1), saturated_add(a, b));
    lanes(clamp16(a0 - b0), clamp16(a1 - b1), saturated_sub(a, b));
    lanes(clamp16(a0 - b1), clamp16(a1 + b0), saturated_add_j(a, b));
    lanes(clamp16(a0 + b1), clamp16(a1 - b0), saturated_sub_j(a, b));
    lanes(std::max(a0, b0), std::max(a1, b1), largest(a, b));
    lanes(std::min(a0, b0), std::min(a1, b1), smallest(a, b));
    lanes(a1, a0, swap(a));
    const int u0 = a0 & 0xFFFF;
    const int u1 = a1 & 0xFFFF;
    const int v0 = b0 & 0xFFFF;
    const int v1 = b1 & 0xFFFF;
    const auto where = [](bool here, int x) { return wrap16(here ? x : 0); };
    lanes(where(u0 >= v0, 1), where(u1 >= v1, 1), at_least(a, b));
    Pair low = a;
    Pair high = b;
    order(low, high);
    lanes(wrap16(std::min(u0, v0)), wrap16(std::min(u1, v1)), low);
    lanes(wrap16(std::max(u0, v0)), wrap16(std::max(u1, v1)), high);
    lanes(wrap16(v0 / 256 + u0 / 256 * 256), wrap16(v1 / 256 + u1 / 256 * 256),
          static_cast<Pair>(high_bytes(a, b)));
    const auto bytes = [](int x, int y) {
        return (x / 256 >= y / 256 ? 256 : 0) + (x % 256 >= y % 256 ? 1 : 0);
    };
    lanes(bytes(u0, v0), bytes(u1, v1), static_cast<Pair>(bytes_at_least(a, b)));
    Pair smaller = a;
    Pair larger = b;
    sort(smaller, larger);
    lanes(std::min(a0, b0), std::min(a1, b1), smaller);
    lanes(std::max(a0, b0), std::max(a1, b1), larger);
    const auto above = [](int x, int y) { return wrap16(std::max((x & 0xFFFF) - (y & 0xFFFF), 0)); };
    lanes(above(a0, b0), above(a1, b1), floored_sub(a, b));
    const auto product = [](std::int64_t x, std::int64_t y) { return x * y; };
    LONGS_EQUAL(wrap32(product(a0, b0) + product(a1, b1) + sum), dot(a, b, sum));
    LONGS_EQUAL(wrap32(product(a0, b0) + product(a1, b1)), dot(a, b));
    LONGS_EQUAL(wrap32(product(a0, b0) - product(a1, b1) + sum), dot_minus(a, b, sum));
    LONGS_EQUAL(wrap32(product(a0, b1) + product(a1, b0) + sum), dot_cross(a, b, sum));
    LONGS_EQUAL(wrap32(product(a0, b1) - product(a1, b0) + sum), dot_cross_minus(a, b, sum));
    LONGS_EQUAL(wrap32(product(a0, b0) + sum), multiply_00(a, b, sum));
    LONGS_EQUAL(wrap32(product(a1, b0) + sum), multiply_10(a, b, sum));
    LONGS_EQUAL(wrap32(product(a0, b1) + sum), multiply_01(a, b, sum));
    LONGS_EQUAL(wrap32(product(a1, b1) + sum), multiply_11(a, b, sum));
    LONGS_EQUAL((product(sum, b0) - (product(sum, b0) & 0xFFFF)) / 65536, scale_0(sum, b));
    LONGS_EQUAL((product(sum, b1) - (product(sum, b1) & 0xFFFF)) / 65536, scale_1(sum, b));
    LONGS_EQUAL(wrap32(std::int64_t{scale_0(sum, b)} + a1), scale_add_0(sum, b, a1));
    LONGS_EQUAL(wrap32(std::int64_t{scale_1(sum, b)} + sum), scale_add_1(sum, b, sum));
    const auto bits = [](std::int64_t v) { return static_cast<std::uint32_t>(v & 0xFFFFFFFF); };
    UNSIGNED_LONGS_EQUAL(bits(product(a0, b0) + sum), multiply_add(bits(a0), bits(b0), bits(sum)));
    const std::int64_t scaled0 = (product(sum, a0) - (product(sum, a0) & 0xFFFF)) / 65536;
    const std::int64_t scaled1 = (product(~sum, a1) - (product(~sum, a1) & 0xFFFF)) / 65536;
    lanes(wrap16(scaled0), wrap16(scaled1), scale_lanes(a, sum, ~sum));
    lanes(a0, b0, both_lane0(a, b));
    lanes(a1, b1, both_lane1(a, b));
    const std::int64_t upper = wrap16(sum / 65536 - (sum % 65536 < 0 ? 1 : 0));
    lanes(upper, b1, mix_low(sum, b));
    lanes(a0, upper, mix_high(a, sum));
    lanes(upper, 0, upper_half(sum));
    lanes(a0, b1, pack_mixed(a, b));
    lanes(wrap16(sum), wrap16(~sum), pack_low(sum, ~sum));
    lanes(wrap16(sum / 65536 - (sum % 65536 < 0 ? 1 : 0)), a1, pack_high(sum, static_cast<std::int32_t>(a)));
}
}
;

TEST(Packed, EveryCombinationOfEdges) {
    constexpr std::array<int, 8> kEdges{-32768, -32767, -16384, -1, 0, 1, 16384, 32767};
    for (const int a0 : kEdges) {
        for (const int a1 : kEdges) {
            for (const int b0 : kEdges) {
                for (const int b1 : kEdges) check(a0, a1, b0, b1, a0 * 65536 + (b1 & 0xFFFF));
            }
        }
    }
}

TEST(Packed, RandomNumbers) {
    bench::Random random{5};
    const auto draw = [&random] { return static_cast<int>(static_cast<std::int16_t>(random() & 0xFFFF)); };
    for (int i = 0; i < 20'000; ++i) {
        check(draw(), draw(), draw(), draw(),
              static_cast<std::int32_t>(static_cast<std::uint32_t>(random())));
    }
}

TEST(Packed, AWordGoesToMemory) {
    std::array<std::uint16_t, 4> copy{};
    store(&copy[1], pack(-2, -1));
    CHECK(copy == (std::array<std::uint16_t, 4>{0, 0xFFFE, 0xFFFF, 0}));
}

TEST(Packed, LeftAlignedShiftsByAllBitsToo) {
    for (int zeros = 0; zeros < 32; ++zeros) {
        UNSIGNED_LONGS_EQUAL(0x80000001U << zeros, left_aligned(0x80000001U, zeros));
    }
    UNSIGNED_LONGS_EQUAL(0, left_aligned(0xFFFFFFFFU, 32));
}

TEST(Packed, TwoWordsGoThroughMemory) {
    alignas(4) std::array<std::int16_t, 6> samples{1, -2, 3, -4, 5, -6};
    Pair first = 0;
    Pair second = 0;
    load_pair(&samples[2], first, second);
    lanes(3, -4, first);
    lanes(5, -6, second);
    store_pair(samples.data(), second, first);
    CHECK((samples == std::array<std::int16_t, 6>{5, -6, 3, -4, 5, -6}));
    std::int16_t* to = &samples[2];
    put_pair(to, first, second);
    POINTERS_EQUAL(samples.data() + 6, to);
    CHECK((samples == std::array<std::int16_t, 6>{5, -6, 3, -4, 5, -6}));
    to = samples.data();
    put_pair(to, first, second);
    CHECK((samples == std::array<std::int16_t, 6>{3, -4, 5, -6, 5, -6}));
}

TEST(Packed, FourWordsGoThroughMemory) {
    std::array<std::uint32_t, 9> words{1, 2, 3, 4, 5, 6, 7, 8, 9};
    Pair a = 0;
    Pair b = 0;
    Pair c = 0;
    Pair d = 0;
    const std::uint32_t* from = &words[0];
    take_four(from, a, b, c, d);
    POINTERS_EQUAL(&words[4], from);
    CHECK(a == 1 && b == 2 && c == 3 && d == 4);
    load_four(from, a, b, c, d);
    POINTERS_EQUAL(&words[4], from);
    CHECK(a == 5 && b == 6 && c == 7 && d == 8);
    from = &words[1];
    take_four_beside(from, a, b, c, d);
    POINTERS_EQUAL(&words[5], from);
    CHECK(a == 2 && b == 3 && c == 4 && d == 5);
    from = &words[4];
    take_four(from, a, b, c, d);
    std::uint32_t* to = &words[1];
    put_four(to, d, c, b, a);
    POINTERS_EQUAL(&words[5], to);
    CHECK((words == std::array<std::uint32_t, 9>{1, 8, 7, 6, 5, 6, 7, 8, 9}));
}

TEST(Packed, ReversesBits) {
    for (int i = 0; i < 32; ++i)
        CHECK(reverse_bits(std::uint32_t{1} << i) == std::uint32_t{0x8000'0000} >> i);
    CHECK(reverse_bits(0x1234'5678U) == 0x1E6A'2C48U);
}

TEST(Packed, MagnitudeBitsCoverEveryValue) {
    for (int v = -32768; v <= 32767; ++v) {
        int bits = 1;
        while (v < -(1 << bits) || v > (1 << bits) - 1) ++bits;
        LONGS_EQUAL(bits, magnitude_bits(spread(pack(v, 0))));
        LONGS_EQUAL(bits, magnitude_bits(spread(pack(0, v))));
    }
}

TEST(Packed, TablesAreReadInOrder) {
    alignas(8) std::array<Pair, 9> table{};
    for (std::size_t i = 0; i < table.size(); ++i) table[i] = 0x10001000U * static_cast<Pair>(i + 1);
    const Pair* next = &table[1];
    Pair first = 0;
    Pair second = 0;
    take_pair(next, first, second);
    POINTERS_EQUAL(&table[3], next);
    UNSIGNED_LONGS_EQUAL(table[1], first);
    UNSIGNED_LONGS_EQUAL(table[2], second);
    const auto eight = load_8(&table[1]);
    for (std::size_t i = 0; i < 8; ++i) UNSIGNED_LONGS_EQUAL(table[i + 1], eight[i]);
    next = &table[1];
    CHECK(take_8(next) == eight);
    POINTERS_EQUAL(&table[9], next);
    UNSIGNED_LONGS_EQUAL(table[2], in_register(table[2]));
}
