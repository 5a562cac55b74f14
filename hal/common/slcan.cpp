#include "hal/common/slcan.hpp"

#include <bit>
#include <cstdint>
#include <cstring>

namespace hal {
namespace {

constexpr std::string_view kOk = "\r";
constexpr std::string_view kBell = "\a";

/// -1 for what is no hexadecimal digit.
int digit(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    return -1;
}

/// Writes the four hexadecimal digits of two bytes, those of `first` in front.
void put_hex(char* out, std::uint32_t first, std::uint32_t second) {
    const std::uint32_t bytes = first | second << 16;
    const std::uint32_t digits = (bytes >> 4 & 0x000F'000F) | (bytes & 0x000F'000F) << 8;  // a digit a byte
    const std::uint32_t letters = (digits + 0x0606'0606) >> 4 & 0x0101'0101;  // 1 where it is one
    const std::uint32_t characters = digits + 0x3030'3030 + letters * ('A' - '0' - 10);
    static_assert(std::endian::native == std::endian::little);
    std::memcpy(out, &characters, sizeof characters);
}

}  // namespace

SlcanText encode_slcan(const can::Frame& frame) {
    SlcanText text;
    char* const out = text.characters.data();
    put_hex(out, frame.id >> 8, frame.id & 0xFFU);  // the first digit is 0
    out[0] = 't';
    out[4] = static_cast<char>('0' + frame.length);
    for (std::size_t i = 0; i < frame.data.size(); i += 2)
        put_hex(out + 5 + 2 * i, frame.data[i], frame.data[i + 1]);
    text.size = 6U + 2U * frame.length;
    out[text.size - 1] = '\r';
    return text;
}

SlcanEvent SlcanParser::push(std::uint8_t byte) {
    if (byte == '\r') {
        const SlcanEvent event = size_ == 0 ? SlcanEvent::none : interpret();
        size_ = 0;
        return event;
    }
    if (byte == '\n' && size_ == 0) return SlcanEvent::none;  // a terminal's end of line
    if (size_ < line_.size()) line_[size_] = static_cast<char>(byte);
    if (size_ <= line_.size()) ++size_;
    return SlcanEvent::none;
}

SlcanEvent SlcanParser::answer_with(std::string_view text, SlcanEvent event) {
    answer_ = text;
    return event;
}

SlcanEvent SlcanParser::refuse() {
    return answer_with(kBell, SlcanEvent::malformed);
}

SlcanEvent SlcanParser::interpret() {
    if (size_ > line_.size()) return refuse();
    switch (line_[0]) {
        case 'S':
            if (open_ || size_ != 2 || line_[1] < '0' || line_[1] > '8') return refuse();
            return answer_with(kOk);
        case 'O':
            if (open_ || size_ != 1) return refuse();
            open_ = true;
            return answer_with(kOk);
        case 'C':
            if (size_ != 1) return refuse();
            open_ = false;  // slcand closes first, whatever state the channel is in
            return answer_with(kOk);
        case 'F':
            if (size_ != 1) return refuse();
            return answer_with("F00\r");
        case 'V':
            if (size_ != 1) return refuse();
            return answer_with("V0101\r");
        case 'N':
            if (size_ != 1) return refuse();
            return answer_with("NR077\r");
        case 'Z':
            if (size_ != 2 || line_[1] != '0') return refuse();
            return answer_with(kOk);
        case 't':
            return interpret_frame(3, true);
        case 'r':
            return interpret_frame(3, false);
        case 'T':
            return interpret_frame(8, true);
        case 'R':
            return interpret_frame(8, false);
        default:
            return refuse();
    }
}

SlcanEvent SlcanParser::interpret_frame(std::size_t id_digits, bool has_data) {
    if (!open_ || size_ < 2 + id_digits) return refuse();
    std::uint32_t id = 0;
    for (std::size_t i = 1; i <= id_digits; ++i) {
        const int d = digit(line_[i]);
        if (d < 0) return refuse();
        id = id << 4 | static_cast<std::uint32_t>(d);
    }
    const bool extended = id_digits == 8;
    const int length = digit(line_[1 + id_digits]);
    if (id > (extended ? 0x1FFF'FFFFU : 0x7FFU) || length < 0 || length > 8) return refuse();
    const std::size_t data_digits = has_data ? 2 * static_cast<std::size_t>(length) : 0;
    if (size_ != 2 + id_digits + data_digits) return refuse();

    can::Frame frame;
    for (std::size_t i = 0; i < data_digits; i += 2) {
        const int high = digit(line_[2 + id_digits + i]);
        const int low = digit(line_[3 + id_digits + i]);
        if (high < 0 || low < 0) return refuse();
        frame.data[i / 2] = static_cast<std::uint8_t>(high * 16 + low);
    }
    if (extended || !has_data) return answer_with(kOk, SlcanEvent::rejected);
    frame.id = static_cast<std::uint16_t>(id);
    frame.length = static_cast<std::uint8_t>(length);
    frame_ = frame;
    return answer_with(kOk, SlcanEvent::frame);
}

}  // namespace hal
