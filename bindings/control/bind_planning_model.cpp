// SPDX-License-Identifier: BSD-3-Clause
#include <mujoco/mujoco.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "conversion/array.hpp"
#include "conversion/numbers.hpp"
#include "conversion/settings.hpp"
#include "conversion/text.hpp"
#include "docstrings.hpp"
#include "limits.hpp"
#include "number_lists.hpp"
#include "planning.hpp"
#include "simulation/simulation.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/control/knot_spline.hpp"
#include "trifinger/model/model_file.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using namespace control;

void bind_spline(nb::module_& m) {
  nb::enum_<SplineKind>(m, "SplineKind", docs::SplineKind::SplineKind)
      .value("CONSTANT", SplineKind::kConstant, docs::SplineKind::kConstant)
      .value("LINEAR", SplineKind::kLinear, docs::SplineKind::kLinear)
      .value("CUBIC", SplineKind::kCubic, docs::SplineKind::kCubic);

  constexpr const char* kArray = "def values(self) -> numpy.typing.NDArray[numpy.float64]";
  nb::class_<KnotSpline>(m, "KnotSpline", docs::KnotSpline::KnotSpline)
      .def(
          "__init__",
          [](KnotSpline* self, SplineKind kind, int num_knots, int width, double interval,
             double begin) {
            new (self) KnotSpline(kind, num_knots, width, Seconds(interval), Seconds(begin));
          },
          "kind"_a, "num_knots"_a, "width"_a, "interval"_a, "begin"_a = 0.0,
          "Knots lie at `begin`, `begin + interval` and so on [s]. All values are 0.")
      .def_prop_ro("kind", &KnotSpline::kind)
      .def_prop_ro("num_knots", &KnotSpline::num_knots, "Number of knots.")
      .def_prop_ro("width", &KnotSpline::width, "Number of values at each time.")
      .def_prop_ro(
          "interval", [](const KnotSpline& self) { return self.interval().count(); },
          "Time from one knot to the next [s].")
      .def_prop_ro(
          "begin", [](const KnotSpline& self) { return self.begin().count(); },
          docs::KnotSpline::begin)
      .def_prop_ro(
          "end", [](const KnotSpline& self) { return self.end().count(); }, docs::KnotSpline::end)
      .def(
          "move_to", [](KnotSpline& self, double begin) { self.move_to(Seconds(begin)); },
          "begin"_a, docs::KnotSpline::move_to)
      .def(
          "knot",
          [](nb::handle_t<KnotSpline> self, int index) {
            auto& spline = *nb::inst_ptr<KnotSpline>(self);
            if (index < 0 || index >= spline.num_knots()) {
              throw InvalidArgument("index is " + std::to_string(index) + ", must be 0 to " +
                                    std::to_string(spline.num_knots() - 1));
            }
            return view_of(spline.knot(index), {spline.width()}, self);
          },
          "index"_a, nb::sig("def knot(self, index: int) -> numpy.typing.NDArray[numpy.float64]"),
          also(docs::KnotSpline::knot, "The array shows them in place: changes change the spline."))
      .def_prop_rw(
          "values",
          [](nb::handle_t<KnotSpline> self) {
            auto& spline = *nb::inst_ptr<KnotSpline>(self);
            return view_of(spline.values(), {spline.num_knots(), spline.width()}, self);
          },
          [](KnotSpline& self, nb::handle values) {
            const auto [array, numbers] =
                doubles_of(values, {self.num_knots(), self.width()}, "values");
            std::ranges::copy(numbers, self.values().begin());
          },
          nb::for_getter(nb::sig(kArray)),
          nb::for_setter(nb::sig("def values(self, values: numpy.typing.ArrayLike, /) -> None")),
          "The values of all knots, with a row per knot. The array shows them in place: changes "
          "change the spline.")
      .def(
          "at",
          [](const KnotSpline& self, double time) {
            ValueAndRate result = value_and_rate(self.width());
            self.at(Seconds(time), span_of(result.first), span_of(result.second));
            return result;
          },
          "time"_a, "Returns the values at `time` [s], and their rates [1/s].");
}

// ---- the model ----

