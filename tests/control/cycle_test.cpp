// SPDX-License-Identifier: BSD-3-Clause
// Tests the parts together, the way a controller calls them in each step.
#include <gtest/gtest.h>

#include <cmath>

#include "control/filters.hpp"
#include "random_grasps.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/control/force_optimizer.hpp"
#include "trifinger/control/impedance.hpp"
#include "trifinger/control/pose_estimator.hpp"
#include "trifinger/control/trajectories.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::control {
namespace {

struct Cycle {
  explicit Cycle(const RobotDescription& description = {})
      : kinematics(description), body(rigid_body(cube())) {
    const double limit = actuator(description).torque_limit;
    torques.limits.setConstant(limit);
    // The tips are at three side faces of a cube in the middle, 6 cm above the table.
    centre = {0, 0, 0.06};
    position.resize(kinematics.num_joints());
    for (int finger = 0; finger < kContacts; ++finger) {
      const double azimuth = M_PI / 2 * (1 - finger);
      const Eigen::Vector3d out(std::cos(azimuth), std::sin(azimuth), 0);
      contacts[static_cast<std::size_t>(finger)] = {.position = centre + test::kCubeHalfWidth * out,
                                                    .normal = -out};
      const FingerPose pose = kinematics.inverse_kinematics(
          finger, centre + (test::kCubeHalfWidth + figures(description).tip_radius) * out);
      reaches = reaches && pose;
      position.segment<3>(3 * finger) = pose.position;
    }
  }

  // Returns the joint torques that hold the cube on its way at the given time.
  JointValues step(const CircleTrajectory& trajectory, Seconds time, const JointValues& measured) {
    const JointValues& velocity = rate.update(measured, Seconds(1e-3));
    kinematics.update(measured);
    const JointMatrix jacobians = kinematics.tip_jacobians();
    const JointValues bias = kinematics.bias_torques(velocity);

    const PointMotion point = trajectory.at(time);
    const Motion desired{.pose = {.position = point.position},
                         .twist = {.linear = point.velocity},
                         .acceleration = {.linear = point.acceleration}};
    (void)estimator.update(time, desired.pose, desired);
    const Motion found = estimator.predict(time, desired);
    const Wrench wrench = object_impedance(desired, found.pose, found.twist, body);
    torques.jacobians = jacobians;
    torques.bias = bias;
    distribution = optimizer.solve(contacts, found.pose.position, wrench, torques);

    JointValues forces = distribution.forces;
    for (int finger = 0; finger < kContacts; ++finger) {
      const Eigen::Vector3d tip = kinematics.tip_position(finger);
      forces.segment<3>(3 * finger) +=
          tip_impedance({.position = tip}, tip, Eigen::Vector3d::Zero());
    }
    return jacobians.transpose() * forces + bias;
  }

  Kinematics kinematics;
  RigidBody body;
  Eigen::Vector3d centre;
  Grasp contacts;
  JointValues position;
  bool reaches{true};
  TorqueLimits torques;
  Derivative rate{50};
  PoseEstimator estimator;
  ForceOptimizer optimizer;
  ForceDistribution distribution{};
};

CircleTrajectory rest_at(const Eigen::Vector3d& centre) {
  return CircleTrajectory({.centre = centre - Eigen::Vector3d(0.05, 0, 0), .radius = 0.05});
}

TEST(ControlCycle, HoldsTheWeightOfACubeWithinTheTorques) {
  Cycle cycle;
  ASSERT_TRUE(cycle.reaches);
  const JointValues torques = cycle.step(rest_at(cycle.centre), Seconds(0), cycle.position);
  EXPECT_EQ(cycle.distribution.status, ForceStatus::kExact);
  EXPECT_NEAR(cycle.distribution.wrench.force.z(), cycle.body.mass * 9.81, 1e-6);
  EXPECT_LT(cycle.distribution.wrench.force.head<2>().norm(), 1e-6);
  EXPECT_LT(cycle.distribution.wrench.moment.norm(), 1e-6);
  EXPECT_LT(torques.cwiseAbs().maxCoeff(), cycle.torques.limits[0] + 1e-6);
}

TEST(ControlCycle, SpendsAtTheJointsThePowerThatArrivesAtTheTips) {
  test::Random random(1);
  Cycle cycle;
  for (int i = 0; i < 100; ++i) {
    const JointValues position = cycle.position + random.numbers<9>(0.2);
    const JointValues velocity = random.numbers<9>(1.0);
    const JointValues forces = random.numbers<9>(3.0);
    constexpr double kStep = 1e-6;
    cycle.kinematics.update(position + kStep * velocity);
    const JointValues after = cycle.kinematics.tip_positions();
    cycle.kinematics.update(position - kStep * velocity);
    const JointValues before = cycle.kinematics.tip_positions();
    cycle.kinematics.update(position);
    const JointValues torques = cycle.kinematics.tip_jacobians().transpose() * forces;
    EXPECT_NEAR(torques.dot(velocity), forces.dot(after - before) / (2 * kStep), 1e-8);
  }
}

TEST(ControlCycle, DoesNotAllocate) {
  Cycle cycle;
  const CircleTrajectory circle({.centre = cycle.centre});
  const PoseTrajectory turn({}, {.position = cycle.centre}, Seconds(1));
  const LineTrajectory line(cycle.centre, {0, 0, 0}, Seconds(1));
  LowPassFilter filter(10);
  const trifinger::test::AllocationCounter allocations;
  double sum = 0;
  for (int i = 0; i < 1000; ++i) {
    const Seconds time(0.001 * i);
    sum += cycle.step(circle, time, cycle.position).sum();
    sum += point_of_body(turn.at(time), line.at(time).position).position.sum();
    sum += filter.update(cycle.position, Seconds(1e-3)).sum();
  }
  EXPECT_EQ(allocations.count(), 0U);
  EXPECT_TRUE(std::isfinite(sum));
}

}  // namespace
}  // namespace trifinger::control
