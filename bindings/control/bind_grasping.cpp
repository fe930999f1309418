// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/text.hpp"
#include "simulation/simulation.hpp"
#include "trifinger/control/grasp_controller.hpp"
#include "trifinger/control/grasp_planner.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using namespace control;

// Times are plain numbers in Python.
double plain(Seconds time) { return time.count(); }
template <class T>
T plain(const T& value) {
  return value;
}

// One member of a struct of settings.
template <class C, class M>
struct Setting {
  using Plain = decltype(plain(std::declval<M>()));

  const char* name;
  M C::* member;
  const char* doc;

  [[nodiscard]] auto argument() const {
    nb::arg argument(name);
    // Otherwise Python would print the address of the default value.
    if constexpr (std::is_class_v<Plain>) argument.sig("...");
    return argument = plain(C{}.*member);
  }
  void bind(nb::class_<C>& type) const {
    type.def_prop_rw(
        name, [member = member](const C& settings) { return plain(settings.*member); },
        [member = member](C& settings, const Plain& value) { settings.*member = M(value); }, doc);
  }
};

template <class C, class M>
Setting(const char*, M C::*, const char*) -> Setting<C, M>;

// Binds a struct of settings: each can be given by name, and read and changed later.
template <class C, class... M>
void bind_settings(nb::class_<C> type, const Setting<C, M>&... settings) {
  type.def(
      "__init__",
      [settings...](C* self, const typename Setting<C, M>::Plain&... values) {
        new (self) C{};
        ((self->*settings.member = M(values)), ...);
      },
      nb::kw_only(), settings.argument()...);
  (settings.bind(type), ...);
}

// Returns the limits of a configuration's safety checks; nothing if it does not have three fingers.
std::optional<SafetyLimits> limits_of(const RobotConfig& config) {
  const auto* const options = std::get_if<SimulationOptions<TriFinger>>(&config.simulation);
  if (options == nullptr || !options->limits) return std::nullopt;
  const JointLimits<kMaxJoints>& limits = *options->limits;
  return SafetyLimits{.max_torque = values_of(limits, &JointLimit::max_torque),
                      .safety_kd = values_of(limits, &JointLimit::safety_kd),
                      .soft_lower = values_of(limits, &JointLimit::soft_lower),
                      .soft_upper = values_of(limits, &JointLimit::soft_upper)};
}

void bind_planner(nb::module_& m) {
  nb::class_<Touch>(
      m, "Touch",
      "The place where one tip touches an object, in the object's frame. Cannot be changed.")
      .def(
          "__init__",
          [](Touch* self, const Vector3& point, const Vector3& normal) {
            new (self) Touch{point, normal};
          },
          "point"_a, "normal"_a)
      .def_prop_ro("point", array_of(&Touch::point), "Point on the surface, from the centre [m].")
      .def_prop_ro("normal", array_of(&Touch::normal),
                   "Direction into the object, of unit length.");

  nb::class_<Approach>(m, "Approach",
                       "The way of a tip to its touch. The centre of the tip's sphere passes these "
                       "points, given in the world frame.")
      .def_prop_ro("above", array_of(&Approach::above), "[m]")
      .def_prop_ro("beside", array_of(&Approach::beside), "[m]");
  m.def("approach_to", &approach_to, "touch"_a, "object"_a, "tip_radius"_a,
        "The approach of a tip with radius `tip_radius` [m] to an object that rests at the pose "
        "`object`.");

  using Config = GraspPlannerConfig;
  bind_settings(
      nb::class_<Config>(m, "GraspPlannerConfig",
                         "The candidates that a planner compares, and its requirements."),
      Setting{"offsets", &Config::offsets,
              "Candidate offsets to both sides of a face's middle [m]."},
      Setting{"heights", &Config::heights, "Candidate heights above the object's centre [m]."},
      Setting{"friction", &Config::friction, "Friction coefficient that the forces rely on."},
      Setting{"friction_sides", &Config::friction_sides, "Sides of its friction pyramids, 3 to 8."},
      Setting{"min_normal_force", &Config::min_normal_force, "[N]"},
      Setting{"clearance", &Config::clearance,
              "Distance that fingers keep, except at touching tips [m]."},
      Setting{"limit_margin", &Config::limit_margin,
              "Distance that joints keep from their soft limits [rad]."},
      Setting{"largest_torque", &Config::largest_torque,
              "Share of the motors' torque that carrying may need."});

  nb::class_<PlannedGrasp>(m, "PlannedGrasp", "The result of a planner.")
      .def_ro("touches", &PlannedGrasp::touches, "Touches of the three tips, finger 0 first.")
      .def_ro(
          "torque_share", &PlannedGrasp::torque_share,
          "Largest share of a motor's torque that carrying the object needs anywhere on the way.");

  nb::class_<GraspPlanner>(
      m, "GraspPlanner",
      "Chooses which finger touches which side face of a box, and where. The fingers reach the "
      "whole way.\nOnly their tips touch anything, and they touch only the box. They carry it "
      "within friction, with as\nlittle torque as possible. One object must not be used by several "
      "threads at once.")
      .def(
          "__init__",
          [](GraspPlanner* self, const std::string& config, const nb::dict& overrides,
             const std::string& object, GraspPlannerConfig settings) {
            const RobotConfig robot = load_config(config, overrides);
            settings.limits = limits_of(robot);
            new (self) GraspPlanner(description_of(robot), object, std::move(settings));
          },
          "config"_a = "sim", "overrides"_a = nb::dict(), "object"_a = "cube",
          nb::arg("settings").sig("...") = Config{},
          nb::sig("def __init__(self, config: str = 'sim', overrides: dict[str, object] = {}, "
                  "object: str = 'cube', settings: GraspPlannerConfig = ...) -> None"),
          "`config` and `overrides` give the robot, its limits and the scene, as in `Kinematics`. "
          "`object` is\nthe name of the box.")
      .def(
          "plan",
          [](GraspPlanner& planner, const std::vector<Motion>& way) { return planner.plan(way); },
          "way"_a,
          "The best grasp to lead the object along `way`, which begins where it is grasped. None "
          "if there is\nnone. The object must stay as upright on the whole way as at its "
          "beginning. The call takes some\nmilliseconds.");
}

