// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/garbage.hpp"
#include "conversion/numbers.hpp"
#include "conversion/settings.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "conversion/timeout.hpp"
#include "docstrings.hpp"
#include "number_lists.hpp"
#include "planning.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/control/knot_spline.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using namespace control;

// ---- the task ----

void bind_terms(nb::module_& m) {
  nb::enum_<CostKind>(m, "CostKind", docs::CostKind::CostKind)
      .value("OBJECT_POSITION", CostKind::kObjectPosition, docs::CostKind::kObjectPosition)
      .value("OBJECT_ORIENTATION", CostKind::kObjectOrientation, docs::CostKind::kObjectOrientation)
      .value("OBJECT_VELOCITY", CostKind::kObjectVelocity, docs::CostKind::kObjectVelocity)
      .value("OBJECT_ROTATION", CostKind::kObjectRotation, docs::CostKind::kObjectRotation)
      .value("TIP_OBJECT", CostKind::kTipObject, docs::CostKind::kTipObject)
      .value("TIP_POSITION", CostKind::kTipPosition, docs::CostKind::kTipPosition)
      .value("JOINT_POSITION", CostKind::kJointPosition, docs::CostKind::kJointPosition)
      .value("JOINT_VELOCITY", CostKind::kJointVelocity, docs::CostKind::kJointVelocity)
      .value("EFFORT", CostKind::kEffort, docs::CostKind::kEffort)
      .value("TARGET_DISTANCE", CostKind::kTargetDistance, docs::CostKind::kTargetDistance);
  nb::enum_<CostShape>(m, "CostShape", docs::CostShape::CostShape)
      .value("LINEAR", CostShape::kLinear, docs::CostShape::kLinear)
      .value("SQUARE", CostShape::kSquare, docs::CostShape::kSquare)
      .value("SMOOTH", CostShape::kSmooth, docs::CostShape::kSmooth);

  using Term = CostTerm;
  bind_settings(nb::class_<Term>(m, "CostTerm", docs::CostTerm::CostTerm),
                Setting{"kind", &Term::kind, "The quantity that counts."},
                Setting{"weight", &Term::weight, docs::CostTerm::weight},
                Setting{"end_weight", &Term::end_weight, docs::CostTerm::end_weight},
                Setting{"shape", &Term::shape, "How the quantity becomes a cost."},
                Setting{"index", &Term::index, docs::CostTerm::index},
                Setting{"goal", &Term::goal, "Where the object or the tip should be."},
                Setting{"distance", &Term::distance, docs::CostTerm::distance},
                Setting{"smoothing", &Term::smoothing, docs::CostTerm::smoothing},
                Setting{"joints", &Term::joints, docs::CostTerm::joints});
}

void bind_batch(nb::module_& m) {
  nb::class_<PythonBatch> batch(
      m, "RolloutBatch",
      R"(All rollouts of a round, for costs that judge them together. Arrays have an axis for rollouts, one for
their states, and one for the numbers of a state. They may be kept: the next round has others.

In states after a rollout became infinite all numbers are not finite; that rollout is masked whatever
its cost.)");
  const auto time = [](Seconds PythonBatch::* member) {
    return [member](const PythonBatch& self) { return (self.*member).count(); };
  };
  batch
      .def_ro("num_rollouts", &PythonBatch::num_rollouts,
              "All samples of a round; 1 when the plan itself is judged, after the last round.")
      .def_ro("num_states", &PythonBatch::num_states, docs::RolloutBatch::num_states)
      .def_prop_ro("begin", time(&PythonBatch::begin), docs::RolloutBatch::begin)
      .def_prop_ro("time_step", time(&PythonBatch::time_step), docs::RolloutBatch::time_step);
  const auto numbers = [&batch](const char* name, nb::object PythonBatch::* member,
                                const char* doc) {
    batch.def_prop_ro(
        name, [member](const PythonBatch& self) { return ShownArray(self.*member); }, doc);
  };
  numbers("positions", &PythonBatch::positions, docs::RolloutBatch::positions);
  numbers("velocities", &PythonBatch::velocities, docs::RolloutBatch::velocities);
  numbers("targets", &PythonBatch::targets, docs::RolloutBatch::targets);
  numbers("torques", &PythonBatch::torques, docs::RolloutBatch::torques);
  numbers("tips", &PythonBatch::tips,
          "Positions of the tips [m]. This array has one more axis: tip, then x y z.");
}

