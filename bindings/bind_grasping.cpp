// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "array.hpp"
#include "bindings.hpp"
#include "simulation.hpp"
#include "text.hpp"
#include "trifinger/control/grasp_controller.hpp"
#include "trifinger/control/grasp_planner.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::python {
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
    // Python would print where in memory it lies.
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

// All of them may be given by name, and read and changed later.
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

// What the safety checks of a configuration do; nothing if it has not three fingers.
std::optional<SafetyLimits> limits_of(const RobotConfig& config) {
  const auto* const options = std::get_if<SimulationOptions<TriFinger>>(&config.simulation);
  if (options == nullptr || !options->limits) return std::nullopt;
  const JointLimits<kMaxJoints>& limits = *options->limits;
  return SafetyLimits{limits.max_torque, limits.safety_kd, limits.soft_lower, limits.soft_upper};
}

void bind_planner(nb::module_& m) {
  nb::class_<Touch>(m, "Touch",
                    "Where one tip touches an object, in the object's frame. Cannot be changed.")
      .def(
          "__init__",
          [](Touch* self, const Vector3& point, const Vector3& normal) {
            new (self) Touch{point, normal};
          },
          "point"_a, "normal"_a)
      .def_prop_ro("point", array_of(&Touch::point), "On the surface, from the centre [m].")
      .def_prop_ro("normal", array_of(&Touch::normal), "Into the object, of unit length.");

  nb::class_<Approach>(m, "Approach",
                       "How a tip comes to its touch: through these points, for the centre of its "
                       "sphere, in the world frame.")
      .def_prop_ro("above", array_of(&Approach::above), "[m]")
      .def_prop_ro("beside", array_of(&Approach::beside), "[m]");
  m.def("approach_to", &approach_to, "touch"_a, "object"_a, "tip_radius"_a,
        "The approach of a tip of `tip_radius` [m] to an object at rest at the pose `object`.");

  using Config = GraspPlannerConfig;
  bind_settings(
      nb::class_<Config>(m, "GraspPlannerConfig",
                         "Among what a planner looks, and what it asks for."),
      Setting{"offsets", &Config::offsets, "To both sides of a face's middle [m]."},
      Setting{"heights", &Config::heights, "Above the object's centre [m]."},
      Setting{"friction", &Config::friction, "On which the forces rely."},
      Setting{"friction_sides", &Config::friction_sides, "Of its pyramids, 3 to 8."},
      Setting{"min_normal_force", &Config::min_normal_force, "[N]"},
      Setting{"clearance", &Config::clearance,
              "Of fingers from all they do not touch with their tips [m]."},
      Setting{"limit_margin", &Config::limit_margin, "Of joints from their soft limits [rad]."},
      Setting{"largest_torque", &Config::largest_torque,
              "Share of the motors' torque that carrying may take."});

  nb::class_<PlannedGrasp>(m, "PlannedGrasp", "What a planner has chosen.")
      .def_ro("touches", &PlannedGrasp::touches, "One for each of the three tips, finger 0 first.")
      .def_ro("torque_share", &PlannedGrasp::torque_share,
              "The largest share of a motor's torque that carrying the object takes, anywhere on "
              "the way.");

  nb::class_<GraspPlanner>(
      m, "GraspPlanner",
      "Chooses which finger touches which side face of a box, and where. The fingers reach the "
      "whole way, touch nothing\nbut the box with nothing but their tips, carry it within friction "
      "and ask for as little torque as can be. Not for\nseveral threads at once.")
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
          "For the robot, the limits and the scene of a configuration, as in `Kinematics`; "
          "`object` is the name of the box.")
      .def(
          "plan",
          [](GraspPlanner& planner, const std::vector<Motion>& way) { return planner.plan(way); },
          "way"_a,
          "The best grasp for leading the object along `way`, which begins where it is grasped; "
          "None if there is none. The\nobject is as upright on all of the way as where it begins. "
          "Takes some milliseconds.");
}

