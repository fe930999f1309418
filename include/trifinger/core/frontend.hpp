// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "trifinger/base/time.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/payload.hpp"
#include "trifinger/core/robot.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/core/status.hpp"

namespace trifinger {

class Backend;
namespace detail {
struct FrontendState;
}

/// Options for taking part in a session.
struct FrontendOptions {
  bool control{true};  ///< True takes control; false only observes.
  bool strict{false};  ///< True throws AcausalAction instead of only marking the step.
  Timeout timeout{
      std::chrono::seconds(5)};  ///< How long to wait for a session that is about to begin.
};

/// What a front-end does if its program has not appended the action of the next step in time, in
/// real-time mode.
enum class OnLate : std::uint8_t {
  kNothing,  ///< The back-end decides: it repeats the last action, or ends the session.
  kRepeat,   ///< The front-end appends the last action once more.
  kHold,     ///< The same for 10 ms, at least a step; then it holds the robot where it is.
};

/// Writes the action that holds a robot to `action`, which has the default action, from what the
/// robot measures. It does not block, allocate or throw.
using HoldAction = std::function<void(const void* observation, void* action)>;

/// The front-end without types. Elements are bytes in the layout that the session's description
/// gives. Python and tools use this class directly. C++ programs use `Frontend`, which documents
/// the functions.
class UntypedFrontend {
 public:
  /// Takes part in the current session of the robot `name`, which may run in any process.
  /// Companions can only be observed.
  explicit UntypedFrontend(const std::string& name, FrontendOptions options = {});
  /// Takes part in the current session of `host`, whose back-end runs in a thread of this process.
  explicit UntypedFrontend(const SessionHost& host, FrontendOptions options = {});
  /// Observes `session`, current or ended. This front-end sees what an inline back-end does, but
  /// cannot wait for it.
  explicit UntypedFrontend(const Session& session);
  /// Takes part in the current session of `backend`, which runs inside this front-end's waits. The
  /// front-end keeps `owner`, an object that the back-end needs, as long as it lives.
  explicit UntypedFrontend(Backend& backend, FrontendOptions options = {},
                           std::shared_ptr<void> owner = nullptr);
  UntypedFrontend(UntypedFrontend&&) noexcept;
  UntypedFrontend& operator=(UntypedFrontend&&) noexcept;
  /// Gives control back. If actions were appended and the session still runs, it ends
  /// (`kDetached`).
  ~UntypedFrontend();

  TimeIndex append_desired_action(const void* action, Timeout timeout);
  /// Appends `count` actions, one after the other. Returns the index of the last one.
  TimeIndex append_desired_actions(const void* actions, std::size_t count, Timeout timeout);

  /// Says what happens from now on if no action of the program is there when nine tenths of the
  /// period before its step are over. A thread of this front-end appends actions then, so the
  /// program can think as long as it likes. What it appends next is delayed once more, by the time
  /// that it was late, and at most by 10 ms. `hold` is for kHold. Nothing happens before the first
  /// action, after `finish`, and outside real-time mode, where the robot waits. For the thread that
  /// appends.
  /// @throws InvalidArgument for a handle that only observes, and for kHold without `hold`
  void set_on_late(OnLate on_late, HoldAction hold = {});
  /// True if the newest action is not the program's, because that did not come in time.
  [[nodiscard]] bool is_late() const;

  /// Copies the element of step `t`; waits for it.
  void get(Series series, TimeIndex t, void* element, Timeout timeout) const;
  /// Copies the elements of the steps [first, first + count); waits for the last one.
  void get(Series series, TimeIndex first, std::size_t count, void* elements,
           Timeout timeout) const;
  /// Copies the element of step `t` without waiting. False if it has not come yet.
  [[nodiscard]] bool try_get(Series series, TimeIndex t, void* element) const;
  void wait_until_time_index(TimeIndex t, Timeout timeout) const;
  void latest_observation(void* observation, Timeout timeout) const;
  /// For companions: copies the newest element that arrived at or before the robot's step `t`, and
  /// waits for that step. False if no element had arrived by then.
  [[nodiscard]] bool get_latest_at(TimeIndex t, void* element, Timeout timeout) const;

  /// For companions: the payload of `element`, which was read from this companion, in place. See
  /// payload.hpp.
  [[nodiscard]] PayloadView payload(const void* element) const;

  /// Newest step whose observation exists; -1 before step 0.
  [[nodiscard]] TimeIndex current_time_index() const;
  /// The first index of `series` that can still be read, and the first index not yet written.
  [[nodiscard]] std::pair<TimeIndex, TimeIndex> range(Series series) const;
  /// Why the session ended; nothing while it runs.
  [[nodiscard]] std::optional<Fault> fault() const;

  void finish(Timeout timeout);
  void recover(Timeout timeout);
  [[nodiscard]] UntypedFrontend companion(const std::string& name) const;

  [[nodiscard]] const Session& session() const;
  /// True if this handle controls its robot, false if it only observes.
  [[nodiscard]] bool is_controller() const noexcept;

