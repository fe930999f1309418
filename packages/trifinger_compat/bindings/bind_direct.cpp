// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/pair.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <map>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/numbers.hpp"
#include "conversion/numpy.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "direct.hpp"
#include "docstrings.hpp"
#include "simulation/simulation.hpp"
#include "trifinger/base/error.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

// Copies an array or sequence of Python. Arrays of doubles, the usual case, are read in place.
template <std::size_t N>
void read_numbers(nb::handle source, std::array<double, N>& values, const char* what) {
  const nb::object array =
      nb::steal(PyArray_FROM_OTF(source.ptr(), NPY_DOUBLE, NPY_ARRAY_IN_ARRAY));
  if (!array.is_valid()) throw nb::python_error();
  auto* const numbers = reinterpret_cast<PyArrayObject*>(array.ptr());
  require_length(what, static_cast<std::size_t>(PyArray_SIZE(numbers)), N);
  std::copy_n(static_cast<const double*>(PyArray_DATA(numbers)), N, values.begin());
}

template <std::size_t N>
std::array<double, N> to_numbers(nb::handle source, const char* what) {
  std::array<double, N> values{};
  read_numbers(source, values, what);
  return values;
}

template <std::size_t N>
ShownArray to_array(const std::array<double, N>& values) {
  return copy_of(values, {static_cast<npy_intp>(N)});
}

using Arrays = nb::typed<nb::tuple, ShownArray, nb::ellipsis>;

template <class Observation>
Arrays to_tuple(const Observation& observation) {
  return nb::make_tuple(to_array(observation.position), to_array(observation.velocity),
                        to_array(observation.torque), to_array(observation.tip_force));
}

// A DirectSimulation, whatever its number of fingers.
class PythonDirect {
 public:
  explicit PythonDirect(const RobotConfig& config)
      : name_(config.name),
        steps_(description_of(config).arrangement == Arrangement::kTriFinger
                   ? Steps(std::in_place_type<DirectSteps<TriFinger>>, config.simulation)
                   : Steps(std::in_place_type<DirectSteps<Finger>>, config.simulation)) {}

  [[nodiscard]] const std::string& name() const noexcept { return name_; }

  template <class Work>
  auto visit(Work work) {
    return std::visit(work, steps_);
  }
  template <class Work>
  auto visit(Work work) const {
    return std::visit(work, steps_);
  }

 private:
  using Steps = std::variant<DirectSteps<TriFinger>, DirectSteps<Finger>>;

  std::string name_;
  Steps steps_;
};

void desire(PythonDirect& direct, const ShownNumbers& torque, const ShownNumbers& position,
            const ShownNumbers& position_kp, const ShownNumbers& position_kd,
            const ShownNumbers& kp, const ShownNumbers& kd, const ShownNumbers& damping,
            double max_torque) {
  direct.visit([&]<class R>(DirectSteps<R>& steps) {
    typename R::Action action;
    read_numbers(torque, action.torque, "torque");
    read_numbers(position, action.position, "position");
    read_numbers(position_kp, action.position_kp, "position_kp");
    read_numbers(position_kd, action.position_kd, "position_kd");
    DirectControl<R::kJoints> control{.max_torque = max_torque};
    read_numbers(kp, control.kp, "kp");
    read_numbers(kd, control.kd, "kd");
    read_numbers(damping, control.damping, "damping");
    steps.desire(action, control);
  });
}

bool step(PythonDirect& direct) {
  return direct.visit([](auto& steps) { return steps.step(); });
}

Arrays to_tuple(const PythonDirect& direct, bool is_applied) {
  return direct.visit([&](const auto& steps) {
    const auto& action = is_applied ? steps.applied : steps.desired;
    return nb::make_tuple(to_array(action.torque), to_array(action.position),
                          to_array(action.position_kp), to_array(action.position_kd));
  });
}

RowMajor rows_of(const PythonDirect& direct) {
  return direct.visit([](const auto& steps) {
    const auto& rows = steps.rows;
    RowMajor matrix(static_cast<Eigen::Index>(rows.size()),
                    static_cast<Eigen::Index>(std::remove_cvref_t<decltype(steps)>::kRow));
    Eigen::Index i = 0;
    for (const auto& row : rows) {
      matrix.row(i++) = Eigen::Map<const Eigen::RowVectorXd>(row.data(), matrix.cols());
    }
    return matrix;
  });
}

