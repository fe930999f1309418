// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/impedance.hpp"

#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <cmath>

#include "random_grasps.hpp"
#include "trifinger/model/robot_model.hpp"

namespace trifinger::control {
namespace {

using test::Random;

TEST(RigidBody, IsTheOneOfTheSimulation) {
  for (const ObjectDescription& object : {cube(), cuboid(), stick(), ball()}) {
    const RobotModel model({.objects = {object}});
    const mjModel* simulated = model.mujoco();
    const int id = model.object(object.name).body;
    const RigidBody body = rigid_body(object);
    EXPECT_DOUBLE_EQ(body.mass, simulated->body_mass[id]);
    // MuJoCo sorts the principal axes and rotates them.
    const Eigen::Map<const Eigen::Vector3d> principal(simulated->body_inertia + 3 * id);
    const double* q = simulated->body_iquat + 4 * id;
    const Eigen::Matrix3d axes = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
    const Eigen::Matrix3d inertia = axes * principal.asDiagonal() * axes.transpose();
    EXPECT_LT((body.inertia - inertia).norm(), 1e-12 * inertia.norm()) << object.name;
  }
}

TEST(Gravity, IsThatOfTheSimulation) {
  const RobotModel model;
  const Eigen::Map<const Eigen::Vector3d> simulated(model.mujoco()->opt.gravity);
  EXPECT_EQ(gravity(), simulated);
}

TEST(ObjectImpedance, IsWeightAndInertiaOnTheDesiredMotion) {
  Random random(1);
  const RigidBody body = rigid_body({.name = "box", .size = {0.1, 0.2, 0.3}, .mass = 0.5});
  constexpr double kStep = 1e-6;
  for (int i = 0; i < 100; ++i) {
    const Motion motion = random.motion();
    const Wrench wrench = object_impedance(motion, motion.pose, motion.twist, body);
    EXPECT_LT((wrench.force - 0.5 * (motion.acceleration.linear - gravity())).norm(), 1e-12);
    // The moment equals the rate of change of the angular momentum.
    const auto momentum = [&](double time) {
      const Eigen::Vector3d angular = motion.twist.angular + time * motion.acceleration.angular;
      const Eigen::Matrix3d turned =
          (rotation_from_vector(time * motion.twist.angular) * motion.pose.orientation)
              .toRotationMatrix();
      return Eigen::Vector3d(turned * body.inertia * turned.transpose() * angular);
    };
    const Eigen::Vector3d rate = (momentum(kStep) - momentum(-kStep)) / (2 * kStep);
    EXPECT_LT((wrench.moment - rate).norm(), 1e-7);
  }
}

TEST(ObjectImpedance, PullsTowardsTheDesiredMotion) {
  Random random(2);
  const ObjectGains gains{
      .stiffness = 80, .damping = 3, .rotational_stiffness = 0.2, .rotational_damping = 0.01};
  for (int i = 0; i < 100; ++i) {
    Motion desired = random.motion();
    desired.acceleration = {};
    desired.twist.angular.setZero();
    const Eigen::Vector3d off = random.numbers<3>(0.01);
    const Eigen::Vector3d fast = random.numbers<3>(0.1);
    const Eigen::Vector3d turned = random.numbers<3>(0.3);
    const Eigen::Vector3d turning = random.numbers<3>(1.0);
    const Pose pose{desired.pose.position + off,
                    rotation_from_vector(turned) * desired.pose.orientation};
    const Twist twist{desired.twist.linear + fast, turning};
    const Wrench wrench = object_impedance(desired, pose, twist, {}, gains);
    EXPECT_LT((wrench.force + 80 * off + 3 * fast).norm(), 1e-12);
    EXPECT_LT((wrench.moment + 0.2 * turned + 0.01 * turning).norm(), 1e-12);
  }
}

TEST(TipImpedance, IsASpringAndADamper) {
  const PointMotion desired{.position = {0.1, 0, 0}, .velocity = {0, 0.2, 0}};
  const Eigen::Vector3d force =
      tip_impedance(desired, {0, 0, 0.05}, {0, 0, 0.1}, {.stiffness = 100, .damping = 5});
  EXPECT_LT((force - Eigen::Vector3d(10, 1, -5.5)).norm(), 1e-12);
}

}  // namespace
}  // namespace trifinger::control