void bind_controller(nb::module_& m) {
  using Config = GraspControllerConfig;
  bind_settings(
      nb::class_<Config>(m, "GraspControllerConfig",
                         "Settings of a `GraspController`. docs/control.md explains the gains."),
      Setting{"object", &Config::object, "How stiffly the object is held."},
      Setting{"tips", &Config::tips, "How stiffly each tip is held."},
      Setting{"friction", &Config::friction,
              "Friction coefficient that the holding forces rely on."},
      Setting{"friction_sides", &Config::friction_sides, "Sides of its friction pyramids, 3 to 8."},
      Setting{"slip_friction", &Config::slip_friction,
              "Largest ratio of tangential to normal force of holding tips."},
      Setting{"min_normal_force", &Config::min_normal_force,
              "Smallest normal force of each holding tip [N]."},
      Setting{"max_normal_force", &Config::max_normal_force,
              "Largest normal force of each holding tip [N]."},
      Setting{"touch_force", &Config::touch_force, "Force that counts as a touch [N]."},
      Setting{"approach_speed", &Config::approach_speed,
              "Average speed of the tips on the way [m/s]."},
      Setting{"closing_speed", &Config::closing_speed,
              "Speed of tips that search for the faces [m/s]."},
      Setting{"penetration", &Config::penetration,
              "Depth inside the object up to which the tips search for a face [m]."},
      Setting{"closing_time", &Config::closing_time,
              "Time in which all tips must have felt their faces [s]."},
      Setting{"engage_time", &Config::engage_time, "Time in which a touch becomes a hold [s]."},
      Setting{"roll_time", &Config::roll_time,
              "Time constant with which targets follow rolling tips [s]."},
      Setting{"slip_speed", &Config::slip_speed,
              "Speed of a tip along its face above which it slips [m/s]."},
      Setting{"lost_time", &Config::lost_time,
              "Time without touch after which the object is lost [s]."},
      Setting{"lost_distance", &Config::lost_distance,
              "Distance from its target at which the object is lost [m]."});

  nb::enum_<GraspPhase>(m, "GraspPhase", "The phase of a `GraspController`.")
      .value("IDLE", GraspPhase::kIdle, "The tips stay where they are.")
      .value("APPROACH", GraspPhase::kApproach, "The tips go to the object without touching it.")
      .value("CLOSE", GraspPhase::kClose,
             "The tips move towards the faces until all of them feel a touch.")
      .value("ENGAGE", GraspPhase::kEngage, "The forces grow until they hold the object.")
      .value("HOLD", GraspPhase::kHold, "The object follows the desired motion.")
      .value("RELEASE", GraspPhase::kRelease, "The tips move off the faces, and then up.")
      .value("LOST", GraspPhase::kLost,
             "The object slipped away or was not at its place. The tips stay; release them.");

  nb::class_<JointState>(
      m, "JointState", "Measurements of the nine joints, finger 0 first, from the base to the tip.")
      .def(
          "__init__",
          [](JointState* self, const Vector9& position, const Vector9& velocity,
             const Vector9& torque) {
            new (self) JointState{position.value, velocity.value, torque.value};
          },
          "position"_a, "velocity"_a, "torque"_a)
      .def_prop_ro("position", array_of(&JointState::position), "[rad]")
      .def_prop_ro("velocity", array_of(&JointState::velocity), "[rad/s]")
      .def_prop_ro("torque", array_of(&JointState::torque), "[Nm]");

  nb::class_<GraspState>(m, "GraspState",
                         "The state of a `GraspController`: its phase and its forces.")
      .def_ro("phase", &GraspState::phase)
      .def_ro("wanted", &GraspState::wanted,
              "The wanted contact forces while the object is held, in the world frame.")
      .def_prop_ro("normal_forces", array_of(&GraspState::normal_forces),
                   "Forces with which the three tips press along their faces' normals [N], "
                   "computed from the joints' torques.")
      .def_prop_ro("tangential_forces", array_of(&GraspState::tangential_forces),
                   "Forces with which the three tips press across their faces' normals [N], "
                   "computed from the joints' torques.")
      .def_prop_ro("travel", array_of(&GraspState::travel),
                   "How far each of the three tips has moved along its face by rolling and "
                   "slipping, since all tips touched [m].")
      .def_prop_ro("slip_speeds", array_of(&GraspState::slip_speeds),
                   "Speeds of `travel`, low-pass filtered at 5 Hz [m/s].")
      .def_ro("is_slipping", &GraspState::is_slipping,
              "True if a tip moves along its face faster than tips roll.")
      .def_ro("torque_share", &GraspState::torque_share,
              "The largest ratio of a requested torque to its joint's limit. The safety checks cut "
              "off everything above 1.");

  nb::class_<GraspController>(
      m, "GraspController",
      "The paper's controller: it grasps an object with three tips, makes it follow a motion, and "
      "releases\nit. Its equations are in docs/control.md. Call `update` once per step. One object "
      "must not be used\nby several threads at once.")
      .def(
          "__init__",
          [](GraspController* self, const RigidBody& body, const std::string& config,
             const nb::dict& overrides, GraspControllerConfig settings) {
            const RobotConfig robot = load_config(config, overrides);
            settings.limits = limits_of(robot);
            new (self) GraspController(description_of(robot), body, settings);
          },
          "body"_a, "config"_a = "sim", "overrides"_a = nb::dict(), "settings"_a = Config{},
          nb::sig("def __init__(self, body: RigidBody, config: str = 'sim', overrides: dict[str, "
                  "object] = {}, settings: GraspControllerConfig = ...) -> None"),
          "`body` is the object. `config` and `overrides` give the robot and its limits, as in "
          "`Kinematics`.")
      .def("grasp", &GraspController::grasp, "touches"_a, "object"_a,
           "Goes to the object, which rests at the pose `object`, and grasps it at three "
           "`touches`, finger 0 first.")
      .def("release", &GraspController::release, "Releases the object in any phase.")
      .def(
          "update",
          [](GraspController& controller, double elapsed, const JointState& joints,
             const Motion& object, const Motion& desired) {
            return Array{controller.update(Seconds(elapsed), joints, object, desired)};
          },
          "elapsed"_a, "joints"_a, "object"_a, "desired"_a,
          "Returns the nine joint torques for the next step [Nm], `elapsed` [s] after the previous "
          "step.\n`object` is the object's pose and motion. `desired` is its desired motion while "
          "it is held; before\nthat, pass the pose where it rests.")
      .def_prop_ro("state", &GraspController::state, nb::rv_policy::copy,
                   "The state after the last `update`.");
}

}  // namespace

void bind_grasping(nb::module_& m) {
  bind_planner(m);
  bind_controller(m);
}

}  // namespace trifinger::bindings
