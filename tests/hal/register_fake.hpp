/// A register block for the drivers' tests: a handle to a model of the device.
#pragma once

#include <cstdint>

/// `Device`: `std::uint32_t read(std::uint32_t offset)`, `void write(std::uint32_t offset, std::uint32_t
/// value)`.
template <class Device>
struct RegistersOf {
    Device* device;

    [[nodiscard]] std::uint32_t read(std::uint32_t offset) const { return device->read(offset); }
    void write(std::uint32_t offset, std::uint32_t value) const { device->write(offset, value); }
};

/// Time that the test sets; a look takes a microsecond, so that waits with a limit end.
struct FakeTimer {
    std::uint64_t time_us = 0;
    std::uint64_t now_us() { return time_us++; }
};
