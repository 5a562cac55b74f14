#include "tests/target/stages.hpp"

#include "target_board.hpp"

// Both return at once; the first has a wrapper of its own. By wrap_stages.py.
extern "C" void wrapped_nothing();
extern "C" void plain_nothing();

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

/// Instructions that a wrapper adds to its own stage and to the stage around it.
std::uint32_t added_inside = 0;
std::uint32_t added_outside = 0;
std::uint32_t visited = 0;

/// Instructions of a number of calls. The time between them changes, so that the grain of the counter evens
/// out.
std::uint32_t calls(void (*function)(), std::uint32_t number) {
    const std::uint32_t begin = instructions();
    for (std::uint32_t i = 0; i < number; ++i) {
        for (std::uint32_t wait = i % 40; wait > 0; --wait) asm volatile("nop");
        function();
    }
    return instructions() - begin;
}

}  // namespace

void calibrate_stages() {
    constexpr std::uint32_t kCalls = 4000;
    added_inside = added_outside = 0;
    stage_instructions = {};
    visits[0] = {};  // nearly all visits are inside another stage's
    depth = 1;
    const std::uint32_t both = calls(wrapped_nothing, kCalls) - calls(plain_nothing, kCalls);
    const std::uint32_t inside = instructions_of(Stage::rest);
    added_inside = (inside + kCalls / 2) / kCalls;
    added_outside = (both - inside + kCalls / 2) / kCalls;
    visited = 0;
    depth = 0;
}

std::uint32_t take_wrapper_instructions() {
    const std::uint32_t number = visited;
    visited = 0;
    return number * (added_inside + added_outside);
}

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
    const std::uint32_t took = now - visit.begin;
    ++visited;
    stage_instructions[visit.stage] += took - added_inside;
    if (depth > 0) stage_instructions[visits[depth - 1].stage] -= took + added_outside;
    return visit.return_to;
}

}  // namespace target