void bind_controller(nb::module_& m) {
  using Config = GraspControllerConfig;
  bind_settings(
      nb::class_<Config>(m, "GraspControllerConfig", "How a `GraspController` works."),
      Setting{"object", &Config::object, "How stiffly the object is held."},
      Setting{"tips", &Config::tips, "How stiffly each tip is."},
      Setting{"friction", &Config::friction, "On which the forces that hold the object rely."},
      Setting{"friction_sides", &Config::friction_sides, "Of its pyramids, 3 to 8."},
      Setting{"slip_friction", &Config::slip_friction,
              "Tangential forces of tips that hold never exceed this share."},
      Setting{"min_normal_force", &Config::min_normal_force, "Of each tip while it holds [N]."},
      Setting{"max_normal_force", &Config::max_normal_force, "Likewise [N]."},
      Setting{"touch_force", &Config::touch_force, "What is felt as a touch [N]."},
      Setting{"approach_speed", &Config::approach_speed, "Of the tips, on average [m/s]."},
      Setting{"closing_speed", &Config::closing_speed, "With which tips look for the faces [m/s]."},
      Setting{"penetration", &Config::penetration, "How far behind a face they look for it [m]."},
      Setting{"closing_time", &Config::closing_time,
              "In which all tips must have felt their faces [s]."},
      Setting{"engage_time", &Config::engage_time, "In which touching becomes holding [s]."},
      Setting{"roll_time", &Config::roll_time,
              "In which the tips' targets follow tips that roll [s]."},
      Setting{"slip_speed", &Config::slip_speed,
              "Of a tip along its face, above which it slips [m/s]."},
      Setting{"lost_time", &Config::lost_time,
              "Without touch, after which the object is lost [s]."},
      Setting{"lost_distance", &Config::lost_distance, "From where it should be, likewise [m]."});

  nb::enum_<GraspPhase>(m, "GraspPhase", "What a `GraspController` is doing.")
      .value("IDLE", GraspPhase::kIdle, "The tips stay where they are.")
      .value("APPROACH", GraspPhase::kApproach, "On the way to the object, without touching it.")
      .value("CLOSE", GraspPhase::kClose, "Towards the faces, until all tips feel them.")
      .value("ENGAGE", GraspPhase::kEngage, "Forces grow until they hold the object.")
      .value("HOLD", GraspPhase::kHold, "The object follows the desired motion.")
      .value("RELEASE", GraspPhase::kRelease, "Off the faces, and up.")
      .value("LOST", GraspPhase::kLost,
             "It slipped away, or was not where it should be. The tips stay: release them.");

  nb::class_<JointState>(m, "JointState",
                         "What the nine joints measure, finger 0 first, from the base to the tip.")
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

  nb::class_<GraspState>(m, "GraspState", "What a `GraspController` feels and does.")
      .def_ro("phase", &GraspState::phase)
      .def_ro("wanted", &GraspState::wanted,
              "Of the contacts while the object is held, in the world frame.")
      .def_prop_ro("normal_forces", array_of(&GraspState::normal_forces),
                   "What the three tips press with along their faces' normals, from the joints' "
                   "torques [N].")
      .def_prop_ro("tangential_forces", array_of(&GraspState::tangential_forces),
                   "Likewise across the normals [N].")
      .def_prop_ro("travel", array_of(&GraspState::travel),
                   "How far each of the three tips has moved along its face since all of them "
                   "touched, by rolling and slipping\n[m].")
      .def_prop_ro("slip_speeds", array_of(&GraspState::slip_speeds),
                   "How fast they do so, without what is faster than 5 Hz [m/s].")
      .def_ro("is_slipping", &GraspState::is_slipping,
              "A tip moves along its face faster than tips roll.")
      .def_ro("torque_share", &GraspState::torque_share,
              "The largest share of a joint's torque limit that is asked for; what is above 1 the "
              "safety checks cut off.");

  nb::class_<GraspController>(
      m, "GraspController",
      "The paper's controller: grasps an object with three tips, makes it follow a motion, and "
      "lets it go. Its equations are\nin docs/control.md. Call `update` once per step. Not for "
      "several threads at once.")
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
          "`body` is the object, the robot and its limits are those of a configuration, as in "
          "`Kinematics`.")
      .def("grasp", &GraspController::grasp, "touches"_a, "object"_a,
           "Goes to the object, which rests at the pose `object`, and takes it at three `touches`, "
           "finger 0 first.")
      .def("release", &GraspController::release, "Lets the object go, whatever the phase.")
      .def(
          "update",
          [](GraspController& controller, double elapsed, const JointState& joints,
             const Motion& object, const Motion& desired) {
            return Array{controller.update(Seconds(elapsed), joints, object, desired)};
          },
          "elapsed"_a, "joints"_a, "object"_a, "desired"_a,
          "The nine joint torques for the next step [Nm], `elapsed` [s] after the step before. "
          "`object` is where the object\nis and how it moves, `desired` how it should while it is "
          "held; until it is, `desired` should be where it rests.")
      .def_prop_ro("state", &GraspController::state, nb::rv_policy::copy,
                   "As of the last `update`.");
}

}  // namespace

void bind_grasping(nb::module_& m) {
  bind_planner(m);
  bind_controller(m);
}

}  // namespace trifinger::python
