/// Two 16-bit numbers in a word, as the DSP instructions of Cortex-M4, M7 and R take them; elsewhere a twin
/// with the same bits. Lane 0 is bits 15..0, lane 1 bits 31..16: the real and the imaginary part of a
/// Complex16.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>

#include "dsp/fixed_point.hpp"

#if defined(__ARM_FEATURE_SIMD32) && defined(__ARM_FEATURE_DSP)
#include <arm_acle.h>
#define DSP_PACKED_INTRINSICS 1
#else
#define DSP_PACKED_INTRINSICS 0
#endif

namespace dsp::packed {

using Pair = std::uint32_t;

constexpr std::int32_t lane0(Pair a) {
    return static_cast<std::int16_t>(a & 0xFFFFU);
}
constexpr std::int32_t lane1(Pair a) {
    return static_cast<std::int16_t>(a >> 16);
}
constexpr Pair pack(std::int32_t lane_0, std::int32_t lane_1) {
    return (static_cast<std::uint32_t>(lane_0) & 0xFFFFU) | static_cast<std::uint32_t>(lane_1) << 16;
}
/// Two samples next to each other in memory; boards and PCs alike are little-endian.
template <class T>
Pair load(const T* samples) {
    static_assert(sizeof(T) == 2 && std::endian::native == std::endian::little);
    Pair pair;
    std::memcpy(&pair, samples, sizeof pair);
    return pair;
}
template <class T>
void store(T* samples, Pair pair) {
    static_assert(sizeof(T) == 2);
    std::memcpy(samples, &pair, sizeof pair);
}
constexpr Pair both(std::uint16_t a) {
    return a | std::uint32_t{a} << 16;
}
constexpr Pair swap(Pair a) {
    return a << 16 | a >> 16;
}

/// The instructions in plain arithmetic, named as the functions below. Lanes and 32-bit sums wrap.
namespace portable {
constexpr std::int32_t wrap(std::int64_t v) {
    return static_cast<std::int32_t>(static_cast<std::uint32_t>(v & 0xFFFFFFFF));
}
constexpr std::int64_t product(std::int32_t a, std::int32_t b) {
    return std::int64_t{a} * b;
}
constexpr Pair add(Pair a, Pair b) {
    return pack(lane0(a) + lane0(b), lane1(a) + lane1(b));
}
constexpr Pair sub(Pair a, Pair b) {
    return pack(lane0(a) - lane0(b), lane1(a) - lane1(b));
}
constexpr Pair half_add(Pair a, Pair b) {
    return pack((lane0(a) + lane0(b)) >> 1, (lane1(a) + lane1(b)) >> 1);
}
constexpr Pair half_sub(Pair a, Pair b) {
    return pack((lane0(a) - lane0(b)) >> 1, (lane1(a) - lane1(b)) >> 1);
}
constexpr Pair add_j(Pair a, Pair b) {
    return pack(lane0(a) - lane1(b), lane1(a) + lane0(b));
}
constexpr Pair sub_j(Pair a, Pair b) {
    return pack(lane0(a) + lane1(b), lane1(a) - lane0(b));
}
constexpr Pair half_add_j(Pair a, Pair b) {
    return pack((lane0(a) - lane1(b)) >> 1, (lane1(a) + lane0(b)) >> 1);
}
constexpr Pair half_sub_j(Pair a, Pair b) {
    return pack((lane0(a) + lane1(b)) >> 1, (lane1(a) - lane0(b)) >> 1);
}
constexpr Pair saturated_add(Pair a, Pair b) {
    return pack(saturate16(lane0(a) + lane0(b)), saturate16(lane1(a) + lane1(b)));
}
constexpr Pair saturated_sub(Pair a, Pair b) {
    return pack(saturate16(lane0(a) - lane0(b)), saturate16(lane1(a) - lane1(b)));
}
constexpr Pair saturated_add_j(Pair a, Pair b) {
    return pack(saturate16(lane0(a) - lane1(b)), saturate16(lane1(a) + lane0(b)));
}
constexpr Pair saturated_sub_j(Pair a, Pair b) {
    return pack(saturate16(lane0(a) + lane1(b)), saturate16(lane1(a) - lane0(b)));
}
constexpr Pair largest(Pair a, Pair b) {
    return pack(lane0(a) > lane0(b) ? lane0(a) : lane0(b), lane1(a) > lane1(b) ? lane1(a) : lane1(b));
}
constexpr Pair smallest(Pair a, Pair b) {
    return pack(lane0(a) < lane0(b) ? lane0(a) : lane0(b), lane1(a) < lane1(b) ? lane1(a) : lane1(b));
}
constexpr Pair pack_low(std::int32_t lane_0, std::int32_t lane_1) {
    return pack(lane_0, lane_1);
}
constexpr Pair pack_high(std::int32_t lane_0, std::int32_t lane_1) {
    return pack(lane_0 >> 16, lane_1 >> 16);
}
constexpr Pair pack_mixed(Pair low_from, Pair high_from) {
    return pack(lane0(low_from), lane1(high_from));
}
constexpr Pair at_least(Pair a, Pair b) {
    return ((a & 0xFFFFU) >= (b & 0xFFFFU) ? 1U : 0U) | (a >> 16 >= b >> 16 ? 0x10000U : 0U);
}
constexpr void order(Pair& low, Pair& high) {
    const Pair swapped = 0xFFFFU * at_least(low, high);
    const Pair change = (low ^ high) & swapped;
    low ^= change;
    high ^= change;
}
constexpr std::uint32_t high_bytes(Pair a, Pair b) {
    return (a & 0xFF00'FF00U) | (b >> 8 & 0x00FF'00FFU);
}
constexpr std::uint32_t bytes_at_least(std::uint32_t a, std::uint32_t b) {
    constexpr std::uint32_t kTops = 0x80808080U;
    const std::uint32_t lower_bits =
        (a | kTops) - (b & ~kTops);  // a byte's top stays where it does not borrow
    return ((a & ~b) | (~(a ^ b) & lower_bits)) >> 7 & 0x01010101U;
}
constexpr std::uint32_t reverse_bits(std::uint32_t a) {
    std::uint32_t result = 0;
    for (int i = 0; i < 32; ++i) result |= (a >> i & 1U) << (31 - i);
    return result;
}
constexpr std::int32_t dot(Pair a, Pair b, std::int32_t sum) {
    return wrap(product(lane0(a), lane0(b)) + product(lane1(a), lane1(b)) + sum);
}
constexpr std::int32_t dot(Pair a, Pair b) {
    return dot(a, b, 0);
}
constexpr std::int32_t dot_minus(Pair a, Pair b, std::int32_t sum) {
    return wrap(product(lane0(a), lane0(b)) - product(lane1(a), lane1(b)) + sum);
}
constexpr std::int32_t dot_cross(Pair a, Pair b, std::int32_t sum) {
    return wrap(product(lane0(a), lane1(b)) + product(lane1(a), lane0(b)) + sum);
}
constexpr std::int32_t dot_cross_minus(Pair a, Pair b, std::int32_t sum) {
    return wrap(product(lane0(a), lane1(b)) - product(lane1(a), lane0(b)) + sum);
}
constexpr std::int32_t multiply_00(Pair a, Pair b, std::int32_t sum) {
    return wrap(product(lane0(a), lane0(b)) + sum);
}
constexpr std::int32_t multiply_01(Pair a, Pair b, std::int32_t sum) {
    return wrap(product(lane0(a), lane1(b)) + sum);
}
constexpr std::int32_t multiply_11(Pair a, Pair b, std::int32_t sum) {
    return wrap(product(lane1(a), lane1(b)) + sum);
}
constexpr std::int32_t multiply_10(Pair a, Pair b, std::int32_t sum) {
    return wrap(product(lane1(a), lane0(b)) + sum);
}
constexpr std::int32_t scale_0(std::int32_t a, Pair b) {
    return static_cast<std::int32_t>(product(a, lane0(b)) >> 16);
}
constexpr std::int32_t scale_1(std::int32_t a, Pair b) {
    return static_cast<std::int32_t>(product(a, lane1(b)) >> 16);
}
constexpr std::int32_t scale_add_0(std::int32_t a, Pair b, std::int32_t sum) {
    return wrap(std::int64_t{scale_0(a, b)} + sum);
}
constexpr std::int32_t scale_add_1(std::int32_t a, Pair b, std::int32_t sum) {
    return wrap(std::int64_t{scale_1(a, b)} + sum);
}
constexpr Pair scale_lanes(Pair a, std::int32_t factor_0, std::int32_t factor_1) {
    return pack(scale_0(factor_0, a), scale_1(factor_1, a));
}
constexpr Pair both_lane0(Pair a, Pair b) {
    return pack(lane0(a), lane0(b));
}
constexpr Pair both_lane1(Pair a, Pair b) {
    return pack(lane1(a), lane1(b));
}
constexpr Pair mix_low(std::int32_t upper_to_low, Pair high_from) {
    return pack(upper_to_low >> 16, lane1(high_from));
}
constexpr Pair mix_high(Pair low_from, std::int32_t upper_to_high) {
    return pack(lane0(low_from), upper_to_high >> 16);
}
constexpr Pair upper_half(std::int32_t sum) {
    return static_cast<Pair>(sum) >> 16;
}
constexpr Pair floored_sub(Pair a, Pair b) {
    const auto lane = [](Pair x, Pair y) { return x > y ? x - y : 0U; };
    return lane(a & 0xFFFFU, b & 0xFFFFU) | lane(a >> 16, b >> 16) << 16;
}
constexpr void sort(Pair& a, Pair& b) {
    const Pair low = smallest(a, b);
    b = largest(a, b);
    a = low;
}
constexpr std::uint32_t left_aligned(std::uint32_t v, int zeros) {
    return zeros < 32 ? v << zeros : 0;
}
constexpr std::uint32_t multiply_add(std::uint32_t a, std::uint32_t b, std::uint32_t sum) {
    return a * b + sum;
}
template <class T>
void load_pair(const T* from, Pair& first, Pair& second) {
    static_assert(4 % sizeof(T) == 0);
    std::memcpy(&first, from, sizeof first);
    std::memcpy(&second, from + sizeof first / sizeof(T), sizeof second);
}
template <class T>
void load_four(const T* from, Pair& a, Pair& b, Pair& c, Pair& d) {
    load_pair(from, a, b);
    load_pair(from + 2 * sizeof a / sizeof(T), c, d);
}
template <class T>
void take_four(const T*& from, Pair& a, Pair& b, Pair& c, Pair& d) {
    load_four(from, a, b, c, d);
    from += 4 * sizeof a / sizeof(T);
}
template <class T>
void take_four_beside(const T*& from, Pair& a, Pair& b, Pair& c, Pair& d) {
    take_four(from, a, b, c, d);
}
template <class T>
void put_four(T*& to, Pair a, Pair b, Pair c, Pair d) {
    const std::array<Pair, 4> words{a, b, c, d};
    std::memcpy(static_cast<void*>(to), words.data(), sizeof words);
    to += sizeof words / sizeof(T);
}
template <class T>
void store_pair(T* to, Pair first, Pair second) {
    static_assert(4 % sizeof(T) == 0);
    std::memcpy(static_cast<void*>(to), &first, sizeof first);
    std::memcpy(static_cast<void*>(to + sizeof first / sizeof(T)), &second, sizeof second);
}
inline std::array<Pair, 8> load_8(const Pair* from) {
    std::array<Pair, 8> words;
    std::memcpy(words.data(), from, sizeof words);
    return words;
}
template <class T>
void put_pair(T*& to, Pair first, Pair second) {
    store_pair(to, first, second);
    to += 2 * sizeof first / sizeof(T);
}
template <class T>
std::array<Pair, 8> take_8(const T*& from) {
    static_assert(4 % sizeof(T) == 0);
    std::array<Pair, 8> words;
    std::memcpy(words.data(), from, sizeof words);
    from += sizeof words / sizeof(T);
    return words;
}
inline void take_pair(const Pair*& from, Pair& first, Pair& second) {
    load_pair(from, first, second);
    from += 2;
}
template <class T>
constexpr T in_register(T a) {
    return a;
}
}  // namespace portable

#if DSP_PACKED_INTRINSICS
/// Lane by lane, wrapping.
inline Pair add(Pair a, Pair b) {
    return static_cast<Pair>(__sadd16(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b)));
}
inline Pair sub(Pair a, Pair b) {
    return static_cast<Pair>(__ssub16(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b)));
}
/// (a + b) / 2 lane by lane, rounded down; cannot overflow.
inline Pair half_add(Pair a, Pair b) {
    return static_cast<Pair>(__shadd16(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b)));
}
inline Pair half_sub(Pair a, Pair b) {
    return static_cast<Pair>(__shsub16(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b)));
}
/// a + j b and a - j b, wrapping.
inline Pair add_j(Pair a, Pair b) {
    return static_cast<Pair>(__sasx(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b)));
}
inline Pair sub_j(Pair a, Pair b) {
    return static_cast<Pair>(__ssax(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b)));
}
/// Half of them, rounded down.
inline Pair half_add_j(Pair a, Pair b) {
    return static_cast<Pair>(__shasx(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b)));
}
inline Pair half_sub_j(Pair a, Pair b) {
    return static_cast<Pair>(__shsax(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b)));
}
/// Clamped to 16 bits.
inline Pair saturated_add(Pair a, Pair b) {
    return static_cast<Pair>(__qadd16(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b)));
}
inline Pair saturated_sub(Pair a, Pair b) {
    return static_cast<Pair>(__qsub16(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b)));
}
/// a + j b and a - j b, clamped to 16 bits.
inline Pair saturated_add_j(Pair a, Pair b) {
    return static_cast<Pair>(__qasx(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b)));
}
inline Pair saturated_sub_j(Pair a, Pair b) {
    return static_cast<Pair>(__qsax(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b)));
}
/// Lane by lane, of signed numbers.
inline Pair largest(Pair a, Pair b) {
    (void)__ssub16(static_cast<int16x2_t>(a),
                   static_cast<int16x2_t>(b));  // its flags are what __sel looks at
    return __sel(a, b);
}
inline Pair smallest(Pair a, Pair b) {
    (void)__ssub16(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b));
    return __sel(b, a);
}
/// The low and the high halves of two words. No intrinsic exists, and gcc 12 does not find the instructions.
inline Pair pack_low(std::int32_t lane_0, std::int32_t lane_1) {
    Pair result;
    asm("pkhbt %0, %1, %2, lsl #16" : "=r"(result) : "r"(lane_0), "r"(lane_1));
    return result;
}
inline Pair pack_high(std::int32_t lane_0, std::int32_t lane_1) {
    Pair result;
    asm("pkhtb %0, %1, %2, asr #16" : "=r"(result) : "r"(lane_1), "r"(lane_0));
    return result;
}
/// Lane 0 of one, lane 1 of the other.
inline Pair pack_mixed(Pair low_from, Pair high_from) {
    Pair result;
    asm("pkhbt %0, %1, %2" : "=r"(result) : "r"(low_from), "r"(high_from));
    return result;
}
/// One in each lane where a >= b, both unsigned; else zero.
inline Pair at_least(Pair a, Pair b) {
    (void)__usub16(a, b);  // sets a flag for each byte that does not borrow
    return __sel(0x00010001U, 0U);
}
/// Lane by lane, of unsigned numbers: the smaller to `low`, the larger to `high`.
inline void order(Pair& low, Pair& high) {
    (void)__usub16(low, high);
    const Pair larger = __sel(low, high);
    low = __sel(high, low);
    high = larger;
}
/// The high bytes of four lanes: those of `a` in bytes 1 and 3, those of `b` in bytes 0 and 2.
inline std::uint32_t high_bytes(Pair a, Pair b) {
    std::uint32_t result;
    asm("uxtab16 %0, %1, %2, ror #8" : "=r"(result) : "r"(a & 0xFF00'FF00U), "r"(b));
    return result;
}
/// One in each byte where a >= b, both unsigned; else zero.
inline std::uint32_t bytes_at_least(std::uint32_t a, std::uint32_t b) {
    (void)__usub8(a, b);
    return __sel(0x01010101U, 0U);
}
/// Bit 31 becomes bit 0 and so on.
inline std::uint32_t reverse_bits(std::uint32_t a) {
    std::uint32_t result;
    asm("rbit %0, %1" : "=r"(result) : "r"(a));
    return result;
}
/// sum + a0 b0 + a1 b1
inline std::int32_t dot(Pair a, Pair b, std::int32_t sum) {
    return __smlad(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b), sum);
}
/// a0 b0 + a1 b1
inline std::int32_t dot(Pair a, Pair b) {
    return __smuad(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b));
}
/// sum + a0 b0 - a1 b1
inline std::int32_t dot_minus(Pair a, Pair b, std::int32_t sum) {
    return __smlsd(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b), sum);
}
/// sum + a0 b1 + a1 b0
inline std::int32_t dot_cross(Pair a, Pair b, std::int32_t sum) {
    return __smladx(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b), sum);
}
/// sum + a0 b1 - a1 b0
inline std::int32_t dot_cross_minus(Pair a, Pair b, std::int32_t sum) {
    return __smlsdx(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b), sum);
}
/// sum + a0 b0, sum + a1 b0 and so on
inline std::int32_t multiply_00(Pair a, Pair b, std::int32_t sum) {
    return __smlabb(static_cast<std::int32_t>(a), static_cast<std::int32_t>(b), sum);
}
inline std::int32_t multiply_01(Pair a, Pair b, std::int32_t sum) {
    return __smlabt(static_cast<std::int32_t>(a), static_cast<std::int32_t>(b), sum);
}
inline std::int32_t multiply_11(Pair a, Pair b, std::int32_t sum) {
    return __smlatt(static_cast<std::int32_t>(a), static_cast<std::int32_t>(b), sum);
}
inline std::int32_t multiply_10(Pair a, Pair b, std::int32_t sum) {
    return __smlatb(static_cast<std::int32_t>(a), static_cast<std::int32_t>(b), sum);
}
/// a times a lane of b, its upper 32 of 48 bits, rounded down
inline std::int32_t scale_0(std::int32_t a, Pair b) {
    std::int32_t result;
    asm("smulwb %0, %1, %2" : "=r"(result) : "r"(a), "r"(b));
    return result;
}
inline std::int32_t scale_1(std::int32_t a, Pair b) {
    std::int32_t result;
    asm("smulwt %0, %1, %2" : "=r"(result) : "r"(a), "r"(b));
    return result;
}
/// The same added to a sum.
inline std::int32_t scale_add_0(std::int32_t a, Pair b, std::int32_t sum) {
    std::int32_t result;
    asm("smlawb %0, %1, %2, %3" : "=r"(result) : "r"(a), "r"(b), "r"(sum));
    return result;
}
inline std::int32_t scale_add_1(std::int32_t a, Pair b, std::int32_t sum) {
    std::int32_t result;
    asm("smlawt %0, %1, %2, %3" : "=r"(result) : "r"(a), "r"(b), "r"(sum));
    return result;
}
/// Each lane times a factor of its own, the upper 32 of 48 bits, rounded down; of these the lower 16.
inline Pair scale_lanes(Pair a, std::int32_t factor_0, std::int32_t factor_1) {
    return pack_low(scale_0(factor_0, a), scale_1(factor_1, a));
}
/// Lane 0 of both words; lane 1 of both.
inline Pair both_lane0(Pair a, Pair b) {
    return pack_low(static_cast<std::int32_t>(a), static_cast<std::int32_t>(b));
}
inline Pair both_lane1(Pair a, Pair b) {
    return pack_high(static_cast<std::int32_t>(a), static_cast<std::int32_t>(b));
}
/// One lane of a word, the upper half of a sum in the other.
inline Pair mix_low(std::int32_t upper_to_low, Pair high_from) {
    return pack_high(upper_to_low, static_cast<std::int32_t>(high_from));
}
inline Pair mix_high(Pair low_from, std::int32_t upper_to_high) {
    return pack_mixed(low_from, static_cast<Pair>(upper_to_high));
}
/// The upper half of a sum in lane 0, zero in lane 1.
inline Pair upper_half(std::int32_t sum) {
    return static_cast<Pair>(sum) >> 16;
}
/// a - b lane by lane, both unsigned, not below zero
inline Pair floored_sub(Pair a, Pair b) {
    return __uqsub16(a, b);
}
/// The smaller of the two numbers of each lane to a, the larger to b: one comparison for both.
inline void sort(Pair& a, Pair& b) {
    (void)__ssub16(static_cast<int16x2_t>(a), static_cast<int16x2_t>(b));
    const Pair low = __sel(b, a);
    b = __sel(a, b);
    a = low;
}
/// v times 2^zeros, 0..32: by all 32 too, which a shift in C++ must not.
inline std::uint32_t left_aligned(std::uint32_t v, int zeros) {
    std::uint32_t result;
    asm("lsl %0, %1, %2" : "=r"(result) : "r"(v), "r"(zeros));
    return result;
}
/// Two words next to each other, aligned to four bytes, with one instruction. The compiler takes it for words
/// aligned to eight only.
template <class T>
void load_pair(const T* from, Pair& first, Pair& second) {
    static_assert(4 % sizeof(T) == 0);
    using Words [[gnu::may_alias, gnu::aligned(1)]] = std::uint64_t;
    asm("ldrd %0, %1, %2" : "=r"(first), "=r"(second) : "o"(*reinterpret_cast<const Words*>(from)));
}
/// Four words next to each other; take_four and put_four leave the pointer behind them. One instruction,
/// which wants its registers in order.
template <class T>
void load_four(const T* from, Pair& a, Pair& b, Pair& c, Pair& d) {
    static_assert(4 % sizeof(T) == 0);
    register Pair a_in asm("r3");
    register Pair b_in asm("r4");
    register Pair c_in asm("r5");
    register Pair d_in asm("r6");
    asm volatile("ldmia %4, {%0, %1, %2, %3}"
                 : "=r"(a_in), "=r"(b_in), "=r"(c_in), "=r"(d_in)
                 : "r"(from)
                 : "memory");
    a = a_in;
    b = b_in;
    c = c_in;
    d = d_in;
}
template <class T>
void take_four(const T*& from, Pair& a, Pair& b, Pair& c, Pair& d) {
    static_assert(4 % sizeof(T) == 0);
    register Pair a_in asm("r3");
    register Pair b_in asm("r4");
    register Pair c_in asm("r5");
    register Pair d_in asm("r6");
    asm volatile("ldmia %4!, {%0, %1, %2, %3}"
                 : "=r"(a_in), "=r"(b_in), "=r"(c_in), "=r"(d_in), "+r"(from)
                 :
                 : "memory");
    a = a_in;
    b = b_in;
    c = c_in;
    d = d_in;
}
/// The same in other registers, so that four from load_four stay where they are.
template <class T>
void take_four_beside(const T*& from, Pair& a, Pair& b, Pair& c, Pair& d) {
    static_assert(4 % sizeof(T) == 0);
    register Pair a_in asm("r8");
    register Pair b_in asm("r9");
    register Pair c_in asm("r10");
    register Pair d_in asm("r11");
    asm volatile("ldmia %4!, {%0, %1, %2, %3}"
                 : "=r"(a_in), "=r"(b_in), "=r"(c_in), "=r"(d_in), "+r"(from)
                 :
                 : "memory");
    a = a_in;
    b = b_in;
    c = c_in;
    d = d_in;
}
template <class T>
void put_four(T*& to, Pair a, Pair b, Pair c, Pair d) {
    static_assert(4 % sizeof(T) == 0);
    register Pair a_in asm("r3") = a;
    register Pair b_in asm("r4") = b;
    register Pair c_in asm("r5") = c;
    register Pair d_in asm("r6") = d;
    asm volatile("stmia %0!, {%1, %2, %3, %4}"
                 : "+r"(to)
                 : "r"(a_in), "r"(b_in), "r"(c_in), "r"(d_in)
                 : "memory");
}
/// Two words, as load_pair.
template <class T>
void store_pair(T* to, Pair first, Pair second) {
    static_assert(4 % sizeof(T) == 0);
    using Words [[gnu::may_alias, gnu::aligned(1)]] = std::uint64_t;
    asm("strd %1, %2, %0" : "=o"(*reinterpret_cast<Words*>(to)) : "r"(first), "r"(second));
}
/// The same; the pointer then points behind them.
template <class T>
void put_pair(T*& to, Pair first, Pair second) {
    static_assert(4 % sizeof(T) == 0);
    asm volatile("strd %1, %2, [%0], #8" : "+r"(to) : "r"(first), "r"(second) : "memory");
}
/// a b + sum in 32 bits. The compiler adds what sums share first, and one instruction becomes two.
inline std::uint32_t multiply_add(std::uint32_t a, std::uint32_t b, std::uint32_t sum) {
    std::uint32_t result;
    asm("mla %0, %1, %2, %3" : "=r"(result) : "r"(a), "r"(b), "r"(sum));
    return result;
}
/// Eight words next to each other. The compiler uses such an instruction for copies only.
inline std::array<Pair, 8> load_8(const Pair* from) {
    register Pair a asm("r4");
    register Pair b asm("r5");
    register Pair c asm("r6");
    register Pair d asm("r8");
    register Pair e asm("r9");
    register Pair f asm("r10");
    register Pair g asm("r11");
    register Pair h asm("r12");
    asm("ldmia %8, {r4, r5, r6, r8, r9, r10, r11, r12}"
        : "=r"(a), "=r"(b), "=r"(c), "=r"(d), "=r"(e), "=r"(f), "=r"(g), "=r"(h)
        : "r"(from), "m"(*reinterpret_cast<const std::array<Pair, 8>*>(from)));
    return {a, b, c, d, e, f, g, h};
}
/// The same; the pointer then points behind them.
template <class T>
std::array<Pair, 8> take_8(const T*& from) {
    static_assert(4 % sizeof(T) == 0);
    register Pair a asm("r4");
    register Pair b asm("r5");
    register Pair c asm("r6");
    register Pair d asm("r8");
    register Pair e asm("r9");
    register Pair f asm("r10");
    register Pair g asm("r11");
    register Pair h asm("r12");
    asm volatile("ldmia %8!, {r4, r5, r6, r8, r9, r10, r11, r12}"
                 : "=r"(a), "=r"(b), "=r"(c), "=r"(d), "=r"(e), "=r"(f), "=r"(g), "=r"(h), "+r"(from)
                 :
                 : "memory");
    return {a, b, c, d, e, f, g, h};
}
/// a, of which the compiler does not know what it is: a constant stays in a register through a loop.
template <class T>
T in_register(T a) {
    asm("" : "+r"(a));
    return a;
}
/// The next two of a table, in words.
inline void take_pair(const Pair*& from, Pair& first, Pair& second) {
    asm("ldrd %0, %1, [%2], #8" : "=&r"(first), "=&r"(second), "+r"(from) : : "memory");
}
#else
using namespace portable;
#endif

/// As wide as the widest magnitude of the two lanes, in bits 16..31 and (with bit 0 wrong) 0..15: for a cheap
/// "or" over many pairs.
constexpr Pair spread(Pair a) {
    return a ^ a << 1;
}
/// Magnitude bits of an "or" of spread(): every lane is within -2^bits .. 2^bits - 1; 1..15.
constexpr int magnitude_bits(Pair spreads) {
    return static_cast<int>(std::bit_width((spreads >> 16) | (spreads & 0xFFFFU) | 2U)) - 1;
}

}  // namespace dsp::packed
