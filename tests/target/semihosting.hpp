/// Files and exit of the PC, through the emulator. Only in test images: a board without a debugger stops at
/// such a call.
#pragma once

#include <cstddef>
#include <cstdint>

namespace semihosting {

inline std::int32_t call(std::uint32_t operation, const void* argument) {
    register std::uint32_t r0 asm("r0") = operation;
    register const void* r1 asm("r1") = argument;
#if defined(__ARM_ARCH_PROFILE) && __ARM_ARCH_PROFILE == 'M'
    asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
#elif defined(__thumb__)
    asm volatile("svc 0xAB" : "+r"(r0) : "r"(r1) : "memory", "lr");
#else
    asm volatile("svc 0x123456" : "+r"(r0) : "r"(r1) : "memory", "lr");
#endif
    return static_cast<std::int32_t>(r0);
}

[[noreturn]] inline void exit(std::uint32_t code) {
    const std::uint32_t block[2] = {0x20026, code};  // ADP_Stopped_ApplicationExit
    call(0x20, block);                               // SYS_EXIT_EXTENDED
    for (;;) {
    }
}

class File {
  public:
    enum class Mode : std::uint32_t { read = 1, write = 5 };  ///< "rb", "wb"

    /// `name` in the emulator's working directory.
    File(const char* name, std::uint32_t length, Mode mode) {
        const struct {
            const char* name;
            std::uint32_t mode;
            std::uint32_t length;
        } block{name, static_cast<std::uint32_t>(mode), length};
        handle_ = call(0x01, &block);
    }
    [[nodiscard]] bool is_open() const { return handle_ != -1; }
    /// All of it, or false.
    bool read(void* to, std::uint32_t bytes) { return transfer(0x06, to, bytes); }
    bool write(const void* from, std::uint32_t bytes) { return transfer(0x05, from, bytes); }

  private:
    /// SYS_READ and SYS_WRITE return the number of bytes not transferred.
    bool transfer(std::uint32_t operation, const void* at, std::uint32_t bytes) const {
        const struct {
            std::int32_t handle;
            const void* at;
            std::uint32_t bytes;
        } block{handle_, at, bytes};
        return call(operation, &block) == 0;
    }

    std::int32_t handle_ = -1;
};

}  // namespace semihosting
