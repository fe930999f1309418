// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <string>
#include <vector>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/settings.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "docstrings.hpp"
#include "limits.hpp"
#include "simulation/simulation.hpp"
#include "trifinger/control/grasp_controller.hpp"
#include "trifinger/control/grasp_planner.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using namespace control;

void bind_planner(nb::module_& m) {
  nb::class_<Touch>(m, "Touch", docs::Touch::Touch)
      .def(
          "__init__",
          [](Touch* self, const Vector3& point, const Vector3& normal) {
            new (self) Touch{point, normal};
          },
          "point"_a, "normal"_a)
      .def_prop_ro("point", array_of(&Touch::point), docs::Touch::point)
      .def_prop_ro("normal", array_of(&Touch::normal), docs::Touch::normal);

  nb::class_<Approach>(m, "Approach", docs::Approach::Approach)
      .def_prop_ro("above", array_of(&Approach::above), docs::Approach::above)
      .def_prop_ro("beside", array_of(&Approach::beside), docs::Approach::beside);
  m.def("approach_to", &approach_to, "touch"_a, "object"_a, "tip_radius"_a, docs::approach_to);

  using Config = GraspPlannerConfig;
  bind_settings(
      nb::class_<Config>(m, "GraspPlannerConfig", docs::GraspPlannerConfig::GraspPlannerConfig),
      Setting{"offsets", &Config::offsets, docs::GraspPlannerConfig::offsets},
      Setting{"heights", &Config::heights, docs::GraspPlannerConfig::heights},
      Setting{"friction", &Config::friction, docs::GraspPlannerConfig::friction},
      Setting{"friction_sides", &Config::friction_sides, docs::GraspPlannerConfig::friction_sides},
      Setting{"min_normal_force", &Config::min_normal_force,
              docs::GraspPlannerConfig::min_normal_force},
      Setting{"clearance", &Config::clearance, docs::GraspPlannerConfig::clearance},
      Setting{"limit_margin", &Config::limit_margin, docs::GraspPlannerConfig::limit_margin},
      Setting{"largest_torque", &Config::largest_torque, docs::GraspPlannerConfig::largest_torque},
      Setting{"shared_faces", &Config::shared_faces, docs::GraspPlannerConfig::shared_faces});

  nb::class_<PlannedGrasp>(m, "PlannedGrasp", docs::PlannedGrasp::PlannedGrasp)
      .def_ro("touches", &PlannedGrasp::touches, docs::PlannedGrasp::touches)
      .def_ro("torque_share", &PlannedGrasp::torque_share, docs::PlannedGrasp::torque_share);

  nb::class_<GraspPlanner>(m, "GraspPlanner", docs::GraspPlanner::GraspPlanner)
      .def(
          "__init__",
          [](GraspPlanner* self, const std::string& config, const Overrides& overrides,
             const std::string& object, GraspPlannerConfig settings) {
            const RobotConfig robot = load_config(config, overrides);
            settings.limits = limits_of(robot);
            new (self) GraspPlanner(description_of(robot), object, std::move(settings));
          },
          "config"_a = "sim", "overrides"_a = nb::dict(), "object"_a = "cube",
          nb::arg("settings").sig("...") = Config{},
          "`config` and `overrides` give the robot, its limits and the scene, as in `Kinematics`. "
          "`object` is\nthe name of the box.")
      .def(
          "plan",
          [](GraspPlanner& planner, const std::vector<Motion>& trajectory) {
            return planner.plan(trajectory);
          },
          "trajectory"_a, docs::GraspPlanner::plan);
}

