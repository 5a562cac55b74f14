/// A line of text, put together without the heap and without printf.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace firmware {

/// At most 160 characters; what does not fit is cut off at the end, which a reader sees.
class TextLine {
  public:
    TextLine& text(std::string_view s) {
        for (const char c : s) put(c);
        return *this;
    }
    /// Not negative.
    template <std::integral Int>
    TextLine& number(Int v) {
        auto value = static_cast<std::uint64_t>(v);
        std::array<char, 20> digits{};
        std::size_t n = 0;
        do {
            digits[n++] = static_cast<char>('0' + value % 10);
            value /= 10;
        } while (value != 0);
        while (n > 0) put(digits[--n]);
        return *this;
    }
    /// Eight digits with 0x in front.
    TextLine& hex(std::uint32_t value) {
        text("0x");
        for (int shift = 28; shift >= 0; shift -= 4) put("0123456789abcdef"[(value >> shift) & 15U]);
        return *this;
    }
    [[nodiscard]] std::string_view view() const { return {characters_.data(), size_}; }

  private:
    void put(char c) {
        if (size_ < characters_.size()) characters_[size_++] = c;
    }

    std::array<char, 160> characters_{};
    std::size_t size_ = 0;
};

}  // namespace firmware
