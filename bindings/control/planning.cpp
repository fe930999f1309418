// SPDX-License-Identifier: BSD-3-Clause
#include "planning.hpp"

#include <nanobind/stl/vector.h>

#include <set>
#include <string>
#include <utility>

#include "conversion/gil.hpp"
#include "conversion/numbers.hpp"
#include "conversion/text.hpp"
#include "conversion/timeout.hpp"
#include "trifinger/base/error.hpp"

namespace nb = nanobind;

namespace trifinger::bindings {
namespace {

using namespace control;

// All online planners of this process; changed under the GIL only.
std::set<PythonOnlinePlanner*> online_planners;

// A copy, because C++'s planners own their models.
PlanningModel copy_of_model(const nb::object& model) {
  const auto& original = nb::cast<const PlanningModel&>(model);
  return {*original.mujoco(), original.joints(), original.tip_sites(), original.objects()};
}

std::shared_ptr<BatchCost> batch_cost_of(const PythonTask& task) {
  return task.batch_cost.is_none() ? nullptr : std::make_shared<BatchCost>(task.batch_cost);
}

PlanningTask to_task(const PythonTask& task, const std::shared_ptr<BatchCost>& batch_cost) {
  PlanningTask result{.terms = nb::cast<std::vector<CostTerm>>(task.terms),
                      .late_share = task.late_share,
                      .late_factor = task.late_factor};
  if (batch_cost) {
    result.batch_cost = [batch_cost](const RolloutBatch& batch, std::span<double> costs) {
      batch_cost->add(batch, costs);
    };
  }
  return result;
}

// Ends a planner. Its own thread may need the GIL meanwhile, so it must not be held.
struct EndPlanner {
  std::shared_ptr<BatchCost> batch_cost;

  void operator()(OnlinePlanner* planner) const {
    if (batch_cost && batch_cost->runs_here()) {
      // The cost function itself has dropped the planner, which waits for the end of this function.
      std::thread([planner, kept = batch_cost] { delete planner; }).detach();
    } else {
      const GilHold held_or_not;
      const GilRelease release;
      delete planner;
    }
  }
};

PythonBatch python_batch(const RolloutBatch& batch) {
  const npy_intp rollouts = batch.num_rollouts;
  const npy_intp states = batch.num_states;
  return {.num_rollouts = batch.num_rollouts,
          .num_states = batch.num_states,
          .begin = batch.begin,
          .time_step = batch.time_step,
          .positions = copy_of(batch.positions, {rollouts, states, batch.position_size}),
          .velocities = copy_of(batch.velocities, {rollouts, states, batch.velocity_size}),
          .targets = copy_of(batch.targets, {rollouts, states, batch.num_joints}),
          .torques = copy_of(batch.torques, {rollouts, states, batch.num_joints}),
          .tips = copy_of(batch.tips, {rollouts, states, batch.num_tips, 3})};
}

// Adds what a function has returned.
void add_costs(const nb::object& returned, std::span<double> costs) {
  const auto [array, numbers] =
      doubles_of(returned, {std::ssize(costs)}, "what batch_cost returned");
  std::ranges::transform(costs, numbers, costs.begin(), std::plus());
}

}  // namespace

BatchCost::~BatchCost() {
  // Its last owner may be a planner's thread.
  const GilHold gil;
  function_.reset();
}

void BatchCost::add(const RolloutBatch& batch, std::span<double> costs) {
  const GilHold gil;
  // The garbage collector may have been here, and may come while the function runs.
  const nb::object function = function_;
  if (!function.is_valid()) throw Error("the cost function is gone");
  // relaxed: only this thread itself looks for its own number.
  running_in_.store(std::this_thread::get_id(), std::memory_order_relaxed);
  try {
    add_costs(function(nb::cast(python_batch(batch))), costs);
  } catch (...) {
    running_in_.store({}, std::memory_order_relaxed);
    throw;
  }
  running_in_.store({}, std::memory_order_relaxed);
}

bool BatchCost::runs_here() const noexcept {
  // relaxed: see `add`.
  return running_in_.load(std::memory_order_relaxed) == std::this_thread::get_id();
}

// ---- plans when it is asked to ----

// Marks for its lifetime that a thread uses the planner without the GIL.
class PythonPlanner::Busy {
 public:
  explicit Busy(PythonPlanner& planner) : planner_(planner) {
    static_cast<void>(planner.planner());
    planner.is_busy_ = true;
  }
  Busy(const Busy&) = delete;
  Busy& operator=(const Busy&) = delete;
  ~Busy() { planner_.is_busy_ = false; }

