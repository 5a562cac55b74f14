/// A line of text to whoever is listening: UART, terminal.
#pragma once

#include <string_view>

namespace hal {

class Console {
  public:
    /// Writes text and ends the line. Never blocks for longer than the text takes on the wire.
    virtual void line(std::string_view text) = 0;
    /// The next character typed, or -1.
    virtual int read() = 0;

  protected:
    ~Console() = default;
};

}  // namespace hal
