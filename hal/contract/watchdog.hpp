/// Resets the board when the loop stops.
#pragma once

namespace hal {

class Watchdog {
  public:
    virtual void start() = 0;
    /// Called once a cycle, at its end, only when every stage of the cycle ran.
    virtual void kick() = 0;

  protected:
    ~Watchdog() = default;
};

}  // namespace hal
