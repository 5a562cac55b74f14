#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <termios.h>
#include <unistd.h>

#include "hal/host/serial_port.hpp"

#include <CppUTest/TestHarness.h>

namespace {

/// Every byte value many times over, 0x0A, 0x0D, 0x11 and 0x13 among them: what a line that is not raw would
/// change.
std::vector<std::uint8_t> every_byte(std::size_t count) {
    std::vector<std::uint8_t> bytes(count);
    for (std::size_t i = 0; i < count; ++i) bytes[i] = static_cast<std::uint8_t>(i * 7);
    return bytes;
}

std::vector<std::uint8_t> read_all(int fd, std::size_t count) {
    std::vector<std::uint8_t> bytes;
    while (bytes.size() < count) {
        pollfd waiting{fd, POLLIN, 0};
        if (poll(&waiting, 1, 2000) <= 0) break;
        std::uint8_t buffer[512];
        const ssize_t got = read(fd, buffer, sizeof(buffer));
        if (got <= 0) break;
        bytes.insert(bytes.end(), buffer, buffer + got);
    }
    return bytes;
}

/// The far end of a serial line, in the kernel's own terminal emulation.
struct Pty {
    Pty() : master(posix_openpt(O_RDWR | O_NOCTTY)) {
        if (master < 0 || grantpt(master) != 0 || unlockpt(master) != 0) std::abort();
        path = ptsname(master);
    }
    ~Pty() { hang_up(); }
    void hang_up() {
        if (master >= 0) close(master);
        master = -1;
    }
    int master;
    std::string path;
};

}  // namespace

TEST_GROUP(SerialPort){};

TEST(SerialPort, EveryByteArrivesUnchangedOverATerminal) {
    Pty pty;
    auto port = hal::SerialPort::open(pty.path, 1'000'000).value;
    CHECK_TRUE(port != nullptr);
    const auto sent = every_byte(3 * 8208);
    std::vector<std::uint8_t> received;
    std::thread reader([&] { received = read_all(pty.master, sent.size()); });
    const auto result = port->write(sent, 5000);
    reader.join();
    CHECK_TRUE(result == hal::SerialResult::ok);
    CHECK_TRUE(received == sent);
}

TEST(SerialPort, SetsTheBaudRate) {
    Pty pty;
    const auto port = hal::SerialPort::open(pty.path, 1'000'000).value;
    CHECK_TRUE(port != nullptr);
    termios settings{};
    CHECK_EQUAL(0, tcgetattr(pty.master, &settings));
    CHECK_EQUAL(static_cast<unsigned>(B1000000), static_cast<unsigned>(cfgetospeed(&settings)));
}

TEST(SerialPort, AnUnknownBaudRateIsRefused) {
    Pty pty;
    STRCMP_CONTAINS("12345 baud", hal::SerialPort::open(pty.path, 12'345).error.c_str());
}

TEST(SerialPort, GivesUpWhenTheOtherEndTakesNothing) {
    Pty pty;
    auto port = hal::SerialPort::open(pty.path, 1'000'000).value;
    CHECK_TRUE(port != nullptr);
    CHECK_TRUE(port->write(every_byte(1 << 20), 50) == hal::SerialResult::timeout);
}

/// A slow other end is not a dead one: what counts is the time in which nothing moves.
TEST(SerialPort, HasPatienceWhileBytesMove) {
    Pty pty;
    auto port = hal::SerialPort::open(pty.path, 1'000'000).value;
    CHECK_TRUE(port != nullptr);
    const auto sent = every_byte(40'000);
    std::vector<std::uint8_t> received;
    std::thread reader([&] {
        while (received.size() < sent.size()) {
            const auto some =
                read_all(pty.master, std::min<std::size_t>(2'000, sent.size() - received.size()));
            if (some.empty()) break;
            received.insert(received.end(), some.begin(), some.end());
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
        }
    });
    const auto result = port->write(sent, 200);  // it takes 400 ms
    reader.join();
    CHECK_TRUE(result == hal::SerialResult::ok);
    CHECK_TRUE(received == sent);
}

TEST(SerialPort, ReportsThatTheOtherEndIsGone) {
    Pty pty;
    auto port = hal::SerialPort::open(pty.path, 1'000'000).value;
    CHECK_TRUE(port != nullptr);
    pty.hang_up();
    CHECK_TRUE(port->write(every_byte(100), 1000) == hal::SerialResult::failed);
}

TEST(SerialPort, WhatTheOtherEndSaysDoesNotStopIt) {
    Pty pty;
    auto port = hal::SerialPort::open(pty.path, 1'000'000).value;
    CHECK_TRUE(port != nullptr);
    const auto chatter = every_byte(1000);
    CHECK_EQUAL(1000, write(pty.master, chatter.data(), chatter.size()));
    std::vector<std::uint8_t> received;
    std::thread reader([&] { received = read_all(pty.master, 8208); });
    const auto result = port->write(every_byte(8208), 5000);
    reader.join();
    CHECK_TRUE(result == hal::SerialResult::ok);
    CHECK_TRUE(received == every_byte(8208));
}

TEST(SerialPort, NamesCauseAndRemedy) {
    STRCMP_CONTAINS("/dev/no-such-line", hal::SerialPort::open("/dev/no-such-line", 1'000'000).error.c_str());
    STRCMP_CONTAINS("plugged in", hal::SerialPort::open("/dev/no-such-line", 1'000'000).error.c_str());
    STRCMP_CONTAINS("neither a serial device nor a socket",
                    hal::SerialPort::open("/dev/null", 1'000'000).error.c_str());
}

TEST(SerialPort, SpeaksToASocket) {
    char folder[] = "/tmp/serial_port_test.XXXXXX";
    CHECK_TRUE(mkdtemp(folder) != nullptr);
    const std::string path = std::string(folder) + "/line";
    const int listener = socket(AF_UNIX, SOCK_STREAM, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof(address.sun_path) - 1);
    CHECK_EQUAL(0, bind(listener, reinterpret_cast<const sockaddr*>(&address), sizeof(address)));
    CHECK_EQUAL(0, listen(listener, 1));
    auto port = hal::SerialPort::open(path, 1'000'000).value;
    CHECK_TRUE(port != nullptr);
    const int other = accept(listener, nullptr, nullptr);
    const auto sent = every_byte(8208);
    std::vector<std::uint8_t> received;
    std::thread reader([&] { received = read_all(other, sent.size()); });
    CHECK_TRUE(port->write(sent, 5000) == hal::SerialResult::ok);
    reader.join();
    CHECK_TRUE(received == sent);
    close(other);
    CHECK_TRUE(port->write(sent, 1000) == hal::SerialResult::failed);
    close(listener);
    unlink(path.c_str());
    rmdir(folder);
}
