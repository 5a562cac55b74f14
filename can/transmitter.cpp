#include "can/transmitter.hpp"

#include "can/e2e.hpp"

namespace can {

Frame Transmitter::protect(Encoded encoded) {
    if (encoded.limited) ++limited_;
    const std::uint16_t id = encoded.frame.id;
    e2e_protect(encoded.frame, id, counters_[id - kFirstId]);
    return encoded.frame;
}

}  // namespace can
