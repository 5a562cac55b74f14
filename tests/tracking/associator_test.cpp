// Names by hand; every associator on rows with nothing in them and on one certain pair.
#include <array>
#include <memory>
#include <string_view>

#include "tracking/associator.hpp"

#include <CppUTest/TestHarness.h>

using dsp::Real;
using tracking::Associator;
using tracking::associator_chosen;

TEST_GROUP(AssociatorNames){};

TEST(AssociatorNames, EveryNameIsFoundAgain) {
    for (std::size_t i = 0; i < tracking::kAssociatorNames.size(); ++i) {
        const auto a = static_cast<Associator>(i);
        CHECK(tracking::associator_named(tracking::name_of(a)) == a);
        CHECK(associator_chosen(tracking::name_of(a))->associator == a);
    }
    CHECK(tracking::name_of(Associator::imm_pdaf) == "imm-pdaf");
    CHECK(tracking::kLastAssociator == Associator::imm_pdaf);
    CHECK(!tracking::associator_named("kalman"));
}

TEST(AssociatorNames, LevelAfterAColon) {
    const auto choice = associator_chosen("ijipda:12");
    CHECK(choice && choice->associator == Associator::ijipda && choice->level == 12);
    CHECK(!associator_chosen("ijipda")->level);
    for (const std::string_view wrong :
         {"ijipda:", "ijipda:x", "ijipda:-1", "ijipda:32", "ijipda:100", "pda:1", ":1", ""})
        CHECK(!associator_chosen(wrong));
}

TEST(AssociatorNames, EachSaysTheSameOfAnEmptyGateAndOfOneClearEcho) {
    const auto work = std::make_unique<tracking::AssociatorWorkspace<Real>>();
    for (std::size_t i = 0; i < tracking::kAssociatorNames.size(); ++i) {
        std::array<tracking::AssociationRow<Real>, 2> rows{};
        for (auto& row : rows) row.log_missed = tracking::ln(Real::ratio(1, 10));
        rows[1].count = 1;
        rows[1].item[0].log_ratio = Real(9);
        std::array<Real, 2> existence{Real::ratio(1, 2), Real::ratio(1, 2)};
        const std::array<Real, 1> strength{Real(20)};
        std::array<tracking::RankInput<Real>, 2> rank{};
        rank[1] = {.log_gate_clutter = Real(-5), .log_spread = Real(4)};
        tracking::associate<Real>(rows, {existence, strength, rank}, static_cast<Associator>(i), {}, {},
                                  *work);
        // psi (1-q) / (1 - q psi) = .05 / .55; and odds of e^9.
        DOUBLES_EQUAL(0.0909091, existence[0].raw() / 4194304.0, 1e-5);
        CHECK(existence[1] > Real::ratio(999, 1000));
        CHECK(rows[0].missed_weight == Real(1) && rows[0].missed == Real(1));
        CHECK(rows[1].item[0].weight > Real::ratio(99, 100));
    }
}
