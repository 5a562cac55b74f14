#include "tests/target/stages.hpp"

#include "target_board.hpp"

namespace target {

std::array<std::uint32_t, kStages> stage_instructions{};

namespace {

struct Visit {
    std::uint32_t stage;
    std::uint32_t begin;
    std::uint32_t return_to;
};
constexpr std::size_t kDeepest = 8;  ///< stages inside stages; four today
std::array<Visit, kDeepest> visits{};
std::size_t depth = 0;

}  // namespace

/// Called by the wrappers that wrap_stages.py writes, around a function of the firmware.
extern "C" void enter_stage(std::uint32_t stage, std::uint32_t return_to) {
    visits[depth] = {stage, 0, return_to};
    visits[depth++].begin = instructions();
}

/// Adds what the stage took to it, and takes it from the stage around it. Returns where the wrapper returns
/// to.
extern "C" std::uint32_t leave_stage() {
    const std::uint32_t now = instructions();
    const Visit& visit = visits[--depth];
    stage_instructions[visit.stage] += now - visit.begin;
    if (depth > 0) stage_instructions[visits[depth - 1].stage] -= now - visit.begin;
    return visit.return_to;
}

}  // namespace target
