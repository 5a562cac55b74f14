#include "hal/bare_metal/reset_record.hpp"

#include <array>

namespace hal {
namespace {

struct Stored {
    std::uint32_t magic;
    std::uint32_t cause;
    std::uint32_t pc;
    std::uint32_t status;
    std::uint32_t address;
    std::uint32_t check;
};

constexpr std::uint32_t kMagic = 0x52AD'A201;

[[gnu::section(".noinit")]] Stored stored;

std::uint32_t check_word(const Stored& s) {
    return ~(s.magic ^ (s.cause << 1) ^ (s.pc << 2) ^ (s.status << 3) ^ (s.address << 4));
}

constexpr std::array<std::string_view, 10> kNames{
    "power on",       "external reset", "watchdog",   "undefined instruction", "supervisor call",
    "prefetch abort", "data abort",     "hard fault", "unexpected interrupt",  "aborted"};

}  // namespace

std::string_view to_string(ResetCause cause) {
    const auto i = static_cast<std::size_t>(cause);
    return i < kNames.size() ? kNames[i] : "unknown";
}

ResetRecord begin_reset_record() {
    ResetRecord record;
    if (stored.magic == kMagic && stored.check == check_word(stored) && stored.cause < kNames.size()) {
        record = {static_cast<ResetCause>(stored.cause), stored.pc, stored.status, stored.address};
    }
    write_reset_record({.cause = ResetCause::external});
    return record;
}

void write_reset_record(const ResetRecord& record) {
    stored = {kMagic, static_cast<std::uint32_t>(record.cause), record.pc, record.status, record.address, 0};
    stored.check = check_word(stored);
}

}  // namespace hal
