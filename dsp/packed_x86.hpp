/// Four words of packed.hpp at once, for PCs: the same operations under the same names, each on four Pairs in
/// a register of SSE2, which every x86-64 has. What the boards compute word by word, a PC computes four words
/// wide, with the same bits.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "dsp/packed.hpp"

#if defined(__SSE2__)
#include <emmintrin.h>
#define DSP_PACKED_FOUR 1
#else
#define DSP_PACKED_FOUR 0
#endif

#if DSP_PACKED_FOUR
namespace dsp::packed {

/// Four sums of 32 bits.
struct Sum4 {
    __m128i v;
    explicit Sum4(__m128i x) : v(x) {}
    /// The same in all four.
    Sum4(std::int32_t x)
        : v(_mm_set1_epi32(x)) {}  // NOLINT(google-explicit-constructor): constants mix with sums
};

/// Four Pairs.
struct Quad {
    __m128i v = _mm_setzero_si128();
    Quad() = default;
    explicit Quad(__m128i x) : v(x) {}
    /// The same in all four.
    Quad(Pair x) : v(_mm_set1_epi32(static_cast<int>(x))) {}  // NOLINT(google-explicit-constructor): as above
};

/// Eight samples next to each other in memory.
inline Quad load_quad(const std::int16_t* samples) {
    return Quad(_mm_loadu_si128(reinterpret_cast<const __m128i*>(samples)));
}
inline void store_quad(std::int16_t* samples, Quad a) {
    _mm_storeu_si128(reinterpret_cast<__m128i*>(samples), a.v);
}
inline Sum4 load_sums(const std::int32_t* sums) {
    return Sum4(_mm_loadu_si128(reinterpret_cast<const __m128i*>(sums)));
}
/// Words i .. i + 3 of four rows, `stride` words from one to the next, to Quads i .. i + 3.
template <class T>
void load_transposed(const T* rows, std::size_t stride, Quad* columns) {
    static_assert(sizeof(T) == 4);
    const auto row = [&](std::size_t i) {
        return _mm_castsi128_ps(_mm_loadu_si128(reinterpret_cast<const __m128i*>(rows + i * stride)));
    };
    __m128 a = row(0);
    __m128 b = row(1);
    __m128 c = row(2);
    __m128 d = row(3);
    _MM_TRANSPOSE4_PS(a, b, c, d);
    columns[0] = Quad(_mm_castps_si128(a));
    columns[1] = Quad(_mm_castps_si128(b));
    columns[2] = Quad(_mm_castps_si128(c));
    columns[3] = Quad(_mm_castps_si128(d));
}
/// The same back.
template <class T>
void store_transposed(const Quad* columns, T* rows, std::size_t stride) {
    static_assert(sizeof(T) == 4);
    __m128 a = _mm_castsi128_ps(columns[0].v);
    __m128 b = _mm_castsi128_ps(columns[1].v);
    __m128 c = _mm_castsi128_ps(columns[2].v);
    __m128 d = _mm_castsi128_ps(columns[3].v);
    _MM_TRANSPOSE4_PS(a, b, c, d);
    const auto store = [&](std::size_t i, __m128 row) {
        _mm_storeu_si128(reinterpret_cast<__m128i*>(rows + i * stride), _mm_castps_si128(row));
    };
    store(0, a);
    store(1, b);
    store(2, c);
    store(3, d);
}

namespace detail {
inline __m128i upper_lanes() {
    return _mm_set1_epi32(static_cast<int>(0xFFFF0000U));
}
/// Lane 0 of one, lane 1 of the other.
inline Quad mix(Quad low_from, Quad high_from) {
    return Quad(
        _mm_or_si128(_mm_andnot_si128(upper_lanes(), low_from.v), _mm_and_si128(upper_lanes(), high_from.v)));
}
/// (a0, -a1), wrapping.
inline Quad conjugate(Quad a) {
    return Quad(_mm_sub_epi16(_mm_xor_si128(a.v, upper_lanes()), upper_lanes()));
}
}  // namespace detail

inline Quad operator&(Quad a, Quad b) {
    return Quad(_mm_and_si128(a.v, b.v));
}
inline Quad swap(Quad a) {
    constexpr int kExchange = 0b10'11'00'01;
    return Quad(_mm_shufflehi_epi16(_mm_shufflelo_epi16(a.v, kExchange), kExchange));
}

namespace portable {  // beside the functions they overload

inline Quad add(Quad a, Quad b) {
    return Quad(_mm_add_epi16(a.v, b.v));
}
inline Quad sub(Quad a, Quad b) {
    return Quad(_mm_sub_epi16(a.v, b.v));
}
inline Quad smallest(Quad a, Quad b) {
    return Quad(_mm_min_epi16(a.v, b.v));
}
inline Quad largest(Quad a, Quad b) {
    return Quad(_mm_max_epi16(a.v, b.v));
}
inline Quad saturated_add(Quad a, Quad b) {
    return Quad(_mm_adds_epi16(a.v, b.v));
}
inline Quad saturated_sub(Quad a, Quad b) {
    return Quad(_mm_subs_epi16(a.v, b.v));
}
/// a + b = 2 (a and b) + (a xor b)
inline Quad half_add(Quad a, Quad b) {
    return Quad(_mm_add_epi16(_mm_and_si128(a.v, b.v), _mm_srai_epi16(_mm_xor_si128(a.v, b.v), 1)));
}
/// a - b = (a xor b) - 2 (b and not a)
inline Quad half_sub(Quad a, Quad b) {
    return Quad(_mm_sub_epi16(_mm_srai_epi16(_mm_xor_si128(a.v, b.v), 1), _mm_andnot_si128(a.v, b.v)));
}
inline Quad add_j(Quad a, Quad b) {
    return detail::mix(sub(a, swap(b)), add(a, swap(b)));
}
inline Quad sub_j(Quad a, Quad b) {
    return detail::mix(add(a, swap(b)), sub(a, swap(b)));
}
inline Quad half_add_j(Quad a, Quad b) {
    return detail::mix(half_sub(a, swap(b)), half_add(a, swap(b)));
}
inline Quad half_sub_j(Quad a, Quad b) {
    return detail::mix(half_add(a, swap(b)), half_sub(a, swap(b)));
}
inline Quad saturated_add_j(Quad a, Quad b) {
    return detail::mix(saturated_sub(a, swap(b)), saturated_add(a, swap(b)));
}
inline Quad saturated_sub_j(Quad a, Quad b) {
    return detail::mix(saturated_add(a, swap(b)), saturated_sub(a, swap(b)));
}
inline Quad pack_high(Sum4 lane_0, Sum4 lane_1) {
    return Quad(_mm_or_si128(_mm_srli_epi32(lane_0.v, 16), _mm_and_si128(lane_1.v, detail::upper_lanes())));
}
inline Quad pack_mixed(Quad low_from, Quad high_from) {
    return detail::mix(low_from, high_from);
}
inline Sum4 dot(Quad a, Quad b, Sum4 sum) {
    return Sum4(_mm_add_epi32(_mm_madd_epi16(a.v, b.v), sum.v));
}
/// The differences: lane 1 of b, or lane 0 of it, is not -2^15.
inline Sum4 dot_minus(Quad a, Quad b, Sum4 sum) {
    return dot(a, detail::conjugate(b), sum);
}
inline Sum4 dot_cross(Quad a, Quad b, Sum4 sum) {
    return dot(a, swap(b), sum);
}
inline Sum4 dot_cross_minus(Quad a, Quad b, Sum4 sum) {
    return dot(a, detail::conjugate(swap(b)), sum);
}
/// The same factors for all four.
inline Sum4 multiply_00(Quad a, Pair b, Sum4 sum) {
    return dot(a, b & 0xFFFFU, sum);
}
inline Sum4 multiply_10(Quad a, Pair b, Sum4 sum) {
    return dot(a, b << 16, sum);
}
inline Sum4 multiply_11(Quad a, Pair b, Sum4 sum) {
    return dot(a, b & 0xFFFF'0000U, sum);
}
/// A factor of 32 bits is whole * 2^16 + part, both signed: 16 bits of a product with it are those of two.
inline Quad scale_lanes(Quad a, std::int32_t factor_0, std::int32_t factor_1) {
    constexpr int kBoth0 = 0b00'00'00'00;
    constexpr int kLower = 0b10'00'10'00;
    constexpr int kUpper = 0b11'01'11'01;
    const __m128i factors = _mm_unpacklo_epi32(_mm_cvtsi32_si128(factor_0), _mm_cvtsi32_si128(factor_1));
    const __m128i rounded = _mm_add_epi32(factors, _mm_set1_epi32(1 << 15));
    const __m128i part = _mm_shuffle_epi32(_mm_shufflelo_epi16(factors, kLower), kBoth0);
    const __m128i whole = _mm_shuffle_epi32(_mm_shufflelo_epi16(rounded, kUpper), kBoth0);
    return Quad(_mm_add_epi16(_mm_mullo_epi16(a.v, whole), _mm_mulhi_epi16(a.v, part)));
}
/// Both lanes of each word times that word's factor, as scale_0 and scale_1, and the lower 16 bits of these.
inline Quad scale_words(Quad a, Sum4 factors) {
    constexpr int kLower = 0b10'10'00'00;
    constexpr int kUpper = 0b11'11'01'01;
    const __m128i rounded = _mm_add_epi32(factors.v, _mm_set1_epi32(1 << 15));
    const __m128i part = _mm_shufflehi_epi16(_mm_shufflelo_epi16(factors.v, kLower), kLower);
    const __m128i whole = _mm_shufflehi_epi16(_mm_shufflelo_epi16(rounded, kUpper), kUpper);
    return Quad(_mm_add_epi16(_mm_mullo_epi16(a.v, whole), _mm_mulhi_epi16(a.v, part)));
}
inline Quad both_lane0(Quad a, Quad b) {
    return detail::mix(a, Quad(_mm_slli_epi32(b.v, 16)));
}
inline Quad both_lane1(Quad a, Quad b) {
    return detail::mix(Quad(_mm_srli_epi32(a.v, 16)), b);
}
inline Quad mix_low(Sum4 upper_to_low, Quad high_from) {
    return both_lane1(Quad(upper_to_low.v), high_from);
}
inline Quad mix_high(Quad low_from, Sum4 upper_to_high) {
    return detail::mix(low_from, Quad(upper_to_high.v));
}
inline Quad upper_half(Sum4 sum) {
    return Quad(_mm_srli_epi32(sum.v, 16));
}
inline void store_pair(Quad* to, Quad first, Quad second) {
    to[0] = first;
    to[1] = second;
}
/// The four words to one.
template <class Combine>
Pair across_words(Quad a, Combine combine) {
    constexpr int kSwapHalves = 0b01'00'11'10;
    constexpr int kSwapNeighbours = 0b10'11'00'01;
    a = combine(a, Quad(_mm_shuffle_epi32(a.v, kSwapHalves)));
    a = combine(a, Quad(_mm_shuffle_epi32(a.v, kSwapNeighbours)));
    return static_cast<Pair>(_mm_cvtsi128_si32(a.v));
}
inline std::array<Quad, 8> load_8(const Quad* from) {
    return {from[0], from[1], from[2], from[3], from[4], from[5], from[6], from[7]};
}
inline std::array<Quad, 8> take_8(const Quad*& from) {
    const Quad* const words = from;
    from += 8;
    return load_8(words);
}

}  // namespace portable

}  // namespace dsp::packed
#endif
