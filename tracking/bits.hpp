/// Sets of small numbers as bits.
#pragma once

#include <bit>
#include <cstdint>

namespace tracking {

/// The members of a set, ascending: `for (const std::uint32_t i : Bits(set))`. By halves: a 64-bit count of
/// zeros is a library call on the targets.
class Bits {
  public:
    explicit constexpr Bits(std::uint64_t set) : set_(set) {}

    struct End {};
    class Iterator {
      public:
        explicit constexpr Iterator(std::uint64_t set)
            : left_(static_cast<std::uint32_t>(set)), upper_(static_cast<std::uint32_t>(set >> 32)) {
            if (left_ == 0) go_up();
        }
        constexpr std::uint32_t operator*() const {
            return static_cast<std::uint32_t>(std::countr_zero(left_)) + base_;
        }
        constexpr Iterator& operator++() {
            left_ &= left_ - 1;
            if (left_ == 0 && base_ == 0) go_up();
            return *this;
        }
        constexpr bool operator!=(End /*unused*/) const { return left_ != 0; }

      private:
        constexpr void go_up() {
            left_ = upper_;
            base_ = 32;
        }
        std::uint32_t left_;
        std::uint32_t upper_;
        std::uint32_t base_ = 0;
    };
    [[nodiscard]] constexpr Iterator begin() const { return Iterator(set_); }
    [[nodiscard]] constexpr End end() const { return {}; }

  private:
    std::uint64_t set_;
};

/// f(member) for every member of a set, ascending; half the loop of Bits. Where the body is short and the set
/// large.
template <class F>
constexpr void for_each_bit(std::uint64_t set, F f) {
    auto left = static_cast<std::uint32_t>(set);
    for (std::uint32_t base = 0;; base = 32) {
        for (; left != 0; left &= left - 1) f(static_cast<std::uint32_t>(std::countr_zero(left)) + base);
        if (base != 0) return;
        left = static_cast<std::uint32_t>(set >> 32);
    }
}

}  // namespace tracking