void require_fits(const PlanningModel& model, const PlanningState& state) {
  require_length("position of the state", state.position.size(),
                 static_cast<std::size_t>(model.position_size()));
  require_length("velocity of the state", state.velocity.size(),
                 static_cast<std::size_t>(model.velocity_size()));
}

void require_has(const ObjectAddress& object, std::size_t positions, std::size_t velocities) {
  if (std::cmp_less_equal(object.position + 7, positions) &&
      std::cmp_less_equal(object.velocity + 6, velocities)) {
    return;
  }
  throw InvalidArgument("the state has no object '" + object.name + "'; it is of another model");
}

// The robot of a file, with its sites and free bodies by their names.
PlanningModel model_of_file(nb::handle path, const std::vector<PlannedJoint>& joints,
                            const std::vector<std::string>& tip_sites) {
  const ModelFile file({.path = to_path(path)});
  std::vector<int> sites;
  for (const std::string& name : tip_sites) {
    const int site = mj_name2id(file.mujoco(), mjOBJ_SITE, name.c_str());
    if (site < 0) throw InvalidArgument("the model has no site '" + name + "'");
    sites.push_back(site);
  }
  return {*file.mujoco(), joints, sites, file.objects()};
}

void bind_hand_state(nb::module_& m) {
  nb::class_<PlanningState> state(
      m, "PlanningState",
      also(docs::PlanningState::PlanningState, "Arrays show the numbers in place."));
  state
      .def(
          "__init__",
          [](PlanningState* self, double time, const Numbers& position, const Numbers& velocity) {
            const auto numbers = [](std::span<const double> from) {
              return std::vector<double>(from.begin(), from.end());
            };
            new (self) PlanningState{Seconds(time), numbers(span_of(position)),
                                     numbers(span_of(velocity))};
          },
          "time"_a, "position"_a, "velocity"_a)
      .def_prop_rw(
          "time", [](const PlanningState& self) { return self.time.count(); },
          [](PlanningState& self, double time) { self.time = Seconds(time); },
          docs::PlanningState::time);
  bind_list(state, "position", &PlanningState::position, docs::PlanningState::position);
  bind_list(state, "velocity", &PlanningState::velocity, docs::PlanningState::velocity);
}

