// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <atomic>
#include <memory>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "conversion/element.hpp"
#include "conversion/element_type.hpp"

namespace trifinger::bindings {

/// Carries an exception that interrupted a Python function in the loop, such as Ctrl-C or
/// `sys.exit()`, to the thread for which it was meant.
class Interruption {
 public:
  ~Interruption();

  /// Keeps the first exception for the calling thread. Call this with the GIL.
  void keep(nanobind::python_error&& error);
  /// Raises the exception that was kept for the calling thread, if any, with or without the GIL.
  void raise();

  /// For the garbage collector.
  int traverse(visitproc visit, void* arg) const noexcept;
  void clear() noexcept;

 private:
  std::atomic<std::thread::id> thread_{};
  std::optional<nanobind::python_error> error_;  // changed with the GIL only
};

/// The safety checks of a simulation that are Python functions. This is a Python object, too: the
/// simulation and its front-ends refer to it, and a check may refer to them. The garbage collector
/// must see this cycle.
class Checks {
 public:
  /// A user's check. It may be called with or without the GIL, because inline waits release the
  /// GIL.
  class Check {
   public:
    Check(nanobind::object function, const ElementDescription& observation,
          const ElementDescription& action, std::shared_ptr<Interruption> interruption)
        : function_(std::move(function)),
          observation_(observation, class_of(Series::kObservation)),
          action_(action, class_of(Series::kDesiredAction)),
          interruption_(std::move(interruption)) {}

    /// Changes the action at `action` in place.
    /// @throws Error with the text of what the function has raised, Interrupted
    void call(const void* observation, void* action) const;

   private:
    friend class Checks;

    nanobind::object function_;  // null once nobody can reach the robot any more
    ElementType observation_;
    ElementType action_;
    std::shared_ptr<Interruption> interruption_;
  };

  /// @throws InvalidArgument unless `function` can be called
  std::shared_ptr<const Check> add(nanobind::object function, const ElementDescription& observation,
                                   const ElementDescription& action);

  /// The exception that interrupted a check. Front-ends look here during their waits.
  [[nodiscard]] const std::shared_ptr<Interruption>& interruption() const noexcept {
    return interruption_;
  }

  /// For the garbage collector.
  int traverse(visitproc visit, void* arg) const noexcept;
  void clear() noexcept;

 private:
  std::vector<std::shared_ptr<Check>> checks_;
  std::shared_ptr<Interruption> interruption_ = std::make_shared<Interruption>();
};

}  // namespace trifinger::bindings
