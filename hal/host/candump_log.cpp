#include "hal/host/candump_log.hpp"

#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <optional>

namespace hal {
namespace {

std::string reason() {
    return errno != 0 ? std::strerror(errno) : "unknown error";
}

std::string_view trimmed(std::string_view text) {
    constexpr std::string_view kBlanks = " \t\r\n";
    const std::size_t first = text.find_first_not_of(kBlanks);
    if (first == std::string_view::npos) return {};
    return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

/// Takes the text up to the next blank.
std::string_view take_word(std::string_view& text) {
    const std::size_t end = std::min(text.find(' '), text.size());
    const std::string_view word = text.substr(0, end);
    text = trimmed(text.substr(end));
    return word;
}

std::optional<std::uint64_t> number(std::string_view text, int base) {
    std::uint64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
    if (text.empty() || error != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return value;
}

/// "(seconds.fraction)" with six or nine decimals, in microseconds.
std::optional<std::uint64_t> parse_time(std::string_view text) {
    if (text.size() < 2 || text.front() != '(' || text.back() != ')') return std::nullopt;
    text = text.substr(1, text.size() - 2);
    const std::size_t point = text.find('.');
    if (point == std::string_view::npos) return std::nullopt;
    std::string_view fraction = text.substr(point + 1);
    if (fraction.size() != 6 && fraction.size() != 9) return std::nullopt;
    const auto seconds = number(text.substr(0, point), 10);
    const auto decimals = number(fraction, 10);
    constexpr std::uint64_t kGreatestSeconds = 1'000'000'000'000;  // far from overflow in microseconds
    if (!seconds || !decimals || *seconds > kGreatestSeconds) return std::nullopt;
    return *seconds * 1'000'000 + (fraction.size() == 9 ? *decimals / 1000 : *decimals);
}

bool parse_data(std::string_view text, can::Frame& frame) {
    if (text.size() % 2 != 0 || text.size() / 2 > frame.data.size()) return false;
    frame.length = static_cast<std::uint8_t>(text.size() / 2);
    for (unsigned i = 0; i < frame.length; ++i) {
        const auto byte = number(text.substr(2 * i, 2), 16);
        if (!byte) return false;
        frame.data[i] = static_cast<std::uint8_t>(*byte);
    }
    return true;
}

/// A remote frame has no data, but may have its length after the R.
bool is_remote(std::string_view data) {
    return !data.empty() && (data[0] == 'R' || data[0] == 'r') &&
           (data.size() == 1 || (data.size() == 2 && data[1] >= '0' && data[1] <= '8'));
}

}  // namespace

Opened<CandumpWriter> CandumpWriter::open(const std::string& path, std::string interface_name) {
    errno = 0;
    std::unique_ptr<CandumpWriter> writer(new CandumpWriter(path, std::move(interface_name)));
    if (!writer->file_) return {.error = "cannot write CAN log " + path + ": " + reason()};
    return {.value = std::move(writer)};
}

void CandumpWriter::write(std::uint64_t time_us, const can::Frame& frame) {
    errno = 0;
    std::array<char, 48> text{};
    const int length = std::snprintf(text.data(), text.size(), "(%010llu.%06llu) ",
                                     static_cast<unsigned long long>(time_us / 1'000'000),
                                     static_cast<unsigned long long>(time_us % 1'000'000));
    file_.write(text.data(), length);
    file_ << interface_;
    std::snprintf(text.data(), text.size(), " %03X#", unsigned{frame.id});
    file_ << text.data();
    for (unsigned i = 0; i < frame.length && i < frame.data.size(); ++i) {
        std::snprintf(text.data(), text.size(), "%02X", unsigned{frame.data[i]});
        file_ << text.data();
    }
    file_ << '\n';
    note_failure();
    ++lines_;
}

std::string CandumpWriter::flush() {
    errno = 0;
    file_.flush();
    note_failure();
    return failure_;
}

void CandumpWriter::note_failure() {
    if (!file_ && failure_.empty()) failure_ = "CAN log " + path_ + " is incomplete: " + reason();
}

CandumpLine parse_candump_line(std::string_view text) {
    text = trimmed(text);
    CandumpLine line;
    const auto time_us = parse_time(take_word(text));
    const std::string_view interface_name = take_word(text);
    const std::string_view frame = take_word(text);
    if (!time_us || interface_name.empty() || text.find_first_not_of("TRBE ") != std::string_view::npos)
        return line;

    const std::size_t hash = frame.find('#');
    if (hash != 3 && hash != 8) return line;
    const auto id = number(frame.substr(0, hash), 16);
    if (!id) return line;
    const std::string_view data = frame.substr(hash + 1);
    const bool fd = data.starts_with('#');
    can::Frame read;
    if (!fd && !is_remote(data) && !parse_data(data, read)) return line;

    constexpr std::uint64_t kErrorFlag = 0x20000000;
    constexpr std::uint64_t kGreatestExtended = 0x1FFFFFFF;
    if (hash == 3 && *id > 0x7FF) return line;
    line.time_us = *time_us;
    if (hash == 8) {
        line.kind = *id <= kGreatestExtended  ? CandumpKind::extended
                    : (*id & kErrorFlag) != 0 ? CandumpKind::error
                                              : CandumpKind::garbage;
    } else if (fd) {
        line.kind = CandumpKind::fd;
    } else if (is_remote(data)) {
        line.kind = CandumpKind::remote;
    } else {
        line.kind = CandumpKind::frame;
        line.frame = read;
        line.frame.id = static_cast<std::uint16_t>(*id);
    }
    return line;
}

Opened<CandumpReader> CandumpReader::open(const std::string& path) {
    errno = 0;
    std::ifstream file(path);
    // A directory opens but can not be read.
    if (file) file.peek();
    if (!file && !file.eof()) return {.error = "cannot read CAN log " + path + ": " + reason()};
    file.clear();
    return {.value = std::unique_ptr<CandumpReader>(new CandumpReader(std::move(file)))};
}

bool CandumpReader::next(CandumpLine& line) {
    while (std::getline(file_, text_)) {
        ++line_number_;
        if (trimmed(text_).empty()) continue;
        line = parse_candump_line(text_);
        return true;
    }
    return false;
}

bool LoggingPort::send(const can::Frame& frame) {
    if (!port_.send(frame)) return false;
    log_.write(clock_.now_us(), frame);
    return true;
}

bool LoggingPort::receive(can::Frame& frame) {
    if (!port_.receive(frame)) return false;
    log_.write(clock_.now_us(), frame);
    return true;
}

}  // namespace hal
