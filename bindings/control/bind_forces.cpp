// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>

#include <optional>
#include <string>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/text.hpp"
#include "docstrings.hpp"
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
  nb::class_<Wrench>(m, "Wrench", docs::Wrench::Wrench)
      .def(
          "__init__",
          [](Wrench* self, const Vector3& force, const Vector3& moment) {
            new (self) Wrench{force, moment};
          },
          "force"_a = zeros(), "moment"_a = zeros())
      .def_prop_ro("force", array_of(&Wrench::force), docs::Wrench::force)
      .def_prop_ro("moment", array_of(&Wrench::moment), docs::Wrench::moment);

  const Contact usual;
  nb::class_<Contact>(m, "Contact", docs::Contact::Contact)
      .def(
          "__init__",
          [](Contact* self, const Vector3& position, const Vector3& normal, double friction,
             double min_normal_force, double max_normal_force) {
            new (self) Contact{position, normal, friction, min_normal_force, max_normal_force};
          },
          "position"_a, "normal"_a, "friction"_a = usual.friction,
          "min_normal_force"_a = usual.min_normal_force,
          "max_normal_force"_a = usual.max_normal_force)
      .def_prop_ro("position", array_of(&Contact::position), docs::Contact::position)
      .def_prop_ro("normal", array_of(&Contact::normal), docs::Contact::normal)
      .def_ro("friction", &Contact::friction, docs::Contact::friction)
      .def_ro("min_normal_force", &Contact::min_normal_force, docs::Contact::min_normal_force)
      .def_ro("max_normal_force", &Contact::max_normal_force, docs::Contact::max_normal_force);

  m.def(
      "contact_frame", [](const Vector3& normal) { return Array{contact_frame(normal)}; },
      "normal"_a, docs::contact_frame);
  m.def(
      "grasp_map",
      [](const Grasp& grasp, const Vector3& centre) { return Array{grasp_map(grasp, centre)}; },
      "grasp"_a, "centre"_a, docs::grasp_map);
  m.def(
      "wrench_of",
      [](const Grasp& grasp, const Vector3& centre, const Vector9& forces) {
        return wrench_of(grasp, centre, forces);
      },
      "grasp"_a, "centre"_a, "forces"_a, docs::wrench_of);

  nb::class_<FrictionPyramid>(m, "FrictionPyramid", docs::FrictionPyramid::FrictionPyramid)
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
          "i"_a, "friction"_a, docs::FrictionPyramid::side)
      .def(
          "margin",
          [](const FrictionPyramid& pyramid, const Vector3& force, double friction) {
            return pyramid.margin(force, friction);
          },
          "force"_a, "friction"_a, docs::FrictionPyramid::margin);
}

void bind_force_optimizer(nb::module_& m) {
  nb::class_<TorqueLimits>(m, "TorqueLimits", docs::TorqueLimits::TorqueLimits)
      .def(
          "__init__",
          [](TorqueLimits* self, const Matrix9& jacobians, const Vector9& bias,
             const Vector9& limits) { new (self) TorqueLimits{jacobians, bias, limits}; },
          "jacobians"_a, "bias"_a, "limits"_a)
      .def_prop_ro("jacobians", array_of(&TorqueLimits::jacobians), docs::TorqueLimits::jacobians)
      .def_prop_ro("bias", array_of(&TorqueLimits::bias), docs::TorqueLimits::bias)
      .def_prop_ro("limits", array_of(&TorqueLimits::limits), docs::TorqueLimits::limits);

  nb::enum_<ForceStatus>(m, "ForceStatus", docs::ForceStatus::ForceStatus)
      .value("EXACT", ForceStatus::kExact, docs::ForceStatus::kExact)
      .value("CLOSEST_WRENCH", ForceStatus::kClosestWrench, docs::ForceStatus::kClosestWrench)
      .value("TORQUE_LIMITS_EXCEEDED", ForceStatus::kTorqueLimitsExceeded,
             docs::ForceStatus::kTorqueLimitsExceeded)
      .value("INVALID", ForceStatus::kInvalid, docs::ForceStatus::kInvalid);

  nb::class_<ForceDistribution>(m, "ForceDistribution", docs::ForceDistribution::ForceDistribution)
      .def_prop_ro("forces", array_of(&ForceDistribution::forces), docs::ForceDistribution::forces)
      .def_ro("wrench", &ForceDistribution::wrench, docs::ForceDistribution::wrench)
      .def_ro("status", &ForceDistribution::status)
      .def("__bool__", [](const ForceDistribution& found) { return static_cast<bool>(found); });

  const ForceOptimizerConfig usual;
  nb::class_<ForceOptimizer>(m, "ForceOptimizer", docs::ForceOptimizer::ForceOptimizer)
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
          "grasp"_a, "centre"_a, "wrench"_a, "torques"_a = nb::none(), docs::ForceOptimizer::solve);
}