void bind_model(nb::module_& m) {
  using Options = PlanningModelOptions;
  bind_settings(
      nb::class_<Options>(m, "PlanningModelOptions",
                          docs::PlanningModelOptions::PlanningModelOptions),
      Setting{"time_step", &Options::time_step, docs::PlanningModelOptions::time_step},
      Setting{"iterations", &Options::iterations, docs::PlanningModelOptions::iterations},
      Setting{"impratio", &Options::impratio, docs::PlanningModelOptions::impratio},
      Setting{"lower_links", &Options::lower_links, docs::PlanningModelOptions::lower_links},
      Setting{"fingers_touch", &Options::fingers_touch, docs::PlanningModelOptions::fingers_touch},
      Setting{"torque_share", &Options::torque_share, docs::PlanningModelOptions::torque_share});

  nb::class_<PlannedJoint>(m, "PlannedJoint", docs::PlannedJoint::PlannedJoint)
      .def(
          "__init__",
          [](PlannedJoint* self, double lower, double upper, double max_torque) {
            new (self) PlannedJoint{lower, upper, max_torque};
          },
          "lower"_a, "upper"_a, "max_torque"_a)
      .def_ro("lower", &PlannedJoint::lower, docs::PlannedJoint::lower)
      .def_ro("upper", &PlannedJoint::upper, docs::PlannedJoint::upper)
      .def_ro("max_torque", &PlannedJoint::max_torque, docs::PlannedJoint::max_torque);

  nb::class_<ObjectAddress>(m, "ObjectAddress", docs::ObjectAddress::ObjectAddress)
      .def_ro("name", &ObjectAddress::name)
      .def_ro("body", &ObjectAddress::body, docs::ObjectAddress::body)
      .def_ro("position", &ObjectAddress::position, docs::ObjectAddress::position)
      .def_ro("velocity", &ObjectAddress::velocity, docs::ObjectAddress::velocity);

  nb::class_<PlanningModel>(m, "PlanningModel", docs::PlanningModel::PlanningModel)
      .def(
          "__init__",
          [](PlanningModel* self, const std::string& config, const nb::dict& overrides,
             Options options) {
            const RobotConfig robot = load_config(config, overrides);
            options.limits = limits_of(robot);
            new (self) PlanningModel(description_of(robot), options);
          },
          "config"_a = "sim", "overrides"_a = nb::dict(), nb::arg("options").sig("...") = Options{},
          nb::sig("def __init__(self, config: str = 'sim', overrides: dict[str, object] = {}, "
                  "options: PlanningModelOptions = ...) -> None"),
          "`config` and `overrides` give the robot, its limits and the scene, as in `Kinematics`.")
      .def_static(
          "of_file", &model_of_file, "path"_a, "joints"_a,
          "tip_sites"_a = std::vector<std::string>(),
          nb::sig("def of_file(path: str | bytes | os.PathLike[str], joints: "
                  "collections.abc.Sequence[PlannedJoint], tip_sites: "
                  "collections.abc.Sequence[str] = ()) -> PlanningModel"),
          R"(Copies the model of another robot from an MJCF or URDF file. Its first joints must be `joints`:
hinges or slides, with one motor each in the same order. `tip_sites` are names of sites at the tips
of its fingers. Its objects are the bodies that float freely.

Raises InvalidArgument if the file or its joints do not fit.)")
      .def_prop_ro(
          "time_step", [](const PlanningModel& self) { return self.time_step().count(); },
          "Length of a step [s].")
      .def_prop_ro("num_joints", &PlanningModel::num_joints, "Number of joints with motors.")
      .def_prop_ro("position_size", &PlanningModel::position_size,
                   "Numbers in `PlanningState.position`.")
      .def_prop_ro("velocity_size", &PlanningModel::velocity_size,
                   "Numbers in `PlanningState.velocity`.")
      .def_prop_ro("joints", &PlanningModel::joints, nb::rv_policy::copy, "The joints with motors.")
      .def_prop_ro("tip_sites", &PlanningModel::tip_sites, nb::rv_policy::copy,
                   docs::PlanningModel::tip_sites)
      .def_prop_ro("objects", &PlanningModel::objects, nb::rv_policy::copy,
                   "Objects, in the order of `CostTerm.index`.")
      .def("object", &PlanningModel::object, "name"_a, nb::rv_policy::copy,
           also("Where the object `name` is in a state.", docs::PlanningModel::object))
      .def("initial_state", &PlanningModel::initial_state, docs::PlanningModel::initial_state)
      .def(
          "set_joints",
          [](const PlanningModel& self, const Numbers& position, const Numbers& velocity,
             PlanningState& state) {
            require_fits(self, state);
            const auto count = static_cast<std::size_t>(self.num_joints());
            require_length("position", span_of(position).size(), count);
            require_length("velocity", span_of(velocity).size(), count);
            self.set_joints(span_of(position), span_of(velocity), state);
          },
          "position"_a, "velocity"_a, "state"_a, docs::PlanningModel::set_joints)
      .def_static(
          "set_object",
          [](const ObjectAddress& object, const Pose& pose, const Twist& twist,
             PlanningState& state) {
            require_has(object, state.position.size(), state.velocity.size());
            PlanningModel::set_object(object, pose, twist, state);
          },
          "object"_a, "pose"_a, "twist"_a, "state"_a, docs::PlanningModel::set_object)
      .def_static(
          "object_pose",
          [](const ObjectAddress& object, const Numbers& position) {
            require_has(object, span_of(position).size(), SIZE_MAX);
            return PlanningModel::object_pose(object, span_of(position));
          },
          "object"_a, "position"_a,
          "The pose of an object in the world frame, from `PlanningState.position`.")
      .def_static(
          "object_twist",
          [](const ObjectAddress& object, const Numbers& position, const Numbers& velocity) {
            require_has(object, span_of(position).size(), span_of(velocity).size());
            return PlanningModel::object_twist(object, span_of(position), span_of(velocity));
          },
          "object"_a, "position"_a, "velocity"_a,
          "The twist of an object in the world frame, from both lists of a `PlanningState`.")
      .def("check", &PlanningModel::check, "state"_a, docs::PlanningModel::check);
}

}  // namespace

void bind_planning_model(nb::module_& m) {
  bind_spline(m);
  bind_hand_state(m);
  bind_model(m);
}

}  // namespace trifinger::bindings
