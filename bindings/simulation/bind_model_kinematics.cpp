// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/text_of.hpp"
#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "docstrings.hpp"
#include "simulation.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/model_kinematics.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using JointArray = Array<Eigen::VectorXd>;

// The kinematics of the robot of a configuration: the soft limits of its safety checks, and where
// it begins.
class RobotKinematics {
 public:
  RobotKinematics(const RobotConfig& config, const std::vector<std::string>& frames)
      : model_(make_model(config.simulation)), kinematics_(model_, frames) {
    for (const JointLimit& limit :
         config.simulation.limits.value_or(default_limits(config.simulation.description))) {
      ranges_.push_back({.lower = limit.soft_lower, .upper = limit.soft_upper});
    }
    start_ = kinematics_.position();
  }

  [[nodiscard]] std::vector<std::string> joints() const { return model_->joint_names(); }
  [[nodiscard]] const std::vector<std::string>& frames() const { return kinematics_.frames(); }
  [[nodiscard]] const Eigen::VectorXd& start() const noexcept { return start_; }
  [[nodiscard]] const std::vector<JointRange>& ranges() const noexcept { return ranges_; }
  [[nodiscard]] std::size_t frame(const std::string& name) const { return kinematics_.frame(name); }

  // The kinematics with the joints at `position`.
  [[nodiscard]] ModelKinematics& at(const Eigen::VectorXd& position) {
    check("position", position);
    kinematics_.update(position);
    return kinematics_;
  }

  void check(const char* name, const Eigen::VectorXd& values) const {
    trifinger::detail::require(values.size() == start_.size(),
                               trifinger::detail::text_of(name, " has ", values.size(),
                                                          " numbers, must have ", start_.size()));
  }

 private:
  std::shared_ptr<const SceneModel> model_;
  ModelKinematics kinematics_;
  std::vector<JointRange> ranges_;
  Eigen::VectorXd start_;
};

Eigen::Vector4d numbers_of(const Eigen::Quaterniond& turn) {
  const double sign = turn.w() < 0.0 ? -1.0 : 1.0;
  return sign * Eigen::Vector4d(turn.w(), turn.x(), turn.y(), turn.z());
}

}  // namespace

