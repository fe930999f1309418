// SPDX-License-Identifier: BSD-3-Clause
#include "frontend_state.hpp"

#include <cerrno>
#include <utility>

#include "session_directory.hpp"
#include "session_place.hpp"
#include "stand_in.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::detail {

FrontendState::FrontendState(Part part, bool its_strictness, Backend* backend,
                             std::shared_ptr<void> its_owner)
    : owner(std::move(its_owner)),
      mapping(std::move(part.mapping)),
      action(std::move(part.action)),
      is_strict(its_strictness),
      inline_backend(backend) {
  if (backend != nullptr) backend_life = backend->host().place().backend_life();
  if (mapping->payload().size() > 0) {
    const std::string& name = mapping->name();
    const std::string robot = robot_of(name);
    payloads = std::make_unique<const PayloadReader>(robot, name.substr(robot.size() + 1),
                                                     mapping->payload());
  }
  if (!action) return;
  const RingPlace& place = header().queue;
  queue = ipc::Ring(action->data() + place.offset, place.shape);
  queue_entry.resize((place.shape.element_size + 7) / 8);
}

FrontendState::~FrontendState() {
  if (!action) return;
  if (fork.is_inherited()) {
    // Its thread is in the parent, so nobody could end it here.
    [[maybe_unused]] const StandIn* const left = stand_in.release();
    return;
  }
  const bool has_acted = [this] {
    const auto turn = StandIn::turn_of(*this);
    return last_appended >= 0;
  }();
  if (!has_acted) {
    // release: the lock is given back later, together with the file.
    action_header()->controller_pid.store(0, std::memory_order_release);
  } else {
    // This is needed after the end, too: a controller that leaves without it counts as dead.
    send_request(*action_header(), kDetach);
    run_inline_to_end();
  }
}

void FrontendState::require_own() const {
  if (!fork.is_inherited()) return;
  throw InheritedHandle("this handle of '" + mapping->name() +
                        "' was made before fork(); connect again in the child process");
}

void FrontendState::require_control() const {
  if (action) return;
  throw InvalidArgument("this handle of '" + mapping->name() +
                        "' only observes; use connect() to control the robot");
}

void FrontendState::require_backend() const {
  if (!backend_life.expired()) return;
  throw InvalidArgument("the back-end of robot '" + robot_of(mapping->name()) +
                        "' was destroyed, and this front-end runs inside it: let the back-end live "
                        "longer than its front-ends");
}

void FrontendState::throw_moved() const {
  throw ControlHeld("another thread is moving '" + mapping->name() +
                    "' at this moment; a robot that runs inline is controlled by one thread at a "
                    "time");
}

void FrontendState::throw_stopped() const {
  look_for_interrupted_step();
  mapping->throw_stopped();
}

void FrontendState::look_for_interrupted_step() const {
  // If the user's own code has ended an inline session within a step, the interrupt reports that
  // first.
  if (inline_backend != nullptr && interrupt) interrupt();
}

void FrontendState::run_inline_to_end() const noexcept {
  // A back-end that was destroyed has brought the robot to rest by itself.
  if (inline_backend == nullptr || backend_life.expired()) return;
  const InlineThread::Use use(*inline_thread, InlineThread::Taking::kYes);
  if (!use) return;
  // If a later session has begun, this stops as soon as that session waits for an action.
  for (auto progress = Progress::kStepped;
       progress == Progress::kStepped || progress == Progress::kHeldUp;) {
    progress = inline_backend->advance();
  }
}

void send_request(ActionHeader& header, Request what) noexcept {
  // release: whoever sees the request also sees the actions appended before.
  header.requests.fetch_or(what, std::memory_order_release);
  header.event.fetch_add(1, std::memory_order_seq_cst);
  ipc::futex_wake_all(header.event);
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