  /// Waits call `interrupt` at least every 100 ms. It may throw to end the wait: Python's Ctrl-C.
  void set_interrupt(std::function<void()> interrupt);

 private:
  explicit UntypedFrontend(std::unique_ptr<detail::FrontendState> state);

  std::unique_ptr<detail::FrontendState> state_;
};

/// @throws IncompatibleSession with the first difference if `session` does not belong to the robot
/// `expected`
void require_same_robot(const Session& session, const RobotTypes& expected);
/// @throws IncompatibleSession if the elements of the companion `session` are not `expected`
void require_same_companion(const Session& session, const ElementDescription& expected);

/// The user's view of a running robot: append desired actions, read back what happened.
///
/// Reading step t waits until the back-end has filled it in. A loop that reads y[t] and appends
/// a[t+1] is therefore paced by the robot and needs no sleep of its own.
///
/// A front-end is not for real-time code: reads block and failures throw. Any number of threads may
/// read; one thread appends. Every wait ends with the value, with TimedOut, or with RobotStopped if
/// the session has ended and the value will never come. A handle that went through fork() throws
/// InheritedHandle.
template <Robot R>
class Frontend {
 public:
  using Action = typename R::Action;
  using AppliedAction = AppliedActionOf<R>;
  using Observation = typename R::Observation;

  /// Takes part in the current session of the robot `name`: see `connect` and `observe`.
  /// @throws SessionNotFound with the names of running robots, ControlHeld that names the
  /// controlling process, IncompatibleSession if it is another robot, RobotStopped if a fault must
  /// first be cleared with `recover`.
  explicit Frontend(const std::string& name, FrontendOptions options = {})
      : Frontend(UntypedFrontend(name, options)) {}
  /// Takes part in the current session of `host`, whose back-end runs in a thread of this process.
  explicit Frontend(const SessionHost& host, FrontendOptions options = {})
      : Frontend(UntypedFrontend(host, options)) {}
  /// Observes `session`, current or ended.
  explicit Frontend(const Session& session) : Frontend(UntypedFrontend(session)) {}
  /// Takes part in the current session of `backend`, which runs inside this front-end's waits: no
  /// threads, deterministic, fast. Waiting for a step whose action has not been appended throws
  /// ActionMissing.
  explicit Frontend(Backend& backend, FrontendOptions options = {},
                    std::shared_ptr<void> owner = nullptr)
      : Frontend(UntypedFrontend(backend, options, std::move(owner))) {}

  /// Appends `action` and returns the step for which it is scheduled. This is the next step or, if
  /// the user's loop is late, the first step that is still open. The first call starts step 0. The
  /// call waits only if the queue is full.
  /// @throws RobotStopped, TimedOut, AcausalAction if strict
  TimeIndex append_desired_action(const Action& action, Timeout timeout = kForever) {
    return untyped_.append_desired_action(&action, timeout);
  }
  /// Appends several actions, one per step, and returns the step of the last one.
  TimeIndex append_desired_actions(std::span<const Action> actions, Timeout timeout = kForever) {
    return untyped_.append_desired_actions(actions.data(), actions.size(), timeout);
  }

  /// Says what happens from now on if an action does not come in time: see
  /// `UntypedFrontend::set_on_late`. `hold` makes the action that holds the robot, for example
  /// `hold_position`, and is for OnLate::kHold. It does not block, allocate or throw.
  void set_on_late(OnLate on_late, Action (*hold)(const Observation&) = nullptr) {
    HoldAction any;
    if (hold != nullptr) {
      any = [hold](const void* observation, void* action) {
        Observation y;
        std::memcpy(&y, observation, sizeof(y));
        const Action a = hold(y);
        std::memcpy(action, &a, sizeof(a));
      };
    }
    untyped_.set_on_late(on_late, std::move(any));
  }
  /// True if the newest action is not the program's, because that did not come in time.
  [[nodiscard]] bool is_late() const { return untyped_.is_late(); }

  /// Returns y[t]; waits for it if `t` lies in the future.
  /// @throws HistoryLost if y[t] was already overwritten, RobotStopped if it will never come,
  /// TimedOut
  [[nodiscard]] Observation get_observation(TimeIndex t, Timeout timeout = kForever) const {
    return get<Observation>(Series::kObservation, t, timeout);
  }
  /// Returns a[t] as the back-end took it. This and the functions below throw like
  /// `get_observation`.
  [[nodiscard]] Action get_desired_action(TimeIndex t, Timeout timeout = kForever) const {
    return get<Action>(Series::kDesiredAction, t, timeout);
  }
  /// Returns a'[t], the applied action.
  [[nodiscard]] AppliedAction get_applied_action(TimeIndex t, Timeout timeout = kForever) const {
    return get<AppliedAction>(Series::kAppliedAction, t, timeout);
  }
  /// Returns the status that the back-end has written for step t.
  [[nodiscard]] Status get_status(TimeIndex t, Timeout timeout = kForever) const {
    return get<Status>(Series::kStatus, t, timeout);
  }

