/// Arrays that start without a value.
#pragma once

#include <cstddef>
#include <new>
#include <type_traits>

namespace tracking {

/// N elements, each written before it is read. A std::array of fixed-point numbers is set to zero first,
/// which costs more than what is done with the few elements that a search touches. Elements that hold a
/// vector or a matrix are made by make(), others may be assigned to.
template <class T, std::size_t N>
class Scratch {
    static_assert(std::is_trivially_destructible_v<T>, "nobody destroys them");

  public:
    Scratch() {
    }  // NOLINT(modernize-use-equals-default): = default would set the bytes to zero in `Scratch{}`

    template <class... Values>
    T& make(std::size_t i, const Values&... values) {
        return *new (bytes_ + i * sizeof(T)) T{values...};
    }
    T& operator[](std::size_t i) { return data()[i]; }
    const T& operator[](std::size_t i) const { return data()[i]; }

  private:
    T* data() { return std::launder(static_cast<T*>(static_cast<void*>(bytes_))); }
    const T* data() const { return std::launder(static_cast<const T*>(static_cast<const void*>(bytes_))); }

    alignas(T) std::byte bytes_[N * sizeof(T)];
};

}  // namespace tracking