 private:
  PythonPlanner& planner_;
};

PythonPlanner::PythonPlanner(nb::object model, const PythonTask& task,
                             const PlannerOptions& options)
    : model_(std::move(model)),
      batch_cost_(batch_cost_of(task)),
      planner_(copy_of_model(model_), to_task(task, batch_cost_), options) {}

PredictivePlanner& PythonPlanner::planner() {
  if (is_busy_) throw Error("this planner is at work; one thread at a time may use it");
  return planner_;
}

Plan PythonPlanner::plan(const PlanningState& start) {
  const Busy busy(*this);
  // Another thread may change the originals.
  PlanningState own;
  own = start;
  const GilRelease release;
  return planner_.plan(own);
}

double PythonPlanner::simulate(const PlanningState& start, const KnotSpline& commands,
                               Seconds duration, PlanningState& end) {
  const Busy busy(*this);
  PlanningState own;
  own = start;
  KnotSpline own_commands;
  own_commands = commands;
  const GilRelease release;
  return planner_.simulate(own, own_commands, duration, end);
}

void PythonPlanner::set_task(const PythonTask& task) {
  std::shared_ptr<BatchCost> batch_cost = batch_cost_of(task);
  planner().set_task(to_task(task, batch_cost));
  batch_cost_ = std::move(batch_cost);
}

PythonTask PythonPlanner::task() const {
  const PlanningTask& task = planner_.task();
  return {.terms = nb::tuple(nb::cast(task.terms)),
          .batch_cost = batch_cost_ ? batch_cost_->function() : nb::none(),
          .late_share = task.late_share,
          .late_factor = task.late_factor};
}

// ---- plans in threads of its own ----

PythonOnlinePlanner::PythonOnlinePlanner(nb::object model, const PythonTask& task,
                                         const PlannerOptions& options,
                                         const OnlinePlannerOptions& online)
    : model_(std::move(model)), batch_cost_(batch_cost_of(task)) {
  PlanningModel copied = copy_of_model(model_);
  PlanningTask own = to_task(task, batch_cost_);
  std::unique_ptr<OnlinePlanner> made;
  {
    const GilRelease release;
    made = std::make_unique<OnlinePlanner>(std::move(copied), std::move(own), options, online);
  }
  planner_ = std::shared_ptr<OnlinePlanner>(made.release(), EndPlanner{batch_cost_});
  online_planners.insert(this);
}

PythonOnlinePlanner::~PythonOnlinePlanner() { online_planners.erase(this); }

OnlinePlanner& PythonOnlinePlanner::planner() const {
  if (planner_ == nullptr) throw Error("the planner has ended, because the program ends");
  return *planner_;
}

void PythonOnlinePlanner::wait_for_plan(std::uint64_t count, Timeout timeout) const {
  static_cast<void>(planner());
  const std::shared_ptr<OnlinePlanner> kept = planner_;
  in_slices(timeout, [&](Timeout slice) { kept->wait_for_plan(count, slice); });
}

void stop_planners_at_exit() {
  nb::module_::import_("atexit").attr("register")(nb::cpp_function([] {
    // Each end lets other threads run, which may make and end planners.
    while (!online_planners.empty()) {
      PythonOnlinePlanner& planner = **online_planners.begin();
      online_planners.erase(online_planners.begin());
      const std::shared_ptr<OnlinePlanner> ended = std::move(planner.planner_);
      planner.planner_ = nullptr;
    }
  }));
}

}  // namespace trifinger::bindings
