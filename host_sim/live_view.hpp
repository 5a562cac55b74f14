/// What the run looks like while it goes on: a table of tracks that stays in place on a terminal, a line
/// every few simulated seconds elsewhere.
#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <string>

#include "host_sim/simulation.hpp"

namespace sim {

class LiveView {
  public:
    /// `frames`: how many there will be.
    LiveView(std::FILE* out, std::uint64_t frames);

    void show(const CycleView& view);
    /// Leaves the last table on the screen.
    void finish(const CycleView& view);

    /// The table: a head line, a line a confirmed track. Lines end in '\n'.
    static std::string table(const CycleView& view, std::uint64_t frames);

  private:
    void redraw(const CycleView& view);

    std::FILE* out_;
    std::uint64_t frames_;
    bool terminal_;
    int lines_ = 0;  ///< on the screen now
    std::uint64_t next_line_ = 0;
    std::chrono::steady_clock::time_point next_redraw_{};
};

}  // namespace sim
