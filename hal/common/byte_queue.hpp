/// First in, first out, between one interrupt handler and the loop.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace hal {

/// One side only puts, the other only gets, so neither needs to mask interrupts. Holds Capacity bytes, a
/// power of two.
template <std::size_t Capacity>
class ByteQueue {
    static_assert(Capacity > 0 && (Capacity & (Capacity - 1)) == 0);

  public:
    /// False: full, byte not taken.
    bool put(std::uint8_t byte) {
        const std::uint32_t head = head_;
        if (head - tail_ == Capacity) return false;
        bytes_[head % Capacity] = byte;
        head_ = head + 1;
        return true;
    }
    /// The oldest byte, or -1.
    int get() {
        const std::uint32_t tail = tail_;
        if (head_ == tail) return -1;
        const int byte = bytes_[tail % Capacity];
        tail_ = tail + 1;
        return byte;
    }
    [[nodiscard]] std::size_t size() const { return head_ - tail_; }
    [[nodiscard]] std::size_t free() const { return Capacity - size(); }

  private:
    std::array<volatile std::uint8_t, Capacity> bytes_{};
    volatile std::uint32_t head_ = 0;  ///< written by put only; counts modulo 2^32
    volatile std::uint32_t tail_ = 0;  ///< written by get only
};

}  // namespace hal
