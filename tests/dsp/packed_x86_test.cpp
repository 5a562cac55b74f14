// Expected: the same operations on each of the four words, of the portable twin.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>

#include "dsp/packed_x86.hpp"
#include "tests/bench/dsp_reference.hpp"

#include <CppUTest/TestHarness.h>

#if DSP_PACKED_FOUR
using namespace dsp::packed;

namespace {
using Four = std::array<Pair, 4>;
using FourSums = std::array<std::int32_t, 4>;

Four words(Quad q) {
    Four four;
    _mm_storeu_si128(reinterpret_cast<__m128i*>(four.data()), q.v);
    return four;
}
Four words(Sum4 s) {
    return words(Quad(s.v));
}
Pair bits(std::int32_t v) {
    return static_cast<Pair>(v);
}
}  // namespace

TEST_GROUP(PackedX86) {
    bench::Random random{6};
    Four draw() {
        // Edges, or any number, in every lane.
        static constexpr std::array<int, 8> kEdges{-32768, -32767, -16384, -1, 0, 1, 16384, 32767};
        const auto lane = [this] {
            return random() % 2 == 0 ? kEdges[random() % 8] : static_cast<int>(random() % 65536) - 32768;
        };
        Four four;
        for (Pair& word : four) word = pack(lane(), lane());
        return four;
    }
    static Quad quad(const Four& four) {
        return Quad(_mm_loadu_si128(reinterpret_cast<const __m128i*>(four.data())));
    }
    template <class OnFour, class OnOne>
    void same(OnFour on_four, OnOne on_one) {
        const Four got = words(on_four);
        for (std::size_t i = 0; i < 4; ++i) UNSIGNED_LONGS_EQUAL(on_one(i), got[i]);
    }
};

TEST(PackedX86, EveryOperationIsItsTwinFourTimes) {
    for (int i = 0; i < 20'000; ++i) {
        const Four a = draw();
        const Four b = draw();
        Four w = draw();  // a factor, without -2^15
        for (Pair& word : w) word = pack(std::max(lane0(word), -32767), std::max(lane1(word), -32767));
        FourSums sum;
        for (std::int32_t& s : sum) s = static_cast<std::int32_t>(static_cast<std::uint32_t>(random()));
        const Sum4 sums(_mm_loadu_si128(reinterpret_cast<const __m128i*>(sum.data())));
        const Quad qa = quad(a);
        const Quad qb = quad(b);
        const Quad qw = quad(w);
        same(qa & qb, [&](std::size_t k) { return a[k] & b[k]; });
        same(swap(qa), [&](std::size_t k) { return swap(a[k]); });
        same(add(qa, qb), [&](std::size_t k) { return add(a[k], b[k]); });
        same(sub(qa, qb), [&](std::size_t k) { return sub(a[k], b[k]); });
        same(half_add(qa, qb), [&](std::size_t k) { return half_add(a[k], b[k]); });
        same(half_sub(qa, qb), [&](std::size_t k) { return half_sub(a[k], b[k]); });
        same(add_j(qa, qb), [&](std::size_t k) { return add_j(a[k], b[k]); });
        same(sub_j(qa, qb), [&](std::size_t k) { return sub_j(a[k], b[k]); });
        same(half_add_j(qa, qb), [&](std::size_t k) { return half_add_j(a[k], b[k]); });
        same(half_sub_j(qa, qb), [&](std::size_t k) { return half_sub_j(a[k], b[k]); });
        same(smallest(qa, qb), [&](std::size_t k) { return smallest(a[k], b[k]); });
        same(largest(qa, qb), [&](std::size_t k) { return largest(a[k], b[k]); });
        UNSIGNED_LONGS_EQUAL(smallest(smallest(a[0], a[1]), smallest(a[2], a[3])),
                             across_words(qa, [](Quad x, Quad y) { return smallest(x, y); }));
        same(saturated_add(qa, qb), [&](std::size_t k) { return saturated_add(a[k], b[k]); });
        same(saturated_sub(qa, qb), [&](std::size_t k) { return saturated_sub(a[k], b[k]); });
        same(saturated_add_j(qa, qb), [&](std::size_t k) { return saturated_add_j(a[k], b[k]); });
        same(saturated_sub_j(qa, qb), [&](std::size_t k) { return saturated_sub_j(a[k], b[k]); });
        same(pack_mixed(qa, qb), [&](std::size_t k) { return pack_mixed(a[k], b[k]); });
        same(scale_lanes(qa, sum[0], sum[1]),
             [&](std::size_t k) { return scale_lanes(a[k], sum[0], sum[1]); });
        same(scale_words(qa, sums),
             [&](std::size_t k) { return pack_low(scale_0(sum[k], a[k]), scale_1(sum[k], a[k])); });
        same(both_lane0(qa, qb), [&](std::size_t k) { return both_lane0(a[k], b[k]); });
        same(both_lane1(qa, qb), [&](std::size_t k) { return both_lane1(a[k], b[k]); });
        same(mix_low(sums, qb), [&](std::size_t k) { return mix_low(sum[k], b[k]); });
        same(mix_high(qa, sums), [&](std::size_t k) { return mix_high(a[k], sum[k]); });
        same(upper_half(sums), [&](std::size_t k) { return upper_half(sum[k]); });
        same(dot(qa, qb, sums), [&](std::size_t k) { return bits(dot(a[k], b[k], sum[k])); });
        same(dot_cross(qa, qb, sums), [&](std::size_t k) { return bits(dot_cross(a[k], b[k], sum[k])); });
        same(dot_minus(qa, qw, sums), [&](std::size_t k) { return bits(dot_minus(a[k], w[k], sum[k])); });
        same(dot_cross_minus(qa, qw, sums),
             [&](std::size_t k) { return bits(dot_cross_minus(a[k], w[k], sum[k])); });
        same(multiply_00(qa, b[0], sums),
             [&](std::size_t k) { return bits(multiply_00(a[k], b[0], sum[k])); });
        same(multiply_10(qa, b[0], sums),
             [&](std::size_t k) { return bits(multiply_10(a[k], b[0], sum[k])); });
        same(multiply_11(qa, b[0], sums),
             [&](std::size_t k) { return bits(multiply_11(a[k], b[0], sum[k])); });
        const Sum4 others = dot(qa, qb, 0);
        same(pack_high(sums, others), [&](std::size_t k) { return pack_high(sum[k], dot(a[k], b[k], 0)); });
    }
}

