#include "hal/host/loopback_bus.hpp"

namespace hal {

LoopbackBus::Port& LoopbackBus::add_port() {
    ports_.push_back(std::unique_ptr<Port>(new Port(*this)));
    return *ports_.back();
}

bool LoopbackBus::Port::send(const can::Frame& frame) {
    if (!bus_.up_ || frame.length > frame.data.size() || frame.id > 0x7FF) {
        ++counters_.dropped;
        return false;
    }
    for (const auto& port : bus_.ports_) {
        if (port.get() == this) continue;
        if (port->received_.size() < bus_.config_.receive_queue) {
            port->received_.push_back(frame);
        } else {
            ++port->counters_.receive_overflow;
        }
    }
    ++counters_.sent;
    return true;
}

bool LoopbackBus::Port::receive(can::Frame& frame) {
    if (received_.empty()) return false;
    frame = received_.front();
    received_.pop_front();
    ++counters_.received;
    return true;
}

CanState LoopbackBus::Port::state() {
    return bus_.up_ ? CanState::active : CanState::down;
}

}  // namespace hal
