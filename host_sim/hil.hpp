/// Hardware in the loop: beat frames to a board over its serial line, its CAN frames from the bus, the same
/// firmware beside it on the PC, and a comparison of every byte while it runs.
///
/// The course of a run:
/// 1. The board must be heard on the bus. It then gets the command `restart` over CAN, which makes it forget
///    everything; its next list is cycle 0. From there on the PC's copy of the firmware (BoardTwin) goes
///    along cycle by cycle.
/// 2. For each frame of the scenario the ego motion is sent on the bus and then the beat frame as a packet on
///    the serial line (hal/common/beat_link.hpp). In lockstep the next frame follows the last CAN frame of
///    the list the board made of the last one, and leaves the board the gap between two packets that it may
///    count on; in real time one frame a period goes out, whatever the board does, the first at the end of a
///    list, when the board has just begun to wait for it.
/// 3. Cycles in which the board had no frame are recognised and compared like all others.
///
/// Packets are numbered by the PC's clock in steps of 10 ms, not from 0, so that to a board that is used
/// again and again each is newer than those of earlier runs.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "host_sim/board_twin.hpp"
#include "host_sim/simulation.hpp"

namespace sim {

struct HilOptions {
    std::string serial;     ///< device or UNIX socket of the board's beat line
    bool lockstep = false;  ///< else in real time
    /// How long the board may say nothing, take no byte, or leave a beat frame unanswered. A board needs 0.2
    /// s; its emulator on a busy machine may take many seconds to swallow a packet, byte by byte.
    std::chrono::milliseconds patience{3'000};
};

struct LatencySummary {  ///< milliseconds from the frame complete at the board to the last CAN frame of its
                         ///< list
    double min = 0, mean = 0, p99 = 0, max = 0;
};

struct HilReport {
    std::uint64_t frames_sent = 0;
    std::uint64_t frames_lost = 0;  ///< sent, but in no list
    std::uint64_t late_sends =
        0;  ///< real time only: frames that went out late because the line was still busy
    std::uint64_t can_overflow = 0;  ///< CAN frames this PC was too slow for; each shows as a difference
    bool fell_silent = false;        ///< the run ended because the board said nothing
    BoardTwinCounters board;
    LatencySummary latency_ms;
    std::vector<std::string> differences;  ///< the first kMaxDifferences

    static constexpr std::size_t kMaxDifferences = 10;
    /// Every list equal, and every frame in a list.
    [[nodiscard]] bool identical() const {
        return board.different == 0 && frames_lost == 0 && board.processed > 0;
    }
};

/// Frames from the scenario, recording or traffic of `simulation`, on the CAN interface it names. `progress`
/// is called after each list. Ends early after kMaxDifferences lists that differ, or when the board takes no
/// more frames or falls silent. Throws InputError when the line or the bus cannot be used, or when nothing is
/// heard from the board.
HilReport run_hil(const SimulationOptions& simulation, const HilOptions& options,
                  const std::function<void(const HilReport&)>& progress);

std::string to_text(const HilReport& report);
nlohmann::json to_json(const HilReport& report);

}  // namespace sim
