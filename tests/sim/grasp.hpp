// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "trifinger/model/kinematics.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::test {

/// Three tips that hold the cube in the air: two on opposite faces, one on a face between them.
/// Each tip is a spring about its starting point, plus a force towards the cube.
class Grasp {
 public:
  static constexpr double kHeight = 0.10;      ///< Height of the cube [m].
  static constexpr double kSqueeze = 1.5;      ///< Force of the two opposite tips [N].
  static constexpr double kAside = 0.4;        ///< Force of the third tip [N].
  static constexpr double kStiffness = 200.0;  ///< Stiffness of a tip [N/m].
  static constexpr double kDamping = 2.0;      ///< [Ns/m]

  /// `fingers` says which finger is on the faces +x, -x and +y of the cube, which is turned by
  /// `yaw` [rad].
  Grasp(const RobotDescription& description, double yaw, const std::array<int, 3>& fingers)
      : kinematics_(description), yaw_(yaw) {
    const double half = description.objects.at(0).size[0] / 2;
    const double radius = figures(description).tip_radius;
    const std::array<Eigen::Vector3d, 3> faces{Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(-1, 0, 0),
                                               Eigen::Vector3d(0, 1, 0)};
    const Eigen::AngleAxisd turn(yaw, Eigen::Vector3d::UnitZ());
    for (std::size_t i = 0; i < 3; ++i) {
      const auto finger = static_cast<std::size_t>(fingers[i]);
      const Eigen::Vector3d normal = turn * faces[i];
      tips_[finger] = Eigen::Vector3d(0, 0, kHeight) + (half + radius) * normal;
      forces_[finger] = -(i < 2 ? kSqueeze : kAside) * normal;
      // This force carries the weight.
      forces_[finger].z() += description.objects[0].mass * 9.81 / 3;
      const FingerPose pose = kinematics_.inverse_kinematics(fingers[i], tips_[finger]);
      can_be_reached_ &= static_cast<bool>(pose);
      for (std::size_t joint = 0; joint < 3; ++joint) {
        begin_[3 * finger + joint] = pose.position[static_cast<Eigen::Index>(joint)];
      }
    }
  }

  [[nodiscard]] bool can_be_reached() const { return can_be_reached_; }

  void put(SimulatedRobot& robot) const {
    robot.reset(begin_, {});
    robot.place_object("cube", {.position = {0, 0, kHeight},
                                .orientation = {std::cos(yaw_ / 2), 0, 0, std::sin(yaw_ / 2)}});
  }

  JointAction<9> action(const TriFinger::Observation& observation) {
    kinematics_.update(joint_values(observation.position));
    const JointValues velocity = joint_values(observation.velocity);
    JointValues torque = kinematics_.gravity_torques();
    for (int finger = 0; finger < 3; ++finger) {
      const auto i = static_cast<std::size_t>(finger);
      const TipJacobian jacobian = kinematics_.tip_jacobian(finger);
      torque += jacobian.transpose() *
                (forces_[i] + kStiffness * (tips_[i] - kinematics_.tip_position(finger)) -
                 kDamping * (jacobian * velocity));
    }
    JointAction<9> action;
    std::ranges::copy(torque, action.torque.begin());
    return action;
  }

  /// Returns where the cube is relative to the middle of the tips [m].
  [[nodiscard]] Eigen::Vector3d cube_relative_to_tips(const SimulatedRobot& robot,
                                                      const TriFinger::Observation& observation) {
    kinematics_.update(joint_values(observation.position));
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (int finger = 0; finger < 3; ++finger) middle += kinematics_.tip_position(finger) / 3;
    const Triple cube = robot.object_pose("cube").position;
    return Eigen::Vector3d(cube.data()) - middle;
  }

 private:
  Kinematics kinematics_;
  double yaw_;
  std::array<Eigen::Vector3d, 3> tips_;
  std::array<Eigen::Vector3d, 3> forces_;
  JointVector<9> begin_{};
  bool can_be_reached_{true};
};

}  // namespace trifinger::test
