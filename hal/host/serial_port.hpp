/// A serial line of the PC, for writing.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "hal/host/opened.hpp"

namespace hal {

enum class SerialResult : std::uint8_t {
    ok,
    timeout,  ///< the other end does not take the bytes; part of them may be on their way
    failed,   ///< unplugged, or closed by the other end
};

/// A tty, set to raw 8N1 without flow control, or a UNIX socket, as an emulator's serial line may be. What
/// comes from the other end is read and thrown away, so that it cannot stand still because nobody listens.
class SerialPort {
  public:
    /// Error: cause and remedy. `baud` means nothing to a socket.
    [[nodiscard]] static Opened<SerialPort> open(const std::string& path, std::uint32_t baud);
    ~SerialPort();
    SerialPort(const SerialPort&) = delete;
    SerialPort& operator=(const SerialPort&) = delete;

    /// Returns when the last byte has left the PC (as far as the driver can tell), or after `timeout_ms` in
    /// which none has.
    [[nodiscard]] SerialResult write(std::span<const std::uint8_t> bytes, int timeout_ms);

  private:
    SerialPort(int fd, bool tty) : fd_(fd), tty_(tty) {}

    int fd_;
    bool tty_;
};

}  // namespace hal
