#include "hal/host/serial_port.hpp"

#include <array>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <ctime>
#include <memory>
#include <utility>

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <termios.h>
#include <unistd.h>

namespace hal {
namespace {

struct Rate {
    std::uint32_t baud;
    speed_t code;
};
constexpr std::array<Rate, 8> kRates{{{115'200, B115200},
                                      {230'400, B230400},
                                      {460'800, B460800},
                                      {921'600, B921600},
                                      {1'000'000, B1000000},
                                      {1'500'000, B1500000},
                                      {2'000'000, B2000000},
                                      {3'000'000, B3000000}}};

constexpr std::int64_t kDrainLookNs = 500'000;  ///< fifty bytes at 1 Mbaud

/// Raw 8N1. False, with errno, when the driver refuses.
bool configure(int fd, std::uint32_t baud) {
    const Rate* rate = nullptr;
    for (const Rate& r : kRates) {
        if (r.baud == baud) rate = &r;
    }
    if (rate == nullptr) {
        errno = EINVAL;
        return false;
    }
    termios settings{};
    if (tcgetattr(fd, &settings) != 0) return false;
    cfmakeraw(&settings);
    settings.c_cflag |= CLOCAL | CREAD;
    settings.c_cflag &= ~static_cast<tcflag_t>(CRTSCTS | CSTOPB);
    settings.c_cc[VMIN] = 0;
    settings.c_cc[VTIME] = 0;
    if (cfsetspeed(&settings, rate->code) != 0 || tcsetattr(fd, TCSANOW, &settings) != 0) return false;
    // tcsetattr succeeds when any of the settings took: a port that cannot go that fast says so only here.
    termios actual{};
    if (tcgetattr(fd, &actual) != 0) return false;
    if (cfgetospeed(&actual) != rate->code) {
        errno = EINVAL;
        return false;
    }
    return tcflush(fd, TCIOFLUSH) == 0;
}

int connect_socket(const std::string& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.size() >= sizeof(address.sun_path)) {
        errno = ENAMETOOLONG;
        return -1;
    }
    std::memcpy(address.sun_path, path.c_str(), path.size() + 1);
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0) return -1;
    if (connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0 ||
        fcntl(fd, F_SETFL, O_NONBLOCK) != 0) {
        const int cause = errno;
        close(fd);
        errno = cause;
        return -1;
    }
    return fd;
}

std::string explain(const std::string& path, std::uint32_t baud, int cause) {
    std::string what = "serial line " + path + ": " + std::strerror(cause);
    switch (cause) {
        case ENOENT:
            return what + "; is the board plugged in? (ls -l /dev/serial/by-id)";
        case EACCES:
            return what + "; join the group of the device: usermod -aG dialout $USER, then log in again";
        case ENOTTY:
            return what + ": neither a serial device nor a socket";
        case EINVAL:
            return what + ": it cannot do " + std::to_string(baud) + " baud";
        case EBUSY:
            return what + "; another program (a terminal?) has it open";
        default:
            return what;
    }
}

}  // namespace

Opened<SerialPort> SerialPort::open(const std::string& path, std::uint32_t baud) {
    const auto fail = [&] { return Opened<SerialPort>{.error = explain(path, baud, errno)}; };
    struct stat status {};
    if (stat(path.c_str(), &status) != 0) return fail();
    const bool tty = !S_ISSOCK(status.st_mode);
    const int fd =
        tty ? ::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC) : connect_socket(path);
    if (fd < 0) return fail();
    Opened<SerialPort> port{.value = std::unique_ptr<SerialPort>(new SerialPort(fd, tty))};
    // Two writers would mix their bytes without either noticing.
    if (tty && (!configure(fd, baud) || ioctl(fd, TIOCEXCL) != 0)) return fail();
    return port;
}

SerialPort::~SerialPort() {
    if (tty_) ioctl(fd_, TIOCNXCL);
    close(fd_);
}

SerialResult SerialPort::write(std::span<const std::uint8_t> bytes, int timeout_ms) {
    using std::chrono::steady_clock;
    const auto patience = std::chrono::milliseconds(timeout_ms);
    auto deadline = steady_clock::now() + patience;
    int pending = 0;
    while (true) {
        if (bytes.empty()) {
            // The driver's queue, not tcdrain: that has no time limit.
            const int before = std::exchange(pending, 0);
            if (!tty_ || ioctl(fd_, TIOCOUTQ, &pending) != 0 || pending == 0) return SerialResult::ok;
            if (pending < before) deadline = steady_clock::now() + patience;
        }
        const auto left =
            std::chrono::duration_cast<std::chrono::milliseconds>(deadline - steady_clock::now()).count();
        if (left <= 0) return SerialResult::timeout;
        const bool writing = !bytes.empty();
        pollfd waiting{fd_, static_cast<short>(writing ? POLLIN | POLLOUT : POLLIN), 0};
        const std::int64_t wait_ns = writing ? left * 1'000'000 : kDrainLookNs;
        const timespec wait{wait_ns / 1'000'000'000, wait_ns % 1'000'000'000};
        const int ready = ppoll(&waiting, 1, &wait, nullptr);
        if (ready < 0 && errno != EINTR) return SerialResult::failed;
        if (ready <= 0) continue;
        if ((waiting.revents & POLLIN) != 0) {
            std::array<std::uint8_t, 256> unwanted;
            const ssize_t count = read(fd_, unwanted.data(), unwanted.size());
            if (count == 0 && !tty_) return SerialResult::failed;
            if (count < 0 && errno != EAGAIN && errno != EINTR) return SerialResult::failed;
        } else if ((waiting.revents & (POLLERR | POLLHUP | POLLNVAL)) != 0) {
            return SerialResult::failed;
        }
        if ((waiting.revents & POLLOUT) != 0) {
            const ssize_t count = tty_ ? ::write(fd_, bytes.data(), bytes.size())
                                       : ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
            if (count < 0 && errno != EAGAIN && errno != EINTR) return SerialResult::failed;
            if (count > 0) {
                bytes = bytes.subspan(static_cast<std::size_t>(count));
                deadline = steady_clock::now() + patience;
            }
        }
    }
}

}  // namespace hal
