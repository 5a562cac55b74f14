#include "firmware/text_line.hpp"

namespace firmware {

TextLine& TextLine::text(std::string_view s) {
    for (const char c : s) put(c);
    return *this;
}

TextLine& TextLine::number(std::uint64_t value) {
    std::array<char, 20> digits{};
    std::size_t n = 0;
    do {
        digits[n++] = static_cast<char>('0' + value % 10);
        value /= 10;
    } while (value != 0);
    while (n > 0) put(digits[--n]);
    return *this;
}

TextLine& TextLine::hex(std::uint32_t value) {
    text("0x");
    for (int shift = 28; shift >= 0; shift -= 4) put("0123456789abcdef"[(value >> shift) & 15U]);
    return *this;
}

}  // namespace firmware
