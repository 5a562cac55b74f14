// Expected values: the C library's logarithms.
#include <cmath>

#include "dsp/log2.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(Log2){};

TEST(Log2, LogarithmIsWithinItsStatedError) {
    double worst = 0;
    for (std::uint32_t v = 1; v < 1U << 20; ++v) {
        worst = std::max(worst, std::abs(dsp::log2_q10(v) - 1024 * std::log2(static_cast<double>(v))));
    }
    for (std::uint64_t v = 1U << 20; v < 1ULL << 32; v += 40'009) {
        const auto x = static_cast<std::uint32_t>(v);
        worst = std::max(worst, std::abs(dsp::log2_q10(x) - 1024 * std::log2(static_cast<double>(x))));
    }
    CHECK(worst <= 0.7);
    LONGS_EQUAL(0, dsp::log2_q10(0));
    LONGS_EQUAL(31 * 1024, dsp::log2_q10(1U << 31));
    LONGS_EQUAL(32 * 1024, dsp::log2_q10(0xFFFFFFFFU));
}

TEST(Log2, CoarseLogarithmIsWithinItsStatedErrorAndNeverFalls) {
    double worst = 0;
    std::int32_t last = 0;
    const auto check = [&](std::uint32_t v) {
        const dsp::packed::Pair both = dsp::log2_coarse_q10(v, v ^ 1, dsp::log2_bias(0));
        const auto now = static_cast<std::int32_t>(both & 0xFFFF);
        worst = std::max(worst, std::abs(now - 1024 * std::log2(static_cast<double>(v))));
        CHECK(now >= last);
        last = now;
        if (v > 1)
            worst = std::max(worst, std::abs((both >> 16) - 1024 * std::log2(static_cast<double>(v ^ 1))));
    };
    for (std::uint32_t v = 1; v < 1U << 18; ++v) check(v);
    for (std::uint64_t v = 1U << 18; v < 1ULL << 32; v += 40'009) check(static_cast<std::uint32_t>(v));
    CHECK(worst <= 3.5);
}

TEST(Log2, CoarseLogarithmAddsAnOffsetAndEndsAtZero) {
    for (int offset = -66 * 1024; offset <= 32 * 1024; offset += 1021) {
        for (const double v : {0.0, 1.0, 77.0, 65536.0, 2147483648.0, 4294967295.0}) {
            const double exact = std::max(1024 * std::log2(v == 0 ? 0.5 : v) + offset, 0.0);
            const auto x = static_cast<std::uint32_t>(v);
            const dsp::packed::Pair both = dsp::log2_coarse_q10(x, 1U << 31, dsp::log2_bias(offset));
            DOUBLES_EQUAL(std::min(exact, 65535.0), both & 0xFFFF, 3.5);
            DOUBLES_EQUAL(std::max(31 * 1024 + offset, 0), both >> 16, 3.5);
        }
    }
}

TEST(Log2, LogarithmNeverFalls) {
    std::int32_t last = 0;
    for (std::uint32_t v = 1; v < 1U << 18; ++v) {
        const std::int32_t now = dsp::log2_q10(v);
        CHECK(now >= last);
        last = now;
    }
}

TEST(Log2, PowerIsWithinItsStatedError) {
    for (std::int32_t x = -33 * 1024; x <= 0; ++x) {
        const double exact = std::exp2(30 + x / 1024.0);
        const double got = dsp::exp2_q30(x);
        CHECK(std::abs(got - exact) <= std::max(1.0, 1e-4 * exact));
    }
}

TEST(Log2, DecibelsConvert) {
    for (int cdb = -2000; cdb <= 9000; cdb += 7) {
        DOUBLES_EQUAL(1024 * cdb / 1000.0 * std::log2(10.0), dsp::log2_from_cdb(cdb), 0.6);
    }
}
