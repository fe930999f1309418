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

#include "element_type.hpp"
#include "trifinger/core/frontend.hpp"

namespace trifinger::python {

class Interruption;

/// The front-end as Python sees it. All functions are called with the GIL held; they release it
/// while they wait, so other threads can use the same object meanwhile.
class PythonFrontend {
 public:
  struct Role {
    bool controls{false};
    bool is_inline{false};  ///< The robot runs in the waits of the thread that makes this object.
  };

  /// `checks`: of the simulation that it runs, if there is one.
  PythonFrontend(UntypedFrontend frontend, Role role, nanobind::object checks = {});
  PythonFrontend(const PythonFrontend&) = delete;
  PythonFrontend& operator=(const PythonFrontend&) = delete;
  ~PythonFrontend() { let_go(); }

  /// @throws ControlHeld if another thread is at it, InvalidArgument for anything but an action of
  /// this robot
  TimeIndex append_desired_action(nanobind::handle action, nanobind::handle timeout);
  TimeIndex append_desired_actions(nanobind::handle actions, nanobind::handle timeout);
  /// The default action with `fields` filled in.
  [[nodiscard]] nanobind::object new_action(const nanobind::kwargs& fields) const;

  [[nodiscard]] nanobind::object get(Series series, TimeIndex t, nanobind::handle timeout) const;
  [[nodiscard]] nanobind::object get_many(Series series, TimeIndex first, TimeIndex last,
                                          nanobind::handle timeout) const;
  [[nodiscard]] nanobind::object latest_observation(nanobind::handle timeout) const;
  [[nodiscard]] nanobind::object get_latest_at(TimeIndex t, nanobind::handle timeout) const;
  void wait_until_time_index(TimeIndex t, nanobind::handle timeout) const;
  [[nodiscard]] TimeIndex current_time_index() const;
  [[nodiscard]] std::pair<TimeIndex, TimeIndex> range(Series series) const;

  void finish(nanobind::handle timeout) const;
  void recover(nanobind::handle timeout) const;
  [[nodiscard]] std::optional<Fault> fault() const;
  [[nodiscard]] std::optional<TimingRecord> timing() const;
  [[nodiscard]] std::unique_ptr<PythonFrontend> companion(const std::string& name) const;

  [[nodiscard]] SessionInfo session_info() const;
  [[nodiscard]] std::vector<Document> documents() const;
  /// For repr(): whose session it is and how far; waits for nothing and always has an answer.
  [[nodiscard]] nanobind::object text() const;
  [[nodiscard]] nanobind::object dtype(Series series) const { return type_of(series).dtype(); }

  /// Lets go of the session, and tells threads that wait with this object. @throws what has
  /// interrupted the robot on its way to rest: Ctrl-C
  void close();
  /// The end of a `with` block: finishes after a clean one, lets go after an exception.
  void exit(bool is_clean);

  /// For the garbage collector.
  int traverse(visitproc visit, void* arg) const noexcept {
    Py_VISIT(checks_.ptr());
    return 0;
  }
  void clear() noexcept { checks_.reset(); }

 private:
  // What a waiting thread keeps, even if this object is closed.
  struct Handle {
    explicit Handle(UntypedFrontend untyped) : frontend(std::move(untyped)) {}

    std::atomic<bool> is_closed{false};
    UntypedFrontend frontend;
  };
  class Appending;

  [[nodiscard]] std::shared_ptr<Handle> open() const;
  [[nodiscard]] const ElementType& type_of(Series series) const;
  [[nodiscard]] bool is_own_thread() const noexcept {
    return std::this_thread::get_id() == thread_;
  }
  void let_go() noexcept;
  // An inline robot is moved by one thread.
  void require_own_thread() const;

  Role role_;
  std::thread::id thread_{std::this_thread::get_id()};
  std::array<ElementType, 4> types_;  // by Series
  NanCheck nan_check_;
  bool is_appending_{false};
  nanobind::object checks_;                     // Checks; behind the robot that calls them
  std::shared_ptr<Interruption> interruption_;  // theirs; none without checks
  std::shared_ptr<Handle> handle_;              // none once closed; replaced under the GIL only
};

}  // namespace trifinger::python