  /// Fills `elements` with the steps from `first` on; waits for the last one.
  void get_observations(TimeIndex first, std::span<Observation> elements,
                        Timeout timeout = kForever) const {
    untyped_.get(Series::kObservation, first, elements.size(), elements.data(), timeout);
  }
  void get_desired_actions(TimeIndex first, std::span<Action> elements,
                           Timeout timeout = kForever) const {
    untyped_.get(Series::kDesiredAction, first, elements.size(), elements.data(), timeout);
  }
  void get_applied_actions(TimeIndex first, std::span<AppliedAction> elements,
                           Timeout timeout = kForever) const {
    untyped_.get(Series::kAppliedAction, first, elements.size(), elements.data(), timeout);
  }
  void get_statuses(TimeIndex first, std::span<Status> elements, Timeout timeout = kForever) const {
    untyped_.get(Series::kStatus, first, elements.size(), elements.data(), timeout);
  }

  /// Returns the newest observation, also before step 0: a user can look without acting.
  [[nodiscard]] Observation latest_observation(Timeout timeout = kForever) const {
    Observation observation;
    untyped_.latest_observation(&observation, timeout);
    return observation;
  }
  /// Waits until y[t] exists.
  void wait_until_time_index(TimeIndex t, Timeout timeout = kForever) const {
    untyped_.wait_until_time_index(t, timeout);
  }
  /// Newest step whose observation exists; -1 before step 0.
  [[nodiscard]] TimeIndex current_time_index() const { return untyped_.current_time_index(); }

  /// Says that no further action will come. The session ends without a fault, after the last
  /// appended action. Returns when it has ended.
  /// @throws RobotStopped if the session ended for another reason, so that some actions may not
  /// have been applied; TimedOut
  void finish(Timeout timeout = kForever) { untyped_.finish(timeout); }
  /// Clears the fault that ended the session and waits until the back-end has begun the next one.
  /// This handle remains stopped: connect again. Only the controller can call this;
  /// `trifinger::recover(name)` is for everybody.
  /// @throws InvalidArgument for a handle that only observes, RobotStopped if the back-end is gone
  void recover(Timeout timeout = kForever) { untyped_.recover(timeout); }
  /// Why the session ended; nothing while it runs.
  [[nodiscard]] std::optional<Fault> fault() const { return untyped_.fault(); }
  /// How well the session keeps its time, up to now or up to its end. Nothing outside real-time
  /// mode and before the first whole step.
  [[nodiscard]] std::optional<TimingRecord> timing() const { return session().timing(); }

  /// Reads the companion `name` of this robot, for example "object".
  [[nodiscard]] UntypedFrontend companion(const std::string& name) const {
    return untyped_.companion(name);
  }

  [[nodiscard]] const Session& session() const { return untyped_.session(); }

 private:
  explicit Frontend(UntypedFrontend untyped) : untyped_(std::move(untyped)) {
    require_same_robot(untyped_.session(), describe_robot<R>());
  }

  template <class T>
  [[nodiscard]] T get(Series series, TimeIndex t, Timeout timeout) const {
    T element;
    untyped_.get(series, t, &element, timeout);
    return element;
  }

  UntypedFrontend untyped_;
};

/// The elements of a companion session with their type.
template <Described T>
class Companion {
 public:
  /// @throws IncompatibleSession if the elements are not of type T
  explicit Companion(UntypedFrontend frontend) : untyped_(std::move(frontend)) {
    require_same_companion(untyped_.session(), describe<T>());
  }

  /// Returns the newest element that arrived at or before the robot's step `t`; waits for that
  /// step. Returns nothing if no element had arrived by then.
  [[nodiscard]] std::optional<T> get_latest_at(TimeIndex t, Timeout timeout = kForever) const {
    T element;
    if (!untyped_.get_latest_at(t, &element, timeout)) return std::nullopt;
    return element;
  }

  /// The payload of `element`, which was read from this companion, in place.
  /// @throws HistoryLost if it was overwritten, or if its writer was started again; InvalidArgument
  /// if the element has no payload
  [[nodiscard]] PayloadView payload(const T& element) const { return untyped_.payload(&element); }

 private:
  UntypedFrontend untyped_;
};

/// Takes control of the robot `name`, which runs in a back-end of its own (`trifinger run`).
/// @throws SessionNotFound with the names of running robots and how to start one, ControlHeld that
/// names the controlling process, IncompatibleSession if it is another robot, RobotStopped if a
/// fault must first be cleared with `recover`.
template <Robot R>
[[nodiscard]] Frontend<R> connect(const std::string& name, FrontendOptions options = {}) {
  return Frontend<R>(name, options);
}

/// Observes the robot `name` without controlling it.
template <Robot R>
[[nodiscard]] Frontend<R> observe(const std::string& name) {
  return Frontend<R>(name, {.control = false});
}

}  // namespace trifinger
