// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/frontend.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <string>
#include <thread>
#include <utility>

#include "base/moved.hpp"
#include "frontend_state.hpp"
#include "ipc/file_lock.hpp"
#include "ipc/ring.hpp"
#include "ipc/shared_memory.hpp"
#include "session_directory.hpp"
#include "session_layout.hpp"
#include "session_mapping.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/description.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/fault.hpp"
#include "trifinger/core/robot.hpp"
#include "trifinger/ipc/process.hpp"

namespace trifinger {
namespace {

using detail::FrontendState;
using detail::Part;
using detail::SessionMapping;

// Locks the action file of `mapping` for this process and returns it. Nothing if the session is
// about to end or has just ended: then look for the next one. Throws ControlHeld.
std::optional<ipc::SharedMemory> take_control(const SessionMapping& mapping) {
  std::optional<ipc::SharedMemory> action;
  try {
    action.emplace(mapping.directory()->open(
        detail::action_file(mapping.name(), mapping.header().session_id), ipc::Access::kReadWrite));
  } catch (const SystemError& error) {
    if (error.error_number() == ENOENT) return std::nullopt;
    throw;
  }
  const detail::RingPlace& place = mapping.header().queue;
  // Somebody has truncated the file. The back-end notices that, too.
  if (action->size() < place.offset + place.shape.size()) return std::nullopt;
  auto& header = *reinterpret_cast<detail::ActionHeader*>(action->data());
  // The claim lets one process at a time pass. Its holder sees a lock and the name of the process
  // that holds this lock.
  if (!ipc::try_lock(action->file(), ipc::Lock::kClaim)) return std::nullopt;
  if (!ipc::try_lock(action->file())) {
    // The handle that ended the session still lives. The next session is about to begin.
    if (mapping.has_ended()) return std::nullopt;
    const ipc::ProcessIdentity holder = header.controller();
    if (holder.is_known_dead()) {
      // A child that a bare fork(2) made keeps the lock of its dead parent. Only the next session
      // can be controlled. If this session has begun, the back-end ends it by itself.
      if (mapping.header().phase.load(std::memory_order_acquire) <
          static_cast<std::uint32_t>(detail::Phase::kRunning)) {
        detail::send_request(header, detail::kDetach);
      }
      return std::nullopt;
    }
    const bool is_own = holder == ipc::ProcessIdentity::of_this_process();
    throw ControlHeld("robot '" + mapping.name() + "' is controlled by " +
                      (is_own ? "another handle in this process" : describe(holder)) +
                      "; use observe() to look at it");
  }
  // If a predecessor died after its first action, this session is about to end.
  const ipc::Ring queue(action->data() + place.offset, place.shape);
  // If it died while writing that action, nothing is left: our first action replaces it.
  const TimeIndex first = mapping.header().first_index;
  if (mapping.has_ended() || queue.sequence_in_slot(first) >= ipc::Ring::sequence_of(first) ||
      (header.requests.load(std::memory_order_relaxed) & detail::kEndRequests) != 0) {
    return std::nullopt;
  }
  const auto self = ipc::ProcessIdentity::of_this_process();
  header.controller_start_time.store(self.start_time, std::memory_order_relaxed);
  header.controller_number_space.store(self.number_space, std::memory_order_relaxed);
  // release: a watchdog that sees the number also finds the lock taken.
  header.controller_pid.store(self.pid, std::memory_order_release);
  ipc::unlock(action->file(), ipc::Lock::kClaim);
  return action;
}

// Takes part in the session that `find` returns. If that session is ending, it waits for the next
// one.
Part take_part(const FrontendOptions& options, const std::function<Session()>& find) {
  const Deadline deadline(options.timeout);
  const Deadline grace(std::min<Timeout>(options.timeout, std::chrono::milliseconds(500)));
  while (true) {
    const Session session = find();
    const std::shared_ptr<const SessionMapping>& mapping = session.mapping();
    if (!options.control || mapping->is_companion()) return {mapping, std::nullopt};
    if (!mapping->backend_is_alive()) {
      throw SessionNotFound("the back-end of robot '" + mapping->name() + "', process " +
                            std::to_string(mapping->header().backend_pid) +
                            ", is gone; start it again with 'trifinger run'");
    }
    // A user who was killed leaves the fault of a late action. The back-end clears that fault by
    // itself.
    const bool may_clear = mapping->fault().code == Fault::Code::kActionLate && !grace.passed();
    if (mapping->has_ended() && mapping->fault().needs_recovery() && !may_clear) {
      throw RobotStopped(mapping->fault(), "robot '" + mapping->name() +
                                               "' has stopped: " + mapping->fault_text() +
                                               "; clear this with recover() when it is safe");
    }
    std::optional<ipc::SharedMemory> action = take_control(*mapping);
    if (action) return {mapping, std::move(action)};
    if (deadline.passed()) {
      throw TimedOut("robot '" + mapping->name() +
                     "' has not begun a new session in time; if this lasts, 'trifinger stop " +
                     mapping->name() + "' ends its back-end");
    }
    std::this_thread::sleep_for(detail::kPollPeriod);
  }
}

// The current session of `host`, whose back-end may still have to begin it.
Session wait_for_session(const SessionHost& host, Timeout timeout) {
  const Deadline deadline(timeout);
  while (true) {
    try {
      return host.open();
    } catch (const SessionNotFound&) {
      if (deadline.passed()) throw;
    }
    std::this_thread::sleep_for(detail::kPollPeriod);
  }
}

Session begin_inline(Backend& backend) {
  if (backend.options().mode != BackendOptions::Mode::kNonRealTime) {
    throw InvalidArgument(
        "a back-end in real-time mode cannot run inline: it must do one step per period");
  }
  backend.begin_session();
  return backend.host().open();
}

}  // namespace

UntypedFrontend::UntypedFrontend(std::unique_ptr<FrontendState> state) : state_(std::move(state)) {}

UntypedFrontend::UntypedFrontend(const std::string& name, FrontendOptions options)
    : state_(std::make_unique<FrontendState>(
          take_part(options, [&] { return Session::open(name); }), options.strict)) {}

UntypedFrontend::UntypedFrontend(const SessionHost& host, FrontendOptions options)
    : state_(std::make_unique<FrontendState>(
          take_part(options, [&] { return wait_for_session(host, options.timeout); }),
          options.strict)) {}

UntypedFrontend::UntypedFrontend(const Session& session)
    : state_(std::make_unique<FrontendState>(
          Part{(static_cast<void>(checked(session.mapping())), session.mapping())})) {}

UntypedFrontend::UntypedFrontend(Backend& backend, FrontendOptions options,
                                 std::shared_ptr<void> owner)
    : state_(
          std::make_unique<FrontendState>(take_part(options, [&] { return begin_inline(backend); }),
                                          options.strict, &backend, std::move(owner))) {}

UntypedFrontend::UntypedFrontend(UntypedFrontend&&) noexcept = default;
UntypedFrontend& UntypedFrontend::operator=(UntypedFrontend&&) noexcept = default;
UntypedFrontend::~UntypedFrontend() = default;

UntypedFrontend UntypedFrontend::companion(const std::string& name) const {
  const FrontendState& own = *checked(state_);
  own.require_own();
  auto state = std::make_unique<FrontendState>(Part{own.mapping->companion(name)}, false,
                                               own.inline_backend, own.owner);
  state->inline_thread = own.inline_thread;
  state->interrupt = own.interrupt;
  return UntypedFrontend(std::move(state));
}

const Session& UntypedFrontend::session() const { return checked(state_)->session; }

bool UntypedFrontend::is_controller() const noexcept { return checked(state_)->action.has_value(); }

void UntypedFrontend::set_interrupt(std::function<void()> interrupt) {
  checked(state_)->interrupt = std::move(interrupt);
}

namespace {

void require_same(const std::string& what, const ElementDescription& found,
                  const ElementDescription& expected) {
  if (found == expected) return;
  const std::string found_text = found.text();
  throw IncompatibleSession(what + " has other fields than this program expects.\nSession:\n" +
                            found_text + "Program:\n" + expected.text() +
                            "Build both from the same version.");
}

}  // namespace

void require_same_robot(const Session& session, const RobotTypes& expected) {
  const RobotTypes& found = session.description();
  const std::string name = "session '" + session.info().name + "'";
  if (found.type != expected.type) {
    throw IncompatibleSession(name + " is a robot of type '" + found.type +
                              "'; this program expects '" + expected.type + "'");
  }
  require_same("the action of " + name, found.action, expected.action);
  require_same("the applied action of " + name, found.applied_action, expected.applied_action);
  require_same("the observation of " + name, found.observation, expected.observation);
}

void require_same_companion(const Session& session, const ElementDescription& expected) {
  require_same("session '" + session.info().name + "'", session.description().observation,
               expected);
}

}  // namespace trifinger
