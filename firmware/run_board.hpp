/// What every board's main does once its devices run.
#pragma once

#include <string_view>

#include "firmware/radar.hpp"
#include "firmware/service_console.hpp"
#include "hal/bare_metal/reset_record.hpp"
#include "hal/bare_metal/startup.hpp"

namespace firmware {

/// Banner, then the loop for ever. `name`: the board's; `last`: why its last run ended.
[[noreturn]] inline void run_board(std::string_view name, const hal::ResetRecord& last, Radar& radar,
                                   const hal::Board& board) {
    ServiceConsole service(radar, board);
    const hal::MemoryUse memory = hal::memory_use();
    service.banner({.name = name,
                    .last_run_ended_by = hal::to_string(last.cause),
                    .fault_pc = last.pc,
                    .fault_status = last.status,
                    .fault_address = last.address,
                    .rom_bytes = memory.rom_bytes,
                    .static_ram_bytes = memory.static_ram_bytes,
                    .stack_bytes = memory.stack_bytes});
    radar.start();
    for (;;) {
        radar.run_cycle();
        service.poll(hal::memory_use().stack_used_bytes);
    }
}

}  // namespace firmware
