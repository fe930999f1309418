// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <atomic>
#include <memory>
#include <span>
#include <thread>

#include "trifinger/base/time.hpp"
#include "trifinger/control/online_planner.hpp"
#include "trifinger/control/planning_model.hpp"
#include "trifinger/control/planning_task.hpp"
#include "trifinger/control/predictive_planner.hpp"

namespace trifinger::bindings {

/// Binds splines, states and models for planning.
void bind_planning_model(nanobind::module_& m);

/// A task of Python: terms and a function.
struct PythonTask {
  nanobind::object terms;  ///< A tuple of `CostTerm`.
  nanobind::object batch_cost;
  double late_share;
  double late_factor;

  /// For the garbage collector.
  int traverse(visitproc visit, void* arg) const noexcept {
    Py_VISIT(terms.ptr());
    Py_VISIT(batch_cost.ptr());
    return 0;
  }
  void clear() noexcept {
    terms.reset();
    batch_cost.reset();
  }
};

/// What `batch_cost` of a task gets: all rollouts of a round, as arrays of Python.
struct PythonBatch {
  int num_rollouts;
  int num_states;
  control::Seconds begin;
  control::Seconds time_step;
  nanobind::object positions;
  nanobind::object velocities;
  nanobind::object targets;
  nanobind::object torques;
  nanobind::object tips;
};

/// A cost function of Python. Threads without the GIL call it.
class BatchCost {
 public:
  explicit BatchCost(nanobind::object function) noexcept : function_(std::move(function)) {}
  ~BatchCost();

  /// @throws what the function raises; InvalidArgument if it does not return a number per rollout
  void add(const control::RolloutBatch& batch, std::span<double> costs);
  /// True in the thread that calls the function.
  [[nodiscard]] bool runs_here() const noexcept;

  int traverse(visitproc visit, void* arg) const noexcept {
    Py_VISIT(function_.ptr());
    return 0;
  }
  void clear() noexcept { function_.reset(); }

  [[nodiscard]] const nanobind::object& function() const noexcept { return function_; }

 private:
  nanobind::object function_;
  std::atomic<std::thread::id> running_in_{};
};

/// A planner for Python. One thread at a time may use it; others get an error.
class PythonPlanner {
 public:
  PythonPlanner(nanobind::object model, const PythonTask& task,
                const control::PlannerOptions& options);

  [[nodiscard]] control::Plan plan(const control::PlanningState& start);
  [[nodiscard]] double simulate(const control::PlanningState& start,
                                const control::KnotSpline& commands, control::Seconds duration,
                                control::PlanningState& end);
  void set_task(const PythonTask& task);
  [[nodiscard]] PythonTask task() const;
  [[nodiscard]] const nanobind::object& model() const noexcept { return model_; }
  /// @throws Error while it plans
  [[nodiscard]] control::PredictivePlanner& planner();

  /// For the garbage collector.
  int traverse(visitproc visit, void* arg) const noexcept {
    Py_VISIT(model_.ptr());
    return batch_cost_ ? batch_cost_->traverse(visit, arg) : 0;
  }
  void clear() noexcept {
    if (batch_cost_) batch_cost_->clear();
  }

 private:
  class Busy;

  nanobind::object model_;
  std::shared_ptr<BatchCost> batch_cost_;
  control::PredictivePlanner planner_;
  bool is_busy_{false};  // Changed under the GIL only.
};

/// An online planner for Python. Its functions are called with the GIL held.
class PythonOnlinePlanner {
 public:
  PythonOnlinePlanner(nanobind::object model, const PythonTask& task,
                      const control::PlannerOptions& options,
                      const control::OnlinePlannerOptions& online);
  PythonOnlinePlanner(const PythonOnlinePlanner&) = delete;
  PythonOnlinePlanner& operator=(const PythonOnlinePlanner&) = delete;
  ~PythonOnlinePlanner();

  [[nodiscard]] const nanobind::object& model() const noexcept { return model_; }
  void wait_for_plan(std::uint64_t count, Timeout timeout) const;
  /// @throws Error if the program ends
  [[nodiscard]] control::OnlinePlanner& planner() const;

  /// For the garbage collector.
  int traverse(visitproc visit, void* arg) const noexcept {
    Py_VISIT(model_.ptr());
    return batch_cost_ ? batch_cost_->traverse(visit, arg) : 0;
  }
  void clear() noexcept {
    if (batch_cost_) batch_cost_->clear();
  }

 private:
  friend void stop_planners_at_exit();

  nanobind::object model_;
  std::shared_ptr<BatchCost> batch_cost_;
  // Shared with those who wait for a plan.
  std::shared_ptr<control::OnlinePlanner> planner_;
};

/// Makes the end of the program end all online planners, whose costs may be functions of Python.
void stop_planners_at_exit();

}  // namespace trifinger::bindings