void bind_task(nb::module_& m) {
  const PlanningTask usual;
  nb::class_<PythonTask>(
      m, "PlanningTask", nb::type_slots(garbage_collected<PythonTask>()),
      also(
          docs::PlanningTask::PlanningTask,
          R"(`batch_cost` gets a `RolloutBatch` and returns an array: what each rollout costs. It is called once
per round, and once for the plan itself.)"))
      .def(
          "__init__",
          [](PythonTask* self, const nb::iterable& terms, nb::object batch_cost, double late_share,
             double late_factor) {
            // Refuses what is no term here, not where the task is used.
            nb::tuple checked(nb::cast(nb::tuple(terms)));
            for (const nb::handle term : checked) {
              if (!nb::isinstance<CostTerm>(term)) throw nb::type_error("a term is no CostTerm");
            }
            new (self)
                PythonTask{std::move(checked), std::move(batch_cost), late_share, late_factor};
          },
          "terms"_a = nb::tuple(), "batch_cost"_a = nb::none(), nb::kw_only(),
          "late_share"_a = usual.late_share, "late_factor"_a = usual.late_factor,
          nb::sig("def __init__(self, terms: collections.abc.Iterable[CostTerm] = (), batch_cost: "
                  "collections.abc.Callable[[RolloutBatch], numpy.typing.ArrayLike] | None = None, "
                  "*, late_share: float = ..., late_factor: float = ...) -> None"))
      .def_prop_ro(
          "terms", [](const PythonTask& self) { return self.terms; },
          nb::sig("def terms(self) -> tuple[CostTerm, ...]"), "The ready-made parts of the cost.")
      .def_prop_ro(
          "batch_cost", [](const PythonTask& self) { return self.batch_cost; },
          nb::sig("def batch_cost(self) -> collections.abc.Callable[[RolloutBatch], "
                  "numpy.typing.ArrayLike] | None"),
          "What rollouts cost beside their terms.")
      .def_ro("late_share", &PythonTask::late_share, docs::PlanningTask::late_share)
      .def_ro("late_factor", &PythonTask::late_factor,
              "How many times `terms` count in the last `late_share` of the horizon.");
}

// ---- the planner ----

void bind_options(nb::module_& m) {
  nb::enum_<PlanningMethod>(m, "PlanningMethod", docs::PlanningMethod::PlanningMethod)
      .value("PREDICTIVE_SAMPLING", PlanningMethod::kPredictiveSampling,
             docs::PlanningMethod::kPredictiveSampling)
      .value("CROSS_ENTROPY", PlanningMethod::kCrossEntropy, docs::PlanningMethod::kCrossEntropy)
      .value("PATH_INTEGRAL", PlanningMethod::kPathIntegral, docs::PlanningMethod::kPathIntegral);
  nb::enum_<PlannedCommand>(m, "PlannedCommand", docs::PlannedCommand::PlannedCommand)
      .value("POSITION", PlannedCommand::kPosition, docs::PlannedCommand::kPosition)
      .value("TORQUE", PlannedCommand::kTorque, docs::PlannedCommand::kTorque);

  using Options = PlannerOptions;
  bind_settings(
      nb::class_<Options>(m, "PlannerOptions", docs::PlannerOptions::PlannerOptions),
      Setting{"method", &Options::method, "How the next plan follows from rollouts."},
      Setting{"samples", &Options::samples, docs::PlannerOptions::samples},
      Setting{"rounds", &Options::rounds, docs::PlannerOptions::rounds},
      Setting{"horizon", &Options::horizon, docs::PlannerOptions::horizon},
      Setting{"knots", &Options::knots, "Number of knots of a plan."},
      Setting{"spline", &Options::spline, "How commands follow from knots."},
      Setting{"command", &Options::command, "What the numbers of a plan are."},
      Setting{"kp", &Options::kp, docs::PlannerOptions::kp},
      Setting{"kd", &Options::kd, docs::PlannerOptions::kd},
      Setting{"least_sigma", &Options::least_sigma, docs::PlannerOptions::least_sigma},
      Setting{"most_sigma", &Options::most_sigma, "See `least_sigma`."},
      Setting{"one_finger_share", &Options::one_finger_share,
              docs::PlannerOptions::one_finger_share},
      Setting{"constant_share", &Options::constant_share, docs::PlannerOptions::constant_share},
      Setting{"temperature", &Options::temperature, docs::PlannerOptions::temperature},
      Setting{"elites", &Options::elites, docs::PlannerOptions::elites},
      Setting{"num_threads", &Options::num_threads, docs::PlannerOptions::num_threads},
      Setting{"seed", &Options::seed, docs::PlannerOptions::seed});

  using Online = OnlinePlannerOptions;
  bind_settings(nb::class_<Online>(m, "OnlinePlannerOptions",
                                   docs::OnlinePlannerOptions::OnlinePlannerOptions),
                Setting{"period", &Online::period, docs::OnlinePlannerOptions::period},
                Setting{"lead", &Online::lead, docs::OnlinePlannerOptions::lead});
}

void bind_plan(nb::module_& m) {
  nb::class_<PlannedStates> states(m, "PlannedStates", docs::PlannedStates::PlannedStates);
  const auto rows = [&states](const char* name, std::vector<double> PlannedStates::* member,
                              const char* doc) {
    states.def_prop_ro(
        name,
        [member](nb::handle_t<PlannedStates> self) {
          auto& all = *nb::inst_ptr<PlannedStates>(self);
          const auto count = static_cast<npy_intp>(all.count);
          const auto size = static_cast<npy_intp>((all.*member).size());
          return ShownArray(view_of(all.*member, {count, size / count}, self));
        },
        doc);
  };
  states
      .def_prop_ro(
          "begin", [](const PlannedStates& self) { return self.begin.count(); },
          "Time of the first state [s].")
      .def_prop_ro(
          "time_step", [](const PlannedStates& self) { return self.time_step.count(); },
          "Time from one state to the next one [s].")
      .def_ro("count", &PlannedStates::count, "Number of states.");
  rows("positions", &PlannedStates::positions, "`PlanningState.position`, one row per state.");
  rows("velocities", &PlannedStates::velocities, "`PlanningState.velocity`, one row per state.");

  nb::class_<Plan>(m, "Plan", docs::control::Plan::Plan)
      .def_ro("commands", &Plan::commands, docs::control::Plan::commands)
      .def_ro("cost", &Plan::cost, docs::control::Plan::cost)
      .def_ro("previous_cost", &Plan::previous_cost, docs::control::Plan::previous_cost)
      .def_ro("least_cost", &Plan::least_cost, docs::control::Plan::least_cost)
      .def_ro("median_cost", &Plan::median_cost, docs::control::Plan::median_cost)
      .def_ro("num_masked", &Plan::num_masked, docs::control::Plan::num_masked)
      .def_ro("number", &Plan::number, docs::control::Plan::number)
      .def_ro("states", &Plan::states, docs::control::Plan::states);
}

void bind_predictive_planner(nb::module_& m) {
  using Planner = PythonPlanner;
  nb::class_<Planner>(
      m, "PredictivePlanner", nb::type_slots(garbage_collected<Planner>()),
      also(
          docs::PredictivePlanner::PredictivePlanner,
          R"(Other threads of Python run while it plans. If one of them uses the planner meanwhile, it gets an
Error.)"))
      .def(
          "__init__",
          [](Planner* self, nb::handle_t<PlanningModel> model, const PythonTask& task,
             const PlannerOptions& options) {
            new (self) Planner(nb::borrow(model), task, options);
          },
          "model"_a, "task"_a, nb::arg("options").sig("...") = PlannerOptions{},
          "Raises InvalidArgument that names the first value that makes no sense.")
      .def(
          "plan", &Planner::plan, "start"_a,
          R"(Plans from `start`, and returns the plan. If all rollouts diverge, the previous plan stays and its
cost is infinite.

Raises InvalidArgument if `start` does not fit the model or is not finite; what `batch_cost` raises.)")
      .def_prop_ro(
          "newest", [](Planner& self) { return self.planner().newest(); },
          docs::PredictivePlanner::newest)
      .def(
          "restart", [](Planner& self) { self.planner().restart(); },
          docs::PredictivePlanner::restart)
      .def(
          "begin_with",
          [](Planner& self, const KnotSpline& commands) { self.planner().begin_with(commands); },
          "commands"_a, docs::PredictivePlanner::begin_with)
      .def(
          "simulate",
          [](Planner& self, const PlanningState& start, const KnotSpline& commands,
             double duration) {
            PlanningState end;
            const double cost = self.simulate(start, commands, Seconds(duration), end);
            return std::pair(cost, std::move(end));
          },
          "start"_a, "commands"_a, "duration"_a,
          R"(Simulates `commands` from `start` for `duration` [s] in the planning model. Returns the cost as a plan
of that duration, without `batch_cost`, and the last state; the cost is infinite if it diverged.

Raises InvalidArgument as `plan` does.)")
      .def("set_task", &Planner::set_task, "task"_a, docs::PredictivePlanner::set_task)
      .def(
          "set_terms",
          [](Planner& self, const std::vector<CostTerm>& terms) {
            self.planner().set_terms(terms);
          },
          "terms"_a, "Changes the terms of the task only.")
      .def_prop_ro(
          "model", [](const Planner& self) { return self.model(); },
          nb::sig("def model(self) -> PlanningModel"), "The model that was given.")
      .def_prop_ro(
          "task",
          [](Planner& self) {
            static_cast<void>(self.planner());
            return self.task();
          },
          "The task, with copies of its terms.")
      .def_prop_ro(
          "options", [](Planner& self) { return PlannerOptions(self.planner().options()); },
          "A copy of the options.")
      .def_prop_ro(
          "num_threads", [](Planner& self) { return self.planner().num_threads(); },
          "Number of threads that simulate.")
      .def_prop_ro(
          "num_steps", [](Planner& self) { return self.planner().num_steps(); },
          "Steps of a rollout.")
      .def_prop_ro(
          "costs", [](Planner& self) { return copy_of(self.planner().costs()); },
          docs::PredictivePlanner::costs)
      .def_prop_ro(
          "weights", [](Planner& self) { return copy_of(self.planner().weights()); },
          docs::PredictivePlanner::weights)
      .def(
          "knots_of",
          [](Planner& self, int rollout) {
            const PredictivePlanner& planner = self.planner();
            if (rollout < 0 || rollout >= planner.options().samples) {
              throw InvalidArgument("rollout is " + std::to_string(rollout) + ", must be 0 to " +
                                    std::to_string(planner.options().samples - 1));
            }
            return copy_of(planner.knots_of(rollout),
                           {planner.options().knots, planner.model().num_joints()});
          },
          "rollout"_a,
          nb::sig("def knots_of(self, rollout: int) -> numpy.typing.NDArray[numpy.float64]"),
          "The knots of one of these rollouts, as in `KnotSpline.values`.");

  m.def(
      "path_integral_weights",
      [](const Numbers& costs, double temperature) {
        Numbers weights{Eigen::VectorXd::Zero(costs.value.size())};
        if (costs.value.size() > 0)
          path_integral_weights(span_of(costs), temperature, span_of(weights));
        return weights;
      },
      "costs"_a, "temperature"_a,
      also(docs::path_integral_weights, "Their sum is 1, or 0 if no cost is finite."));
  m.def(
      "elite_weights",
      [](const Numbers& costs, int count) {
        Numbers weights{Eigen::VectorXd::Zero(costs.value.size())};
        elite_weights(span_of(costs), count, span_of(weights));
        return weights;
      },
      "costs"_a, "count"_a,
      also(docs::elite_weights, "Their sum is 1, or 0 if no cost is finite."));
}

void bind_online_planner(nb::module_& m) {
  using Status = OnlinePlannerStatus;
  nb::class_<Status> status(m, "OnlinePlannerStatus",
                            docs::OnlinePlannerStatus::OnlinePlannerStatus);
  const auto time = [&status](const char* name, Seconds Status::* member, const char* doc) {
    status.def_prop_ro(name, [member](const Status& self) { return (self.*member).count(); }, doc);
  };
  status.def_ro("num_plans", &Status::num_plans, "Number of plans that were made.")
      .def_ro("num_refused_states", &Status::num_refused_states,
              docs::OnlinePlannerStatus::num_refused_states);
  time("state_time", &Status::state_time, docs::OnlinePlannerStatus::state_time);
  time("begin", &Status::begin, docs::OnlinePlannerStatus::begin);
  time("duration", &Status::duration, docs::OnlinePlannerStatus::duration);
  time("lateness", &Status::lateness, docs::OnlinePlannerStatus::lateness);
  status.def_ro("cost", &Status::cost, docs::OnlinePlannerStatus::cost)
      .def_ro("median_cost", &Status::median_cost, docs::OnlinePlannerStatus::median_cost)
      .def_ro("num_masked", &Status::num_masked, docs::OnlinePlannerStatus::num_masked)
      .def_ro("has_failed", &Status::has_failed, docs::OnlinePlannerStatus::has_failed);

  using Planner = PythonOnlinePlanner;
  nb::class_<Planner>(
      m, "OnlinePlanner", nb::type_slots(garbage_collected<Planner>()),
      also(
          docs::OnlinePlanner::OnlinePlanner,
          R"(Planning needs the interpreter only while a `batch_cost` runs, once per round. A task of terms alone
never delays Python's loop.)"))
      .def(
          "__init__",
          [](Planner* self, nb::handle_t<PlanningModel> model, const PythonTask& task,
             const PlannerOptions& options, const OnlinePlannerOptions& online) {
            new (self) Planner(nb::borrow(model), task, options, online);
          },
          "model"_a, "task"_a, nb::arg("options").sig("...") = PlannerOptions{},
          nb::arg("online").sig("...") = OnlinePlannerOptions{},
          "Starts the threads. Returns when they are ready.\n\n"
          "Raises InvalidArgument that names the first value that makes no sense.")
      .def_prop_ro(
          "model", [](const Planner& self) { return self.model(); },
          nb::sig("def model(self) -> PlanningModel"), docs::OnlinePlanner::model)
      .def(
          "set_state",
          [](const Planner& self, const PlanningState& state) {
            return self.planner().set_state(state);
          },
          "state"_a, docs::OnlinePlanner::set_state)
      .def(
          "at",
          [](const Planner& self, double at) -> std::optional<ValueAndRate> {
            ValueAndRate result =
                value_and_rate(nb::cast<const PlanningModel&>(self.model()).num_joints());
            const bool has_plan =
                self.planner().at(Seconds(at), span_of(result.first), span_of(result.second));
            return has_plan ? std::optional(std::move(result)) : std::nullopt;
          },
          "time"_a,
          "Returns the commands at `time` [s], and their rates [1/s]; None before the first plan.")
      .def_prop_ro(
          "status", [](const Planner& self) { return Status(self.planner().status()); },
          docs::OnlinePlanner::status)
      .def(
          "set_terms",
          [](const Planner& self, const std::vector<CostTerm>& terms) {
            return self.planner().set_terms(terms);
          },
          "terms"_a, docs::OnlinePlanner::set_terms)
      .def(
          "wait_for_plan",
          [](const Planner& self, std::uint64_t count, const ShownSeconds& timeout) {
            self.wait_for_plan(count, to_timeout(timeout));
          },
          "count"_a, "timeout"_a = nb::none(), docs::OnlinePlanner::wait_for_plan);
}

}  // namespace

void bind_planning(nb::module_& m) {
  bind_planning_model(m);
  bind_terms(m);
  bind_batch(m);
  bind_task(m);
  bind_options(m);
  bind_plan(m);
  bind_predictive_planner(m);
  bind_online_planner(m);
}

}  // namespace trifinger::bindings