void bind_controller(nb::module_& m) {
  using Config = GraspControllerConfig;
  bind_settings(
      nb::class_<Config>(m, "GraspControllerConfig",
                         docs::GraspControllerConfig::GraspControllerConfig),
      Setting{"object", &Config::object, docs::GraspControllerConfig::object},
      Setting{"tips", &Config::tips, docs::GraspControllerConfig::tips},
      Setting{"friction", &Config::friction, docs::GraspControllerConfig::friction},
      Setting{"friction_sides", &Config::friction_sides,
              docs::GraspControllerConfig::friction_sides},
      Setting{"slip_friction", &Config::slip_friction, docs::GraspControllerConfig::slip_friction},
      Setting{"min_normal_force", &Config::min_normal_force,
              docs::GraspControllerConfig::min_normal_force},
      Setting{"max_normal_force", &Config::max_normal_force,
              docs::GraspControllerConfig::max_normal_force},
      Setting{"touch_force", &Config::touch_force, docs::GraspControllerConfig::touch_force},
      Setting{"approach_speed", &Config::approach_speed,
              docs::GraspControllerConfig::approach_speed},
      Setting{"closing_speed", &Config::closing_speed, docs::GraspControllerConfig::closing_speed},
      Setting{"penetration", &Config::penetration, docs::GraspControllerConfig::penetration},
      Setting{"closing_time", &Config::closing_time, docs::GraspControllerConfig::closing_time},
      Setting{"engage_time", &Config::engage_time, docs::GraspControllerConfig::engage_time},
      Setting{"roll_time", &Config::roll_time, docs::GraspControllerConfig::roll_time},
      Setting{"slip_speed", &Config::slip_speed, docs::GraspControllerConfig::slip_speed},
      Setting{"lost_time", &Config::lost_time, docs::GraspControllerConfig::lost_time},
      Setting{"lost_distance", &Config::lost_distance, docs::GraspControllerConfig::lost_distance});

  nb::enum_<GraspPhase>(m, "GraspPhase", docs::GraspPhase::GraspPhase)
      .value("IDLE", GraspPhase::kIdle, docs::GraspPhase::kIdle)
      .value("APPROACH", GraspPhase::kApproach, docs::GraspPhase::kApproach)
      .value("CLOSE", GraspPhase::kClose, docs::GraspPhase::kClose)
      .value("ENGAGE", GraspPhase::kEngage, docs::GraspPhase::kEngage)
      .value("HOLD", GraspPhase::kHold, docs::GraspPhase::kHold)
      .value("RELEASE", GraspPhase::kRelease, docs::GraspPhase::kRelease)
      .value("LOST", GraspPhase::kLost, docs::GraspPhase::kLost);

  nb::class_<JointState>(m, "JointState", docs::JointState::JointState)
      .def(
          "__init__",
          [](JointState* self, const Vector9& position, const Vector9& velocity,
             const Vector9& torque) {
            new (self) JointState{position.value, velocity.value, torque.value};
          },
          "position"_a, "velocity"_a, "torque"_a)
      .def_prop_ro("position", array_of(&JointState::position), docs::JointState::position)
      .def_prop_ro("velocity", array_of(&JointState::velocity), docs::JointState::velocity)
      .def_prop_ro("torque", array_of(&JointState::torque), docs::JointState::torque);

  nb::class_<GraspState>(m, "GraspState", docs::GraspState::GraspState)
      .def_ro("phase", &GraspState::phase)
      .def_ro("wanted", &GraspState::wanted, docs::GraspState::wanted)
      .def_prop_ro("normal_forces", array_of(&GraspState::normal_forces),
                   docs::GraspState::normal_forces)
      .def_prop_ro("tangential_forces", array_of(&GraspState::tangential_forces),
                   docs::GraspState::tangential_forces)
      .def_prop_ro("travel", array_of(&GraspState::travel), docs::GraspState::travel)
      .def_prop_ro("slip_speeds", array_of(&GraspState::slip_speeds), docs::GraspState::slip_speeds)
      .def_ro("felt", &GraspState::felt, docs::GraspState::felt)
      .def_ro("is_slipping", &GraspState::is_slipping, docs::GraspState::is_slipping)
      .def_ro("torque_share", &GraspState::torque_share, docs::GraspState::torque_share);

  nb::class_<GraspController>(m, "GraspController", docs::GraspController::GraspController)
      .def(
          "__init__",
          [](GraspController* self, const RigidBody& body, const std::string& config,
             const Overrides& overrides, GraspControllerConfig settings) {
            const RobotConfig robot = load_config(config, overrides);
            settings.limits = limits_of(robot);
            new (self) GraspController(description_of(robot), body, settings);
          },
          "body"_a, "config"_a = "sim", "overrides"_a = nb::dict(),
          nb::arg("settings").sig("...") = Config{},
          "`body` is the object. `config` and `overrides` give the robot and its limits, as in "
          "`Kinematics`.")
      .def("grasp", &GraspController::grasp, "touches"_a, "object"_a, docs::GraspController::grasp)
      .def("release", &GraspController::release, docs::GraspController::release)
      .def(
          "update",
          [](GraspController& controller, double elapsed, const JointState& joints,
             const Motion& object, const Motion& desired) {
            return Array{controller.update(Seconds(elapsed), joints, object, desired)};
          },
          "elapsed"_a, "joints"_a, "object"_a, "desired"_a, docs::GraspController::update)
      .def_prop_ro("state", &GraspController::state, nb::rv_policy::copy,
                   docs::GraspController::state);
}

}  // namespace

void bind_grasping(nb::module_& m) {
  bind_planner(m);
  bind_controller(m);
}

}  // namespace trifinger::bindings
