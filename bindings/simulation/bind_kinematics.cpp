// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/pair.h>

#include <string>
#include <string_view>
#include <utility>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/numpy.hpp"
#include "conversion/text.hpp"
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
  const nb::object array =
      nb::steal(PyArray_FROM_OTF(object.ptr(), NPY_DOUBLE, NPY_ARRAY_IN_ARRAY));
  if (!array.is_valid()) throw nb::python_error();
  auto* const numbers = reinterpret_cast<PyArrayObject*>(array.ptr());
  if (PyArray_NDIM(numbers) != 1 || PyArray_DIM(numbers, 0) != size) {
    throw InvalidArgument(std::string(what) + " has shape " +
                          nb::str(nb::handle(array).attr("shape")).c_str() + ", must have (" +
                          std::to_string(size) + ",)");
  }
  return Eigen::Map<const Values>(static_cast<const double*>(PyArray_DATA(numbers)), size);
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
  nb::class_<Kinematics>(m, "Kinematics",
                         "Kinematics and dynamics of the fingers, without contacts and objects. "
                         "Everything is in the world\nframe: z up, origin on the table. One object "
                         "must not be used by several threads at once: make one\nfor each.")
      .def(
          "__init__",
          [](Kinematics* self, const std::string& config, const nb::dict& overrides) {
            new (self) Kinematics(description_of(load_config(config, overrides)));
          },
          "config"_a = "sim", "overrides"_a = nb::dict(),
          nb::sig(
              "def __init__(self, config: str = 'sim', overrides: dict[str, object] = {}) -> None"),
          "`config` is the name of a configuration that comes with the package, or a file. "
          "`overrides` changes\nsingle values.")
      .def_prop_ro("num_fingers", &Kinematics::num_fingers, "Number of fingers: 1 or 3.")
      .def_prop_ro("num_joints", &Kinematics::num_joints,
                   "Number of joints: three for each finger.")
      .def(
          "tip_positions",
          [](Kinematics& kinematics, nb::handle position) {
            kinematics.update(joints(kinematics, position));
            return RowMajor(
                kinematics.tip_positions().reshaped<Eigen::RowMajor>(kinematics.num_fingers(), 3));
          },
          "position"_a,
          nb::sig("def tip_positions(self, position: numpy.typing.ArrayLike) -> "
                  "numpy.typing.NDArray[numpy.float64]"),
          "Centres of the tip spheres at the joint positions `position` [rad]: a row x, y, z for "
          "each finger [m].")
      .def(
          "tip_jacobian",
          [](Kinematics& kinematics, int finger, nb::handle position) {
            kinematics.update(joints(kinematics, position));
            return RowMajor(kinematics.tip_jacobian(checked_finger(kinematics, finger)));
          },
          "finger"_a, "position"_a,
          nb::sig("def tip_jacobian(self, finger: int, position: numpy.typing.ArrayLike) -> "
                  "numpy.typing.NDArray[numpy.float64]"),
          "Derivative of one tip's position by all joints [m/rad]: 3 rows, `num_joints` columns.")
      .def(
          "tip_jacobians",
          [](Kinematics& kinematics, nb::handle position) {
            kinematics.update(joints(kinematics, position));
            return RowMajor(kinematics.tip_jacobians());
          },
          "position"_a,
          nb::sig("def tip_jacobians(self, position: numpy.typing.ArrayLike) -> "
                  "numpy.typing.NDArray[numpy.float64]"),
          "The Jacobians of all tips, one below the other [m/rad]: square, `num_joints` rows and "
          "columns.")
      .def(
          "tip_accelerations",
          [](Kinematics& kinematics, nb::handle position, nb::handle velocity) {
            kinematics.update(joints(kinematics, position));
            return RowMajor(
                kinematics
                    .tip_accelerations(to_values(velocity, kinematics.num_joints(), "velocity"))
                    .reshaped<Eigen::RowMajor>(kinematics.num_fingers(), 3));
          },
          "position"_a, "velocity"_a,
          nb::sig("def tip_accelerations(self, position: numpy.typing.ArrayLike, velocity: "
                  "numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]"),
          "Accelerations of the tips when joints move with constant `velocity` [rad/s]: a row x, "
          "y, z for each\nfinger [m/s^2].")
      .def(
          "gravity_torques",
          [](Kinematics& kinematics, nb::handle position) {
            kinematics.update(joints(kinematics, position));
            return Values(kinematics.gravity_torques());
          },
          "position"_a,
          nb::sig("def gravity_torques(self, position: numpy.typing.ArrayLike) -> "
                  "numpy.typing.NDArray[numpy.float64]"),
          "Torques that hold the pose against gravity [Nm].")
      .def(
          "bias_torques",
          [](Kinematics& kinematics, nb::handle position, nb::handle velocity) {
            kinematics.update(joints(kinematics, position));
            return Values(
                kinematics.bias_torques(to_values(velocity, kinematics.num_joints(), "velocity")));
          },
          "position"_a, "velocity"_a,
          nb::sig("def bias_torques(self, position: numpy.typing.ArrayLike, velocity: "
                  "numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]"),
          "Torques that keep joints at their `velocity` [rad/s] without acceleration, against "
          "gravity, Coriolis\nand centrifugal forces [Nm]. Friction is not included.")
      .def(
          "mass_matrix",
          [](Kinematics& kinematics, nb::handle position) {
            kinematics.update(joints(kinematics, position));
            return RowMajor(kinematics.mass_matrix());
          },
          "position"_a,
          nb::sig("def mass_matrix(self, position: numpy.typing.ArrayLike) -> "
                  "numpy.typing.NDArray[numpy.float64]"),
          "Inertia at the joints, including that of the rotors [kg m^2].")
      .def(
          "inverse_kinematics",
          [](const Kinematics& kinematics, int finger, nb::handle tip, nb::handle near) {
            checked_finger(kinematics, finger);
            const Eigen::Vector3d point = to_values(tip, 3, "tip");
            const FingerPose pose = near.is_none() ? kinematics.inverse_kinematics(finger, point)
                                                   : kinematics.inverse_kinematics(
                                                         finger, point, to_values(near, 3, "near"));
            const std::string_view reach = name_of(pose.reach);
            return std::pair(pose.position, nb::str(reach.data(), reach.size()));
          },
          "finger"_a, "tip"_a, "near"_a = nb::none(),
          nb::sig("def inverse_kinematics(self, finger: int, tip: numpy.typing.ArrayLike, "
                  "near: numpy.typing.ArrayLike | None = None) -> "
                  "tuple[numpy.typing.NDArray[numpy.float64], str]"),
          "Joint positions of `finger` [rad] that bring its tip to `tip` [m], and whether it can "
          "reach it:\n'yes', 'too_far', 'too_close' or 'outside_limits'. If it cannot, the result "
          "is a pose within the\nhard limits whose tip is near the point. Among several poses the "
          "result is the one nearest to `near`\n[rad]; default: the initial pose.");
}

}  // namespace trifinger::bindings
