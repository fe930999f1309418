// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <memory>
#include <utility>
#include <vector>

#include "element.hpp"
#include "element_type.hpp"

namespace trifinger::python {

/// The safety checks of a simulation that are functions of Python. An object of Python itself: the
/// simulation and its front-ends refer to it, and a check may refer to them, so the garbage
/// collector has to see the way from one to the other.
class Checks {
 public:
  /// A user's check. It is called with or without the GIL: inline waits give it back.
  class Check {
   public:
    Check(nanobind::object function, const ElementDescription& observation,
          const ElementDescription& action)
        : function_(std::move(function)),
          observation_(observation, class_of(Series::kObservation)),
          action_(action, class_of(Series::kDesiredAction)) {}

    /// Changes the action at `action` in place. @throws Error if the function has thrown
    void call(const void* observation, void* action) const;

   private:
    friend class Checks;

    nanobind::object function_;  // none once nobody can reach the robot any more
    ElementType observation_;
    ElementType action_;
  };

  /// @throws InvalidArgument unless `function` can be called
  std::shared_ptr<const Check> add(nanobind::object function, const ElementDescription& observation,
                                   const ElementDescription& action);

  /// For the garbage collector.
  int traverse(visitproc visit, void* arg) const noexcept;
  void clear() noexcept;

 private:
  std::vector<std::shared_ptr<Check>> checks_;
};

}  // namespace trifinger::python