ObjectShape shape_of(const std::string& name) {
  if (name == "box") return ObjectShape::kBox;
  if (name == "stick") return ObjectShape::kStick;
  if (name == "ball") return ObjectShape::kBall;
  throw InvalidArgument("there is no shape '" + name + "', only box, stick, ball");
}

void bind_impedance(nb::module_& m) {
  nb::class_<RigidBody>(m, "RigidBody", docs::RigidBody::RigidBody)
      .def(
          "__init__",
          [](RigidBody* self, double mass, const Matrix3& inertia) {
            new (self) RigidBody{mass, inertia};
          },
          "mass"_a, "inertia"_a)
      .def_ro("mass", &RigidBody::mass, docs::RigidBody::mass)
      .def_prop_ro("inertia", array_of(&RigidBody::inertia), docs::RigidBody::inertia);
  m.def(
      "rigid_body",
      [](const std::string& shape, const Vector3& size, double mass) {
        return rigid_body({.name = {},
                           .shape = shape_of(shape),
                           .size = {size.value[0], size.value[1], size.value[2]},
                           .mass = mass});
      },
      "shape"_a, "size"_a, "mass"_a,
      also(docs::rigid_body, R"(`shape` is "box", "stick" or "ball".)"));
  m.def("gravity", [] { return Array{gravity()}; }, docs::gravity);

  const ObjectGains object;
  nb::class_<ObjectGains>(m, "ObjectGains", docs::ObjectGains::ObjectGains)
      .def(
          "__init__",
          [](ObjectGains* self, double stiffness, double damping, double rotational_stiffness,
             double rotational_damping) {
            new (self) ObjectGains{stiffness, damping, rotational_stiffness, rotational_damping};
          },
          "stiffness"_a = object.stiffness, "damping"_a = object.damping,
          "rotational_stiffness"_a = object.rotational_stiffness,
          "rotational_damping"_a = object.rotational_damping)
      .def_rw("stiffness", &ObjectGains::stiffness, docs::ObjectGains::stiffness)
      .def_rw("damping", &ObjectGains::damping, docs::ObjectGains::damping)
      .def_rw("rotational_stiffness", &ObjectGains::rotational_stiffness,
              docs::ObjectGains::rotational_stiffness)
      .def_rw("rotational_damping", &ObjectGains::rotational_damping,
              docs::ObjectGains::rotational_damping);
  m.def("object_impedance", &object_impedance, "desired"_a, "pose"_a, "twist"_a, "body"_a,
        nb::arg("gains").sig("...") = object, docs::object_impedance);

  const TipGains tip;
  nb::class_<TipGains>(m, "TipGains", docs::TipGains::TipGains)
      .def(
          "__init__",
          [](TipGains* self, double stiffness, double damping) {
            new (self) TipGains{stiffness, damping};
          },
          "stiffness"_a = tip.stiffness, "damping"_a = tip.damping)
      .def_rw("stiffness", &TipGains::stiffness, docs::TipGains::stiffness)
      .def_rw("damping", &TipGains::damping, docs::TipGains::damping);
  m.def(
      "tip_impedance",
      [](const PointMotion& desired, const Vector3& position, const Vector3& velocity,
         const TipGains& gains) {
        return Array{tip_impedance(desired, position, velocity, gains)};
      },
      "desired"_a, "position"_a, "velocity"_a, nb::arg("gains").sig("...") = tip,
      docs::tip_impedance);
}

}  // namespace

void bind_forces(nb::module_& m) {
  bind_grasp(m);
  bind_force_optimizer(m);
  bind_impedance(m);
}

}  // namespace trifinger::bindings
