/// What open functions of the PC's adapters return.
#pragma once

#include <memory>
#include <string>

namespace hal {

/// Either the opened thing, or why not and what to do about it.
template <class T>
struct Opened {
    std::unique_ptr<T> value = nullptr;
    std::string error = {};
};

}  // namespace hal
