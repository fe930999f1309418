// SPDX-License-Identifier: BSD-3-Clause
#include "session_handle.hpp"

#include <cerrno>

#include "trifinger/base/error.hpp"

namespace trifinger::detail {

void SessionHandle::require_own() const {
  if (!is_inherited()) return;
  throw InheritedHandle("this handle of '" + mapping_->name() +
                        "' was made before fork(); connect again in the child process");
}

void SessionHandle::throw_stopped() const {
  look_for_interrupted_step();
  mapping_->throw_stopped();
}

void SessionHandle::look_for_interrupted_step() const {
  // If the user's own code has ended an inline session within a step, the interrupt reports that
  // first.
  if (inline_backend_ != nullptr && interrupt_) interrupt_();
}

void SessionHandle::run_inline_to_end() const noexcept {
  if (inline_backend_ == nullptr) return;
  // If a later session has begun, this stops as soon as that session waits for an action.
  for (auto progress = Progress::kStepped;
       progress == Progress::kStepped || progress == Progress::kHeldUp;) {
    progress = inline_backend_->advance();
  }
}

void wait_for_next_session(const SessionMapping& ended, Timeout timeout,
                           const std::function<void()>& interrupt) {
  const Deadline deadline(timeout);
  while (true) {
    try {
      const SessionMapping current(ended.directory(), ended.name());
      if (current.header().session_id != ended.header().session_id) return;
      if (!current.backend_is_alive()) ended.throw_stopped();
    } catch (const SystemError& error) {
      if (error.error_number() != ENOENT) throw;
      ended.throw_stopped();
    }
    if (deadline.passed()) {
      throw TimedOut("robot '" + ended.name() +
                     "' has not begun a new session after its fault; 'trifinger stop " +
                     ended.name() + "' ends its back-end");
    }
    if (interrupt) interrupt();
    std::this_thread::sleep_for(kPollPeriod);
  }
}

}  // namespace trifinger::detail
