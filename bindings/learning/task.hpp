// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <exception>
#include <memory>
#include <utility>

#include "trifinger/learning/task.hpp"

namespace trifinger::bindings {

/// The first exception that functions of a task in Python have thrown. Environments expect tasks
/// that throw nothing, so it waits here until the environment has returned.
class TaskFailure {
 public:
  [[nodiscard]] bool has_occurred() const noexcept { return thrown_ != nullptr; }
  /// In a catch block only: keeps the exception, unless there is one already.
  void keep() noexcept {
    if (thrown_ == nullptr) thrown_ = std::current_exception();
  }
  /// Throws the exception that was kept, if there is one, and forgets it.
  void rethrow() {
    if (thrown_ != nullptr) std::rethrow_exception(std::exchange(thrown_, nullptr));
  }

 private:
  std::exception_ptr thrown_;
};

/// Describes an object of Python's class `trifinger.tasks.Task`. The object must outlive what is
/// made of the description: the garbage collector does not see this reference. The interpreter's
/// lock must be held whenever an environment calls the task.
/// @throws InvalidArgument that names the attribute that does not fit
[[nodiscard]] learning::TaskDescription describe_task(nanobind::handle task,
                                                      const std::shared_ptr<TaskFailure>& failure);

}  // namespace trifinger::bindings
