/// A UART for figures that must not get lost.
#pragma once

#include <cstdint>

namespace target {

/// Waits for as long as it takes. The emulator hands every character to its reader as a message of its own,
/// of which the kernel keeps some 250; behind a reader that has to wait for its turn the line stands still,
/// and the console of the firmware gives up.
template <class Uart>
class PatientUart {
  public:
    explicit PatientUart(Uart& line) : line_(line) {}
    int read() { return line_.read(); }
    bool write(std::uint8_t byte) {
        while (!line_.write(byte)) {
        }
        return true;
    }

  private:
    Uart& line_;
};

}  // namespace target
