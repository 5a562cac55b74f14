/// Why the last run ended, told to the next one.
#pragma once

#include <cstdint>
#include <string_view>

namespace hal {

/// Values are part of what survives a reset; new ones go at the end.
enum class ResetCause : std::uint8_t {
    power_on = 0,  ///< no record: the memory had lost its contents
    external = 1,  ///< a reset from outside while the program ran: button, debugger, supply dip
    watchdog = 2,
    undefined_instruction = 3,
    supervisor_call = 4,
    prefetch_abort = 5,
    data_abort = 6,
    hard_fault = 7,
    unexpected_interrupt = 8,
    aborted = 9,  ///< abort, pure virtual call, or main returned
};

std::string_view to_string(ResetCause cause);

struct ResetRecord {
    ResetCause cause = ResetCause::power_on;
    std::uint32_t pc = 0;       ///< where the processor was; 0: unknown
    std::uint32_t status = 0;   ///< fault status register: DFSR or IFSR (R5), CFSR (M)
    std::uint32_t address = 0;  ///< fault address register: DFAR or IFAR (R5), BFAR (M)
};

/// What the last run left, and from now on "running", so that a reset without a word is noticed.
ResetRecord begin_reset_record();

/// Leaves the record to the next run. Memory that start-up code does not touch holds it, with a check word.
void write_reset_record(const ResetRecord& record);

/// The board's: records why (in registers that survive more than its memory does, where there are some) and
/// resets.
[[noreturn]] void reset_board(const ResetRecord& record);

}  // namespace hal
