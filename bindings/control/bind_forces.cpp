// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>

#include <optional>
#include <string>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/text.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/control/force_optimizer.hpp"
#include "trifinger/control/grasp.hpp"
#include "trifinger/control/impedance.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using namespace control;

using Matrix3 = Array<Eigen::Matrix3d>;
using Matrix9 = Array<Eigen::Matrix<double, 9, 9>>;

void bind_grasp(nb::module_& m) {
  nb::class_<Wrench>(m, "Wrench", "A force and a moment. Cannot be changed.")
      .def(
          "__init__",
          [](Wrench* self, const Vector3& force, const Vector3& moment) {
            new (self) Wrench{force, moment};
          },
          "force"_a = zeros(), "moment"_a = zeros())
      .def_prop_ro("force", array_of(&Wrench::force), "[N]")
      .def_prop_ro("moment", array_of(&Wrench::moment),
                   "Moment about a point that is stated with each use [Nm].");

  const Contact usual;
  nb::class_<Contact>(m, "Contact",
                      "A point at which a tip touches an object and pushes, with friction and "
                      "without adhesion. Cannot be changed.\n\nA tip that does not touch is a "
                      "contact whose `max_normal_force` is 0. It gets no force.")
      .def(
          "__init__",
          [](Contact* self, const Vector3& position, const Vector3& normal, double friction,
             double min_normal_force, double max_normal_force) {
            new (self) Contact{position, normal, friction, min_normal_force, max_normal_force};
          },
          "position"_a, "normal"_a, "friction"_a = usual.friction,
          "min_normal_force"_a = usual.min_normal_force,
          "max_normal_force"_a = usual.max_normal_force)
      .def_prop_ro("position", array_of(&Contact::position), "[m]")
      .def_prop_ro(
          "normal", array_of(&Contact::normal),
          "Direction in which the tip can push, into the object; its length must not be zero.")
      .def_ro("friction", &Contact::friction,
              "Coefficient that a controller relies on; it should be lower than the real one.")
      .def_ro("min_normal_force", &Contact::min_normal_force, "[N]")
      .def_ro("max_normal_force", &Contact::max_normal_force, "[N]");

  m.def(
      "contact_frame", [](const Vector3& normal) { return Array{contact_frame(normal)}; },
      "normal"_a,
      "A matrix whose columns are two tangents and `normal`, orthonormal and right-handed. The "
      "first\ntangent is perpendicular to z, or to x if the normal is nearly along z.");
  m.def(
      "grasp_map",
      [](const Grasp& grasp, const Vector3& centre) { return Array{grasp_map(grasp, centre)}; },
      "grasp"_a, "centre"_a,
      "The map from contact forces to the wrench on the object about `centre` [m]. It has 6 rows, "
      "force and\nmoment, and 9 columns, three for each of the three contacts.");
  m.def(
      "wrench_of",
      [](const Grasp& grasp, const Vector3& centre, const Vector9& forces) {
        return wrench_of(grasp, centre, forces);
      },
      "grasp"_a, "centre"_a, "forces"_a,
      "The total wrench of nine `forces` [N] at the three contacts, about `centre` [m].");

  nb::class_<FrictionPyramid>(
      m, "FrictionPyramid",
      "A pyramid of 3 to 8 sides inside Coulomb's friction cone: a contact whose force lies in the "
      "pyramid\ndoes not slip. With four sides it is the paper's pyramid.")
      .def(nb::init<int>(), "sides"_a = 4)
      .def_prop_ro("sides", &FrictionPyramid::sides)
      .def(
          "side",
          [](const FrictionPyramid& pyramid, int i, double friction) {
            if (i < 0 || i >= pyramid.sides()) {
              throw InvalidArgument("side is " + std::to_string(i) + ", must be 0 to " +
                                    std::to_string(pyramid.sides() - 1));
            }
            return Array{pyramid.side(i, friction)};
          },
          "i"_a, "friction"_a,
          "A vector that points inward from side `i`, in the contact frame. Its tangential part "
          "has length 1.")
      .def(
          "margin",
          [](const FrictionPyramid& pyramid, const Vector3& force, double friction) {
            return pyramid.margin(force, friction);
          },
          "force"_a, "friction"_a,
          "Tangential force that could be added to `force` [N] before it leaves the pyramid, in "
          "the direction\nwith the least room. Negative outside. `force` is in the contact frame.");
}

