// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <array>
#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "conversion/element_type.hpp"
#include "conversion/shown.hpp"
#include "trifinger/core/frontend.hpp"

namespace trifinger::bindings {

class Interruption;

/// The front-end for Python. All functions are called with the GIL held. They release it while they
/// wait, so other threads can use the same object meanwhile.
class PythonFrontend {
 public:
  struct Role {
    bool controls{false};
    bool is_inline{false};  ///< The robot runs in the waits of the thread that controls it.
  };

  /// `checks` are those of the simulation that the front-end runs, if there is one.
  PythonFrontend(UntypedFrontend frontend, Role role, nanobind::object checks = {});
  PythonFrontend(const PythonFrontend&) = delete;
  PythonFrontend& operator=(const PythonFrontend&) = delete;
  ~PythonFrontend() { let_go(); }

  /// @throws ControlHeld if another thread is appending, InvalidArgument for anything but an action
  /// of this robot
  TimeIndex append_desired_action(nanobind::handle action, const ShownSeconds& timeout);
  TimeIndex append_desired_actions(nanobind::handle actions, const ShownSeconds& timeout);
  /// `on_late` is "nothing", "repeat" or "hold".
  void set_on_late(const std::string& on_late);
  [[nodiscard]] bool is_late() const { return open()->frontend.is_late(); }
  /// The default action with `fields` filled in.
  [[nodiscard]] Shown<"Action"> new_action(const nanobind::kwargs& fields) const;

  [[nodiscard]] nanobind::object get(Series series, TimeIndex t, const ShownSeconds& timeout) const;
  [[nodiscard]] nanobind::object get_many(Series series, TimeIndex first, TimeIndex last,
                                          const ShownSeconds& timeout) const;
  [[nodiscard]] Shown<"Observation"> latest_observation(const ShownSeconds& timeout) const;
  [[nodiscard]] Shown<"Observation | None"> get_latest_at(TimeIndex t,
                                                          const ShownSeconds& timeout) const;
  /// The payload of an element of this companion, as a Payload.
  [[nodiscard]] nanobind::object payload(nanobind::handle element) const;
  void wait_until_time_index(TimeIndex t, const ShownSeconds& timeout) const;

  /// @name For other classes in C++
  /// @{
  class Held;
  class Turn;
  /// @}

  [[nodiscard]] TimeIndex current_time_index() const;
  [[nodiscard]] std::pair<TimeIndex, TimeIndex> range(Series series) const;

  void finish(const ShownSeconds& timeout) const;
  void recover(const ShownSeconds& timeout) const;
  [[nodiscard]] std::optional<Fault> fault() const;
  [[nodiscard]] std::optional<TimingRecord> timing() const;
  [[nodiscard]] std::unique_ptr<PythonFrontend> companion(const std::string& name) const;

  [[nodiscard]] SessionInfo session_info() const;
  [[nodiscard]] std::vector<Document> documents() const;
  /// Returns the text for repr(): the session's name and progress. Never waits and never fails.
  [[nodiscard]] nanobind::str text() const;
  [[nodiscard]] nanobind::object dtype(Series series) const { return type_of(series).dtype(); }

  /// Lends the front-end to a guide, which appends all actions until `take_back`. Closing this
  /// object does not end the loan.
  /// @throws ControlHeld if another thread is appending, InvalidArgument if this object is closed
  [[nodiscard]] std::shared_ptr<UntypedFrontend> lend();
  void take_back() noexcept { is_appending_ = false; }

  /// Gives the session back, and tells threads that wait with this object.
  /// @throws the exception that interrupted the robot on its way to rest, for example Ctrl-C
  void close();
  /// Ends a `with` block: finishes after a clean end, closes after an exception.
  void exit(bool is_clean);

  /// For the garbage collector.
  int traverse(visitproc visit, void* arg) const noexcept {
    Py_VISIT(checks_.ptr());
    return 0;
  }
  void clear() noexcept { checks_.reset(); }

 private:
  // A waiting thread keeps this, even if the front-end is closed.
  struct Handle {
    explicit Handle(UntypedFrontend untyped) : frontend(std::move(untyped)) {}

    std::atomic<bool> is_closed{false};
    UntypedFrontend frontend;
  };
  // Marks for its lifetime that a thread appends. Only one thread may append at a time.
  class Appending {
   public:
    explicit Appending(PythonFrontend& frontend);
    Appending(const Appending&) = delete;
    Appending& operator=(const Appending&) = delete;
    ~Appending() { is_appending_ = false; }

   private:
    bool& is_appending_;
  };

  [[nodiscard]] std::shared_ptr<Handle> open() const;
  [[nodiscard]] const ElementType& type_of(Series series) const;
  [[nodiscard]] bool is_own_thread() const noexcept {
    return std::this_thread::get_id() == thread_;
  }
  void let_go() noexcept;

  Role role_;
  std::thread::id thread_{std::this_thread::get_id()};
  std::array<ElementType, 4> types_;  // by Series
  NanCheck nan_check_;
  bool is_appending_{false};
  nanobind::object checks_;                     // Checks that the robot calls
  std::shared_ptr<Interruption> interruption_;  // that of the checks; null without checks
  std::shared_ptr<Handle> handle_;              // null once closed; replaced under the GIL only
};

/// Reads from a front-end, which may be closed meanwhile: the session and all it describes stay as
/// long as this object.
class PythonFrontend::Held {
 public:
  /// @throws InvalidArgument if the front-end is closed
  explicit Held(const PythonFrontend& frontend) : frontend_(frontend), handle_(frontend.open()) {}
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;
  ~Held();

  [[nodiscard]] const Session& session() const { return handle_->frontend.session(); }
  /// Copies the observation of step `t`; waits for it.
  /// @throws InvalidArgument if the front-end was closed meanwhile
  void copy(TimeIndex t, std::byte* observation) const;
  /// For companions: copies the newest element that arrived at or before step `t`. False if none.
  /// @throws InvalidArgument if the front-end was closed meanwhile
  [[nodiscard]] bool copy_latest_at(TimeIndex t, std::byte* element) const;

 protected:
  // Calls `wait` without the GIL.
  template <class Wait>
  auto wait(const Wait& wait) const;

 private:
  const PythonFrontend& frontend_;
  std::shared_ptr<Handle> handle_;
};

/// A `Held` of the only thread that appends.
class PythonFrontend::Turn : public Held {
 public:
  /// @throws ControlHeld if another thread is appending, InvalidArgument if the front-end is closed
  explicit Turn(PythonFrontend& frontend) : Held(frontend), appending_(frontend) {}

  /// Appends `count` actions, one per step, waits for the observation of the first or of the last
  /// of these steps, copies it to `observation` and returns the step.
  /// @throws InvalidArgument if the front-end was closed meanwhile
  TimeIndex act(const std::byte* actions, std::size_t count, bool is_first,
                std::byte* observation) const;

 private:
  Appending appending_;
};

/// Takes part in the session of the robot `name` as soon as there is one, or until Ctrl-C is
/// pressed.
[[nodiscard]] std::unique_ptr<PythonFrontend> attach(const std::string& name,
                                                     FrontendOptions options,
                                                     nanobind::handle timeout);

}  // namespace trifinger::bindings
