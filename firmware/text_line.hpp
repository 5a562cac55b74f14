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
    TextLine& text(std::string_view s);
    /// Not negative.
    TextLine& number(std::uint64_t value);
    template <std::signed_integral Int>
    TextLine& number(Int value) {
        return number(static_cast<std::uint64_t>(value));
    }
    template <std::unsigned_integral Int>
    TextLine& number(Int value) {
        return number(std::uint64_t{value});
    }
    /// Eight digits with 0x in front.
    TextLine& hex(std::uint32_t value);
    [[nodiscard]] std::string_view view() const { return {characters_.data(), size_}; }

  private:
    void put(char c) {
        if (size_ < characters_.size()) characters_[size_++] = c;
    }

    std::array<char, 160> characters_{};
    std::size_t size_ = 0;
};

}  // namespace firmware
