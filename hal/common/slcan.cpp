#include "hal/common/slcan.hpp"

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

char hex(unsigned value) {
    return "0123456789ABCDEF"[value & 15U];
}

}  // namespace

SlcanText encode_slcan(const can::Frame& frame) {
    SlcanText text;
    const auto put = [&text](char c) { text.characters[text.size++] = c; };
    put('t');
    for (int shift = 8; shift >= 0; shift -= 4) put(hex(static_cast<unsigned>(frame.id) >> shift));
    put(hex(frame.length));
    for (std::size_t i = 0; i < frame.length; ++i) {
        put(hex(static_cast<unsigned>(frame.data[i]) >> 4));
        put(hex(frame.data[i]));
    }
    put('\r');
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