TEST(PackedX86, RowsAreTransposedAndBack) {
    std::array<Pair, 4 * 6> rows;
    for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = static_cast<Pair>(i);
    std::array<Quad, 4> columns;
    load_transposed(&rows[1], 6, columns.data());
    for (std::size_t i = 0; i < 4; ++i) {
        CHECK((words(columns[i]) == Four{static_cast<Pair>(i + 1), static_cast<Pair>(i + 7),
                                         static_cast<Pair>(i + 13), static_cast<Pair>(i + 19)}));
    }
    std::array<Pair, 4 * 6> back{};
    store_transposed(columns.data(), &back[1], 6);
    for (std::size_t i = 0; i < rows.size(); ++i) UNSIGNED_LONGS_EQUAL(i % 6 % 5 == 0 ? 0 : rows[i], back[i]);
}

TEST(PackedX86, TwoGoToMemory) {
    const std::array<Four, 2> words_of{Four{1, 2, 3, 4}, Four{5, 6, 7, 8}};
    std::array<Quad, 2> to;
    store_pair(to.data(), quad(words_of[0]), quad(words_of[1]));
    CHECK(words(to[0]) == words_of[0] && words(to[1]) == words_of[1]);
}

TEST(PackedX86, SamplesComeInOrder) {
    const std::array<std::int16_t, 8> samples{1, -2, 3, -4, 5, -6, 7, -8};
    CHECK((words(load_quad(samples.data())) == Four{pack(1, -2), pack(3, -4), pack(5, -6), pack(7, -8)}));
}

TEST(PackedX86, ConstantsAreTheSameInAllFour) {
    CHECK((words(Quad(pack(3, -4))) == Four{pack(3, -4), pack(3, -4), pack(3, -4), pack(3, -4)}));
    CHECK((words(Sum4(-5)) == Four{bits(-5), bits(-5), bits(-5), bits(-5)}));
}
#else
TEST_GROUP(PackedX86){};
TEST(PackedX86, NeedsSse2) {
    std::puts("SKIPPED: this processor has no SSE2");
}
#endif
