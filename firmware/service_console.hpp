/// What a person at the serial line sees: banner, a status line a second, counters on request.
#pragma once

#include <cstdint>
#include <string_view>

#include "firmware/radar.hpp"
#include "hal/contract/board.hpp"

namespace firmware {

/// What only the board knows. Text must outlive the call.
struct BoardFacts {
    std::string_view name;
    std::string_view last_run_ended_by;  ///< "power on", "watchdog", "data abort", ...
    std::uint32_t fault_pc = 0;          ///< of a fault; 0: none or unknown
    std::uint32_t fault_status = 0;
    std::uint32_t fault_address = 0;
    std::uint32_t rom_bytes = 0;
    std::uint32_t static_ram_bytes = 0;
    std::uint32_t stack_bytes = 0;
};

class ServiceConsole {
  public:
    ServiceConsole(const Radar& radar, const hal::Board& board) : radar_(radar), board_(board) {}

    /// Version, waveform, memory and why the last run ended. Once, at start.
    void banner(const BoardFacts& facts);

    /// After each cycle: answers at most one character typed, and every kCyclesPerStatus cycles prints the
    /// status line. `stack_used_bytes`: most that was ever used.
    void poll(std::uint32_t stack_used_bytes);

  private:
    static constexpr std::uint32_t kCyclesPerStatus = 10;  ///< a second

    void status(std::uint32_t stack_used_bytes);
    void tracks();
    void counters();
    void help();

    const Radar& radar_;
    hal::Board board_;
    std::uint32_t since_status_ = 0;
};

}  // namespace firmware