void bind_force_optimizer(nb::module_& m) {
  nb::class_<TorqueLimits>(
      m, "TorqueLimits",
      "The torques that the joints can give to press with the tips. Cannot be changed.")
      .def(
          "__init__",
          [](TorqueLimits* self, const Matrix9& jacobians, const Vector9& bias,
             const Vector9& limits) { new (self) TorqueLimits{jacobians, bias, limits}; },
          "jacobians"_a, "bias"_a, "limits"_a)
      .def_prop_ro("jacobians", array_of(&TorqueLimits::jacobians),
                   "Jacobians of the contacts in the frame of the grasp, 9 x 9 [m/rad]. For the "
                   "world frame this is\n`Kinematics.tip_jacobians`.")
      .def_prop_ro(
          "bias", array_of(&TorqueLimits::bias),
          "Torques that the joints need without any contact [Nm]: `Kinematics.bias_torques`.")
      .def_prop_ro("limits", array_of(&TorqueLimits::limits), "[Nm]");

  nb::enum_<ForceStatus>(m, "ForceStatus",
                         "Quality of a result of the force optimisation, best first.")
      .value("EXACT", ForceStatus::kExact, "The forces make exactly the wanted wrench.")
      .value("CLOSEST_WRENCH", ForceStatus::kClosestWrench,
             "No allowed forces make the wanted wrench; these come closest to it.")
      .value("TORQUE_LIMITS_EXCEEDED", ForceStatus::kTorqueLimitsExceeded,
             "Even the smallest normal forces need more torque than the limits allow. The torque "
             "limits were ignored.")
      .value("INVALID", ForceStatus::kInvalid,
             "A number was not finite or out of its range. All forces are zero.");

  nb::class_<ForceDistribution>(m, "ForceDistribution", "A result of the force optimisation.")
      .def_prop_ro("forces", array_of(&ForceDistribution::forces),
                   "Forces of the tips on the object [N], in the frame of the grasp: three numbers "
                   "for each of the three contacts.")
      .def_ro("wrench", &ForceDistribution::wrench, "The wrench that the forces make.")
      .def_ro("status", &ForceDistribution::status)
      .def("__bool__", [](const ForceDistribution& found) { return static_cast<bool>(found); });

  const ForceOptimizerConfig usual;
  nb::class_<ForceOptimizer>(m, "ForceOptimizer",
                             "Finds the contact forces that make a wanted wrench, with the paper's "
                             "quadratic program and with\nbounds on normal forces and joint "
                             "torques. One object must not be used by several threads at once.")
      .def(
          "__init__",
          [](ForceOptimizer* self, int friction_sides, double normal_weight,
             double tangential_weight) {
            new (self) ForceOptimizer({.friction_sides = friction_sides,
                                       .normal_weight = normal_weight,
                                       .tangential_weight = tangential_weight});
          },
          "friction_sides"_a = usual.friction_sides, "normal_weight"_a = usual.normal_weight,
          "tangential_weight"_a = usual.tangential_weight)
      .def(
          "solve",
          [](ForceOptimizer& optimizer, const Grasp& grasp, const Vector3& centre,
             const Wrench& wrench, std::optional<TorqueLimits> torques) {
            return torques ? optimizer.solve(grasp, centre, wrench, *torques)
                           : optimizer.solve(grasp, centre, wrench);
          },
          "grasp"_a, "centre"_a, "wrench"_a, "torques"_a = nb::none(),
          "Distributes `wrench`, which is given about `centre` [m], over the three contacts. If "
          "that is\nimpossible, the result comes closest to it and its `status` says so.");
}

ObjectShape shape_of(const std::string& name) {
  if (name == "box") return ObjectShape::kBox;
  if (name == "stick") return ObjectShape::kStick;
  if (name == "ball") return ObjectShape::kBall;
  throw InvalidArgument("there is no shape '" + name + "', only box, stick, ball");
}

