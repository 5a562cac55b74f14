// Provokes one fault after the other; each must be recorded, reset the board, and be told by the next start.
// Exit code 0 when all were.
#include <cstdint>

#include "hal/bare_metal/reset_record.hpp"
#include "fault_board.hpp"
#include "tests/target/semihosting.hpp"

extern "C" const char undefined_here[];
extern "C" [[noreturn]] void abort();

namespace {

using hal::ResetCause;

/// The Thumb bit is no part of an address.
std::uint32_t address_of(const char* label) {
    return reinterpret_cast<std::uintptr_t>(label) & ~1U;
}

[[gnu::noinline]] void undefined_instruction() {
    asm volatile(
        ".global undefined_here\n"
        "undefined_here: udf #0");
}

[[noreturn]] void fail(const hal::ResetRecord& record) {
    target::say("unexpected: ", hal::to_string(record.cause), record.pc);
    semihosting::exit(1);
}

}  // namespace

int main() {
    target::start();
    const hal::ResetRecord last = target::last_record();
    target::say("last run ended by: ", hal::to_string(last.cause), last.pc);
    if (last.cause == ResetCause::power_on) undefined_instruction();
    if (last.cause == target::kUndefined) {
        if (last.pc != address_of(undefined_here)) fail(last);
        target::second_fault();
    }
    if (last.cause == target::kSecond) abort();
    if (last.cause == ResetCause::aborted) semihosting::exit(0);
    fail(last);
}
