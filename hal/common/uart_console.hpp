/// The console on any UART of ours.
#pragma once

#include <cstdint>
#include <string_view>

#include "hal/contract/console.hpp"

namespace hal {

/// `Uart`: `int read()`, `bool write(std::uint8_t)`. When the line does not take a character, the rest of the
/// text is given up: the console never holds the radar.
template <class Uart>
class UartConsole final : public Console {
  public:
    explicit UartConsole(Uart& uart) : uart_(uart) {}

    void line(std::string_view text) override {
        for (const char c : text) {
            if (!uart_.write(static_cast<std::uint8_t>(c))) return;
        }
        if (uart_.write('\r')) uart_.write('\n');
    }

    int read() override { return uart_.read(); }

  private:
    Uart& uart_;
};

}  // namespace hal