void bind_impedance(nb::module_& m) {
  nb::class_<RigidBody>(m, "RigidBody", "Mass and inertia of a rigid body. Cannot be changed.")
      .def(
          "__init__",
          [](RigidBody* self, double mass, const Matrix3& inertia) {
            new (self) RigidBody{mass, inertia};
          },
          "mass"_a, "inertia"_a)
      .def_ro("mass", &RigidBody::mass, "[kg]")
      .def_prop_ro("inertia", array_of(&RigidBody::inertia),
                   "Inertia about the centre of mass, in the body's frame [kg m^2].");
  m.def(
      "rigid_body",
      [](const std::string& shape, const Vector3& size, double mass) {
        return rigid_body({.name = {},
                           .shape = shape_of(shape),
                           .size = {size.value[0], size.value[1], size.value[2]},
                           .mass = mass});
      },
      "shape"_a, "size"_a, "mass"_a,
      "Mass and inertia of an object whose mass is evenly spread: a 'box', a 'stick' along x, or a "
      "'ball'.\n`size` has the whole lengths x, y, z of a box, the length and diameter of a stick, "
      "or the diameter\nof a ball [m].");
  m.def(
      "gravity", [] { return Array{gravity()}; },
      "Standard gravity as in MuJoCo's models [m/s^2], in the world frame.");

  const ObjectGains object;
  nb::class_<ObjectGains>(m, "ObjectGains", "How stiffly an object is held.")
      .def(
          "__init__",
          [](ObjectGains* self, double stiffness, double damping, double rotational_stiffness,
             double rotational_damping) {
            new (self) ObjectGains{stiffness, damping, rotational_stiffness, rotational_damping};
          },
          "stiffness"_a = object.stiffness, "damping"_a = object.damping,
          "rotational_stiffness"_a = object.rotational_stiffness,
          "rotational_damping"_a = object.rotational_damping)
      .def_rw("stiffness", &ObjectGains::stiffness, "[N/m]")
      .def_rw("damping", &ObjectGains::damping, "[Ns/m]")
      .def_rw("rotational_stiffness", &ObjectGains::rotational_stiffness, "[Nm/rad]")
      .def_rw("rotational_damping", &ObjectGains::rotational_damping, "[Nms/rad]");
  m.def("object_impedance", &object_impedance, "desired"_a, "pose"_a, "twist"_a, "body"_a,
        "gains"_a = object,
        nb::sig("def object_impedance(desired: Motion, pose: Pose, twist: Twist, body: RigidBody, "
                "gains: ObjectGains = ...) -> Wrench"),
        "The wrench about the object's centre that keeps the object on its way, in the world "
        "frame. It\nincludes the object's weight and inertia.");

  const TipGains tip;
  nb::class_<TipGains>(m, "TipGains", "How stiffly a tip is held.")
      .def(
          "__init__",
          [](TipGains* self, double stiffness, double damping) {
            new (self) TipGains{stiffness, damping};
          },
          "stiffness"_a = tip.stiffness, "damping"_a = tip.damping)
      .def_rw("stiffness", &TipGains::stiffness, "[N/m]")
      .def_rw("damping", &TipGains::damping, "[Ns/m]");
  m.def(
      "tip_impedance",
      [](const PointMotion& desired, const Vector3& position, const Vector3& velocity,
         const TipGains& gains) {
        return Array{tip_impedance(desired, position, velocity, gains)};
      },
      "desired"_a, "position"_a, "velocity"_a, "gains"_a = tip,
      nb::sig("def tip_impedance(desired: PointMotion, position: numpy.typing.ArrayLike, velocity: "
              "numpy.typing.ArrayLike, gains: TipGains = ...) -> "
              "numpy.typing.NDArray[numpy.float64]"),
      "The force that brings a tip to its desired position [N]. Add the force with which the tip "
      "should press.");
}

}  // namespace

void bind_forces(nb::module_& m) {
  bind_grasp(m);
  bind_force_optimizer(m);
  bind_impedance(m);
}

}  // namespace trifinger::bindings
