// Long kernels ask now and then whether anybody still waits for them. What they ask is set for the
// thread by who calls them; kernels themselves know neither signals nor an interpreter.
#pragma once

#include <cstddef>
#include <functional>

namespace sysid {

/// While it lives, kernels on this thread call `ask` about every 50 ms. `ask` ends them by an
/// exception. Results are thrown away then; what a kernel changes in place is left half done.
class InterruptGuard {
  public:
    explicit InterruptGuard(std::function<void()> ask);
    ~InterruptGuard();
    InterruptGuard(const InterruptGuard&) = delete;
    InterruptGuard& operator=(const InterruptGuard&) = delete;

  private:
    friend void poll_interrupt();
    std::function<void()> ask_;
    InterruptGuard* outer_;
};

/// Calls what the innermost guard of this thread wants called, if it is time to; nothing without
/// one.
void poll_interrupt();

/// The same in a loop over samples. Reading the clock at each of them would show in the time.
inline void poll_interrupt(std::size_t sample) {
    if (sample % 64 == 0) poll_interrupt();
}

}  // namespace sysid
