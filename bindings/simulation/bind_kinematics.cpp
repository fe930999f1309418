// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/pair.h>

#include <string>
#include <string_view>
#include <utility>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/numbers.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "docstrings.hpp"
#include "simulation.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/kinematics.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using Values = Eigen::VectorXd;

// Converts whatever NumPy accepts as a list of `size` numbers.
Values to_values(nb::handle object, Eigen::Index size, const char* what) {
  const auto [array, numbers] = doubles_of(object, {size}, what);
  return Eigen::Map<const Values>(numbers.data(), size);
}

JointValues joints(const Kinematics& kinematics, nb::handle position) {
  return to_values(position, kinematics.num_joints(), "position");
}

int checked_finger(const Kinematics& kinematics, int finger) {
  if (finger < 0 || finger >= kinematics.num_fingers()) {
    throw InvalidArgument("finger is " + std::to_string(finger) + ", must be 0 to " +
                          std::to_string(kinematics.num_fingers() - 1));
  }
  return finger;
}

std::string_view name_of(Reach reach) {
  switch (reach) {
    case Reach::kYes:
      return "yes";
    case Reach::kTooFar:
      return "too_far";
    case Reach::kTooClose:
      return "too_close";
    case Reach::kOutsideLimits:
      return "outside_limits";
  }
  return "";
}

}  // namespace

void bind_kinematics(nb::module_& m) {
  nb::class_<Kinematics>(m, "Kinematics", docs::Kinematics::Kinematics)
      .def(
          "__init__",
          [](Kinematics* self, const std::string& config, const Overrides& overrides) {
            new (self) Kinematics(description_of(load_config(config, overrides)));
          },
          "config"_a = "sim", "overrides"_a = nb::dict(),
          "`config` is the name of a configuration that comes with the package, or a file. "
          "`overrides` changes\nsingle values.")
      .def_prop_ro("num_fingers", &Kinematics::num_fingers, docs::Kinematics::num_fingers)
      .def_prop_ro("num_joints", &Kinematics::num_joints, docs::Kinematics::num_joints)
      .def(
          "tip_positions",
          [](Kinematics& kinematics, const ShownNumbers& position) {
            kinematics.update(joints(kinematics, position));
            return Array{RowMajor(
                kinematics.tip_positions().reshaped<Eigen::RowMajor>(kinematics.num_fingers(), 3))};
          },
          "position"_a,
          also(docs::Kinematics::tip_positions, R"(The result has a row for each finger.)"))
      .def(
          "tip_jacobian",
          [](Kinematics& kinematics, int finger, const ShownNumbers& position) {
            kinematics.update(joints(kinematics, position));
            return Array{RowMajor(kinematics.tip_jacobian(checked_finger(kinematics, finger)))};
          },
          "finger"_a, "position"_a, docs::Kinematics::tip_jacobian)
      .def(
          "tip_jacobians",
          [](Kinematics& kinematics, const ShownNumbers& position) {
            kinematics.update(joints(kinematics, position));
            return Array{RowMajor(kinematics.tip_jacobians())};
          },
          "position"_a, docs::Kinematics::tip_jacobians)
      .def(
          "tip_accelerations",
          [](Kinematics& kinematics, const ShownNumbers& position, const ShownNumbers& velocity) {
            kinematics.update(joints(kinematics, position));
            return Array{RowMajor(
                kinematics
                    .tip_accelerations(to_values(velocity, kinematics.num_joints(), "velocity"))
                    .reshaped<Eigen::RowMajor>(kinematics.num_fingers(), 3))};
          },
          "position"_a, "velocity"_a,
          also(docs::Kinematics::tip_accelerations, R"(The result has a row for each finger.)"))
      .def(
          "gravity_torques",
          [](Kinematics& kinematics, const ShownNumbers& position) {
            kinematics.update(joints(kinematics, position));
            return Array{Values(kinematics.gravity_torques())};
          },
          "position"_a, docs::Kinematics::gravity_torques)
      .def(
          "bias_torques",
          [](Kinematics& kinematics, const ShownNumbers& position, const ShownNumbers& velocity) {
            kinematics.update(joints(kinematics, position));
            return Array{Values(
                kinematics.bias_torques(to_values(velocity, kinematics.num_joints(), "velocity")))};
          },
          "position"_a, "velocity"_a, docs::Kinematics::bias_torques)
      .def(
          "mass_matrix",
          [](Kinematics& kinematics, const ShownNumbers& position) {
            kinematics.update(joints(kinematics, position));
            return Array{RowMajor(kinematics.mass_matrix())};
          },
          "position"_a, docs::Kinematics::mass_matrix)
      .def(
          "inverse_kinematics",
          [](const Kinematics& kinematics, int finger, const ShownNumbers& tip,
             const ShownNumbers& near) {
            checked_finger(kinematics, finger);
            const Eigen::Vector3d point = to_values(tip, 3, "tip");
            const FingerPose pose = near.is_none() ? kinematics.inverse_kinematics(finger, point)
                                                   : kinematics.inverse_kinematics(
                                                         finger, point, to_values(near, 3, "near"));
            const std::string_view reach = name_of(pose.reach);
            return std::pair(Array{pose.position}, nb::str(reach.data(), reach.size()));
          },
          "finger"_a, "tip"_a, "near"_a = nb::none(),
          also(
              docs::Kinematics::inverse_kinematics,
              R"(Returns the joint positions and 'yes', 'too_far', 'too_close' or 'outside_limits'. `near` is the
initial pose by default.)"));
}

}  // namespace trifinger::bindings