constexpr const char* kActionDocs =
    "torque [Nm], position [rad], position_kp [Nm/rad] and position_kd [Nms/rad]";

}  // namespace

void bind_direct(nb::module_& m) {
  nb::class_<PythonDirect>(m, "DirectSimulation", docs::DirectSimulation::DirectSimulation)
      .def(
          "__init__",
          [](PythonDirect* self, const std::string& config, const Overrides& overrides) {
            new (self) PythonDirect(load_config(config, overrides));
          },
          "config"_a = "sim", "overrides"_a = nb::dict(),
          "`config` is the name of a configuration that comes with the package, or a file. "
          "`overrides` changes\nsingle values.")
      .def("__repr__",
           [](const PythonDirect& direct) {
             return "<DirectSimulation of '" + direct.name() + "'>";
           })
      .def("desire", &desire, "torque"_a, "position"_a, "position_kp"_a, "position_kd"_a, "kp"_a,
           "kd"_a, "damping"_a, "max_torque"_a,
           also("The action for the next step: its torques and those of its positions, clipped to "
                "`max_torque`\n[Nm], damped and clipped again.",
                "A position that is NaN asks for nothing, and a gain that is NaN stands for `kp` "
                "[Nm/rad] or `kd`\n[Nms/rad]. `damping` [Nms/rad] acts always."))
      .def("step", &step,
           "Moves on by one step. False if the simulation has diverged: a number is not finite "
           "any more.")
      .def(
          "act",
          [](PythonDirect& direct, const ShownNumbers& torque, const ShownNumbers& position,
             const ShownNumbers& position_kp, const ShownNumbers& position_kd,
             const ShownNumbers& kp, const ShownNumbers& kd, const ShownNumbers& damping,
             double max_torque) {
            desire(direct, torque, position, position_kp, position_kd, kp, kd, damping, max_torque);
            return step(direct);
          },
          "torque"_a, "position"_a, "position_kp"_a, "position_kd"_a, "kp"_a, "kd"_a, "damping"_a,
          "max_torque"_a, "desire() and step() in one call.")
      .def(
          "observation",
          [](const PythonDirect& direct) {
            return direct.visit(
                [](const auto& steps) { return to_tuple(steps.simulation.observation()); });
          },
          "The measurements now, in new arrays: position [rad], velocity [rad/s], torque [Nm] and "
          "tip_force [N].\nThe last two are those of the last step.")
      .def(
          "observation_before",
          [](const PythonDirect& direct) {
            return direct.visit([](const auto& steps) { return to_tuple(steps.before); });
          },
          "Like observation(), just before the newest step; the torque is that of the step.")
      .def(
          "desired", [](const PythonDirect& direct) { return to_tuple(direct, false); },
          (std::string("What was asked for last: ") + kActionDocs + ".").c_str())
      .def(
          "applied", [](const PythonDirect& direct) { return to_tuple(direct, true); },
          (std::string("What follows from it: ") + kActionDocs + ".").c_str())
      .def(
          "keep_steps",
          [](PythonDirect& direct, bool is_kept) {
            direct.visit([is_kept](auto& steps) { steps.is_kept = is_kept; });
          },
          "keep"_a = true, "Whether the next steps are kept for kept_steps().")
      .def(
          "kept_steps", [](const PythonDirect& direct) { return Array<RowMajor>{rows_of(direct)}; },
          "A row for each step: torque and position that were asked for, then position, velocity, "
          "torque and\ntip_force of the observation before the step.")
      .def(
          "set_joints",
          [](PythonDirect& direct, const ShownNumbers& position, const ShownNumbers& velocity) {
            direct.visit([&]<class R>(DirectSteps<R>& steps) {
              steps.simulation.set_joints(to_numbers<R::kJoints>(position, "position"),
                                          to_numbers<R::kJoints>(velocity, "velocity"));
            });
          },
          "position"_a, "velocity"_a, docs::DirectSimulation::set_joints)
      .def(
          "place_object",
          [](PythonDirect& direct, const std::string& name, const ShownNumbers& position,
             const ShownNumbers& orientation) {
            const ObjectPose pose{.position = to_numbers<3>(position, "position"),
                                  .orientation = to_numbers<4>(orientation, "orientation")};
            direct.visit([&](auto& steps) { steps.simulation.place_object(name, pose); });
          },
          "name"_a, "position"_a, "orientation"_a,
          also(docs::DirectSimulation::place_object,
               "The pose is `position` x, y, z [m] and `orientation`, a quaternion w, x, y, z."))
      .def(
          "continue_from",
          [](PythonDirect& direct, const PythonDirect& other) {
            direct.visit([&]<class R>(DirectSteps<R>& steps) {
              other.visit([&]<class Other>(const DirectSteps<Other>& others) {
                if constexpr (std::is_same_v<R, Other>) {
                  steps.continue_from(others);
                } else {
                  throw InvalidArgument("the other simulation has another number of fingers");
                }
              });
            });
          },
          "other"_a, docs::DirectSimulation::continue_from)
      .def(
          "set_object_velocity",
          [](PythonDirect& direct, const std::string& name, const ShownNumbers& linear,
             const ShownNumbers& angular) {
            const ObjectVelocity velocity{.linear = to_numbers<3>(linear, "linear"),
                                          .angular = to_numbers<3>(angular, "angular")};
            direct.visit(
                [&](auto& steps) { steps.simulation.set_object_velocity(name, velocity); });
          },
          "name"_a, "linear"_a, "angular"_a,
          "Sets an object in motion from where it is: velocity of its centre [m/s] and angular "
          "velocity [rad/s]\nin the world frame.")
      .def(
          "push_object",
          [](PythonDirect& direct, const std::string& name, const ShownNumbers& force,
             const ShownNumbers& moment) {
            direct.visit([&](auto& steps) {
              steps.simulation.push_object(name, to_numbers<3>(force, "force"),
                                           to_numbers<3>(moment, "moment"));
            });
          },
          "name"_a, "force"_a, "moment"_a, docs::DirectSimulation::push_object)
      .def(
          "set_object_mass",
          [](PythonDirect& direct, const std::string& name, double mass) {
            direct.visit([&](auto& steps) { steps.simulation.set_object_mass(name, mass); });
          },
          "name"_a, "mass"_a, docs::DirectSimulation::set_object_mass)
      .def(
          "use_physics",
          [](PythonDirect& direct, const ShownNumbers& stop_lower, const ShownNumbers& stop_upper,
             double margin, double link_friction, double boundary_friction,
             const std::map<std::string, double>& object_margins) {
            direct.visit([&]<class R>(DirectSteps<R>& steps) {
              steps.simulation.use_physics(
                  {.stop_lower = to_numbers<R::kJoints>(stop_lower, "stop_lower"),
                   .stop_upper = to_numbers<R::kJoints>(stop_upper, "stop_upper"),
                   .margin = margin,
                   .link_friction = link_friction,
                   .boundary_friction = boundary_friction});
              for (const auto& [name, object_margin] : object_margins) {
                steps.simulation.set_object_margin(name, object_margin);
              }
            });
          },
          nb::kw_only(), "stop_lower"_a, "stop_upper"_a, "margin"_a, "link_friction"_a,
          "boundary_friction"_a, "object_margins"_a,
          "Takes figures of another simulator: where joints are stopped [rad], the distance at "
          "which fingers and\nobjects touch already, from 0 to 0.01 [m], and the sliding friction "
          "of links and of the boundary\nagainst anything.")
      .def(
          "object_pose",
          [](const PythonDirect& direct, const std::string& name) {
            return direct.visit([&](const auto& steps) {
              const ObjectPose pose = steps.simulation.object_pose(name);
              return std::pair(to_array(pose.position), to_array(pose.orientation));
            });
          },
          "name"_a, "Position [m] and quaternion w, x, y, z of an object now.")
      .def(
          "object_velocity",
          [](const PythonDirect& direct, const std::string& name) {
            return direct.visit([&](const auto& steps) {
              const ObjectVelocity velocity = steps.simulation.object_velocity(name);
              return std::pair(to_array(velocity.linear), to_array(velocity.angular));
            });
          },
          "name"_a,
          "Velocity of an object's centre [m/s] and angular velocity [rad/s], in the world frame.")
      .def(
          "configuration",
          [](const PythonDirect& direct) {
            return direct.visit([](const auto& steps) {
              const auto position = steps.simulation.configuration_position();
              const auto velocity = steps.simulation.configuration_velocity();
              Eigen::VectorXd values(static_cast<Eigen::Index>(position.size() + velocity.size()));
              std::ranges::copy(velocity, std::ranges::copy(position, values.data()).out);
              return Array<Eigen::VectorXd>{std::move(values)};
            });
          },
          docs::DirectSimulation::configuration_position);
}

}  // namespace trifinger::bindings