void bind_model_kinematics(nb::module_& m) {
  nb::class_<JointSolution>(m, "JointSolution", docs::JointSolution::JointSolution)
      .def_prop_ro(
          "position", [](const JointSolution& self) { return JointArray{self.position}; },
          docs::JointSolution::position)
      .def_ro("distance", &JointSolution::distance, docs::JointSolution::distance)
      .def_ro("angle", &JointSolution::angle, docs::JointSolution::angle)
      .def_ro("is_reached", &JointSolution::is_reached, docs::JointSolution::is_reached)
      .def("__repr__", [](const JointSolution& self) {
        return trifinger::detail::text_of(
            "JointSolution(is_reached=", self.is_reached ? "True" : "False",
            ", distance=", self.distance, ", angle=", self.angle, ")");
      });
  nb::class_<RobotKinematics>(
      m, "ModelKinematics",
      "Kinematics and dynamics of any robot, from its model: where named frames are, how joints "
      "move them, and\nwhat torques carry it. Contacts are left out.\n\nEverything is in the world "
      "frame: z up. Joints are the driven ones, in the order of actions [rad], [Nm];\na joint that "
      "slides has m and N. Joints that follow one by an equality go with it. All others, and "
      "bodies\nthat float, stay where sessions begin.")
      .def(
          "__init__",
          [](RobotKinematics* self, const std::string& config,
             const std::vector<std::string>& frames, const Overrides& overrides) {
            new (self) RobotKinematics(load_config(config, overrides), frames);
          },
          "config"_a = "sim", "frames"_a = nb::tuple(), "overrides"_a = nb::dict(),
          "`config` is the name of a configuration that comes with the package, or a file. "
          "`frames` are names of\nsites, bodies or geoms; none: the tips of a TriFinger, or the "
          "ends of a robot from a file. `overrides`\nchanges single values of the configuration.")
      .def_prop_ro("joint_names", &RobotKinematics::joints, "Names of the driven joints.")
      .def_prop_ro("frames", &RobotKinematics::frames, "Names of the frames.")
      .def_prop_ro(
          "ranges",
          [](const RobotKinematics& self) {
            RowMajor ranges(std::ssize(self.ranges()), 2);
            for (Eigen::Index i = 0; i < ranges.rows(); ++i) {
              const JointRange& range = self.ranges()[static_cast<std::size_t>(i)];
              ranges.row(i) << range.lower, range.upper;
            }
            return Array{std::move(ranges)};
          },
          "The soft limits of the joints, N x 2 [rad], [m].")
      .def_prop_ro(
          "initial_position", [](const RobotKinematics& self) { return JointArray{self.start()}; },
          "Where the joints are when a session begins [rad], [m].")
      .def(
          "pose",
          [](RobotKinematics& self, const std::string& frame, const JointArray& position) {
            const Eigen::Isometry3d pose = self.at(position).pose(self.frame(frame));
            return std::pair(Vector3{pose.translation()},
                             Array<Eigen::Vector4d>{numbers_of(Eigen::Quaterniond(pose.linear()))});
          },
          "frame"_a, "position"_a,
          "Place of a frame [m], and its orientation: a quaternion w x y z with w >= 0.")
      .def(
          "jacobian",
          [](RobotKinematics& self, const std::string& frame, const JointArray& position) {
            return Array{RowMajor(self.at(position).jacobian(self.frame(frame)))};
          },
          "frame"_a, "position"_a, docs::ModelKinematics::jacobian)
      .def(
          "gravity_torques",
          [](RobotKinematics& self, const JointArray& position) {
            return JointArray{self.at(position).gravity_torques()};
          },
          "position"_a, docs::ModelKinematics::gravity_torques)
      .def(
          "bias_torques",
          [](RobotKinematics& self, const JointArray& position, const JointArray& velocity) {
            self.check("velocity", velocity);
            return JointArray{self.at(position).bias_torques(velocity.value)};
          },
          "position"_a, "velocity"_a, docs::ModelKinematics::bias_torques)
      .def(
          "mass_matrix",
          [](RobotKinematics& self, const JointArray& position) {
            return Array{RowMajor(self.at(position).mass_matrix())};
          },
          "position"_a, docs::ModelKinematics::mass_matrix)
      .def(
          "null_space_torques",
          [](RobotKinematics& self, const std::string& frame, const JointArray& position,
             const JointArray& torques) {
            self.check("torques", torques);
            const std::size_t place = self.frame(frame);
            return JointArray{self.at(position).null_space_torques(place, torques.value)};
          },
          "frame"_a, "position"_a, "torques"_a, docs::ModelKinematics::null_space_torques)
      .def(
          "inverse_kinematics",
          [](RobotKinematics& self, const std::string& frame, const Vector3& point,
             const std::optional<Array<Eigen::Vector4d>>& orientation,
             const std::optional<JointArray>& near) {
            std::optional<Eigen::Quaterniond> turn;
            if (orientation) {
              const Eigen::Vector4d& numbers = orientation->value;
              trifinger::detail::require(numbers.norm() > 1e-6,
                                         "orientation is not a quaternion: it is zero");
              turn.emplace(numbers[0], numbers[1], numbers[2], numbers[3]);
            }
            const Eigen::VectorXd& begin = near ? near->value : self.start();
            self.check("near", begin);
            return self.at(self.start())
                .inverse_kinematics(self.frame(frame), point, turn, begin, self.ranges());
          },
          "frame"_a, "point"_a, "orientation"_a = nb::none(), "near"_a = nb::none(),
          "Finds positions within the soft limits that bring a frame to `point` [m], with this "
          "orientation (a\nquaternion w x y z) if one is given: damped least squares from `near` "
          "(default: where sessions begin),\nthen from poses drawn from a fixed series. Joints "
          "that "
          "do not move the frame stay as in `near`. If\nnothing reaches it, the nearest pose that "
          "was found. It takes some milliseconds.");
}

}  // namespace trifinger::bindings
