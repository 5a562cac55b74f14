/// The firmware's lines of text on the standard error stream.
#pragma once

#include <cstdio>
#include <string_view>

#include "hal/contract/console.hpp"

namespace hal {

class StderrConsole final : public Console {
  public:
    explicit StderrConsole(bool quiet = false) : quiet_(quiet) {}

    void line(std::string_view text) override {
        if (!quiet_) std::fprintf(stderr, "%.*s\n", static_cast<int>(text.size()), text.data());
    }
    /// Nobody types at a simulation.
    int read() override { return -1; }

  private:
    bool quiet_;
};

}  // namespace hal
