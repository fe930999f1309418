// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <Eigen/Core>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <vector>

#include "sim/robots.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::test {
namespace {

template <class R>
class Physics : public testing::Test {};
using Robots = testing::Types<TriFinger, Finger>;
TYPED_TEST_SUITE(Physics, Robots);

TYPED_TEST(Physics, HasTheActuatorsOfTheDescription) {
  using R = TypeParam;
  SimulationOptions options = options_of<R>();
  options.description.actuator =
      ActuatorParameters{.rotor_inertia = 5e-6, .damping = 2e-3, .friction = 1e-2};
  for (const SimulationOptions& scene : {options_of<R>(), options}) {
    const ActuatorParameters drive = actuator(scene.description);
    const SimulatedRobot robot(scene);
    const mjModel& model = *robot.model().mujoco();
    ASSERT_GE(model.nv, static_cast<int>(R::kJoints));
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      EXPECT_EQ(model.dof_armature[i], drive.rotor_inertia * 81);
      EXPECT_EQ(model.dof_damping[i], drive.damping);
      EXPECT_EQ(model.dof_frictionloss[i], drive.friction);
    }
    EXPECT_EQ(model.opt.timestep, 0.001);
  }
}

// A thrown object follows a parabola and continues to rotate.
TYPED_TEST(Physics, AnObjectFliesAsItWasThrown) {
  using R = TypeParam;
  constexpr double kGravity = 9.81;
  const ObjectVelocity thrown{.linear = {0.4, -0.3, 1.0}, .angular = {1.0, 2.0, -3.0}};
  for (const bool by_description : {true, false}) {
    SimulationOptions options = options_of<R>();
    ObjectDescription& cube = options.description.objects.at(0);
    cube.position = {0.0, 0.0, 1.0};
    cube.orientation = {0.5, 0.1, -0.7, 0.2};
    if (by_description) {
      cube.velocity = thrown.linear;
      cube.angular_velocity = thrown.angular;
    }
    const Simulation simulation(options);
    SimulatedRobot& driver = simulation.robot();
    if (!by_description) driver.set_object_velocity("cube", thrown);
    const auto expect_thrown = [&] {
      const ObjectVelocity velocity = driver.object_velocity("cube");
      for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(velocity.linear[i], thrown.linear[i], 1e-12);
        EXPECT_NEAR(velocity.angular[i], thrown.angular[i], 1e-12);
      }
    };
    // Every session begins with these velocities, and a saved state contains them, too.
    const SimulationState state = driver.save();
    for (int session = 0; session < 2; ++session) {
      Frontend<R> robot = simulation.connect<R>();
      expect_thrown();
      const auto hold = hold_position(robot.latest_observation());
      constexpr int kSteps = 100;
      for (int i = 0; i < kSteps; ++i)
        (void)robot.get_observation(robot.append_desired_action(hold));
      constexpr double kTime = 0.1;
      const ObjectPose pose = driver.object_pose("cube");
      EXPECT_NEAR(pose.position[0], 0.4 * kTime, 1e-9);
      EXPECT_NEAR(pose.position[1], -0.3 * kTime, 1e-9);
      EXPECT_NEAR(pose.position[2], 1.0 + 1.0 * kTime - 0.5 * kGravity * kTime * kTime, 1e-3);
      // A cube has equal inertia about all axes, so its axis of rotation stays constant.
      const ObjectVelocity velocity = driver.object_velocity("cube");
      for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(velocity.angular[i], thrown.angular[i], 1e-6);
      }
    }
    driver.restore(state);
    expect_thrown();
    driver.place_object("cube", {.position = {0.0, 0.0, 1.0}});
    EXPECT_EQ(driver.object_velocity("cube").linear, (std::array<double, 3>{}));
    driver.reset();
    if (by_description) expect_thrown();
  }
}

TYPED_TEST(Physics, RefusesAVelocityThatIsNone) {
  using R = TypeParam;
  SimulatedRobot robot(options_of<R>());
  EXPECT_THROW(robot.set_object_velocity("ball", {}), InvalidArgument);
  EXPECT_THROW(robot.set_object_velocity(
                   "cube", {.angular = {0.0, std::numeric_limits<double>::infinity(), 0.0}}),
               InvalidArgument);
}

TYPED_TEST(Physics, TorqueOfAnObservationBelongsToThePeriodBefore) {
  using R = TypeParam;
  auto robot = simulate<R>(options_of<R>());
  EXPECT_EQ(robot.latest_observation().torque, typename R::Observation{}.torque);
  TimeIndex t = -1;
  for (int k = 0; k < 50; ++k) {
    typename R::Action action;
    for (std::size_t i = 0; i < R::kJoints; ++i)
      action.torque[i] = 0.1 * std::sin(k + static_cast<double>(i));
    t = robot.append_desired_action(action);
    if (t == 0) continue;
    // Slow joints get the torque that was applied.
    EXPECT_EQ(robot.get_observation(t).torque, robot.get_applied_action(t - 1).torque);
  }
}

TYPED_TEST(Physics, AFastJointGetsLessTorqueThanItAsksFor) {
  using R = TypeParam;
  SimulationOptions options = options_of<R>();
  // A weak motor, with nothing else that slows down the joint.
  const ActuatorParameters weak{.damping = 0.0, .no_load_speed = 4.0, .stall_torque = 0.4};
  options.description.actuator = weak;
  options.description.objects.clear();
  options.limits = default_limits(options.description);
  for (JointLimit& limit : *options.limits) {
    limit.safety_kd = 0.0;
    limit.max_velocity = std::numeric_limits<double>::infinity();
    limit.braking = std::numeric_limits<double>::infinity();
  }
  const Simulation simulation(options);
  Frontend<R> robot = simulation.connect<R>();
  typename R::Action action = hold_position(robot.latest_observation());
  action.position[0] = kNotGiven;
  action.torque[0] = 0.3;
  bool is_limited = false;
  typename R::Observation before = robot.latest_observation();
  for (int i = 0; i < 300; ++i) {
    const auto now = robot.get_observation(robot.append_desired_action(action));
    const double available = 0.4 * (1 - before.velocity[0] / 4.0);
    if (i > 0 && before.position[0] < (*options.limits)[0].soft_upper && before.velocity[0] > 0) {
      EXPECT_NEAR(now.torque[0], std::min(0.3, available), 1e-12);
      is_limited |= now.torque[0] < 0.2;
    }
    before = now;
  }
  EXPECT_TRUE(is_limited);
}

// The torques are those of gravity plus, through the Jacobian, those of a force straight down.
TYPED_TEST(Physics, ATipThatPressesOnTheTableFeelsTheForce) {
  using R = TypeParam;
  for (const Variant variant : kVariants) {
    SimulationOptions options = options_of<R>(variant);
    options.description.objects.clear();
    // The single finger of a One would not reach the table.
    options.description.finger_height = 0.29;
    const Simulation simulation(options);
    Frontend<R> robot = simulation.connect<R>();
    Kinematics kinematics(options.description);
    const double radius = figures(options.description).tip_radius;

    // The tip is below its place in the initial pose, on the table.
    JointValues pose =
        Eigen::Map<const Eigen::VectorXd>(simulation.robot().initial_position().data(), R::kJoints);
    kinematics.update(pose);
    for (int finger = 0; finger < kinematics.num_fingers(); ++finger) {
      Eigen::Vector3d tip = kinematics.tip_position(finger);
      tip.z() = radius + 1e-4;
      const FingerPose there = kinematics.inverse_kinematics(finger, tip);
      ASSERT_TRUE(there) << label(options);
      pose.segment<3>(3 * finger) = there.position;
    }
    JointVector<R::kJoints> begin{};
    std::copy(pose.begin(), pose.end(), begin.begin());

    kinematics.update(pose);
    constexpr double kForce = 0.5;
    JointValues torque = kinematics.gravity_torques();
    for (int finger = 0; finger < kinematics.num_fingers(); ++finger) {
      torque += kinematics.tip_jacobian(finger).transpose() * Eigen::Vector3d(0, 0, -kForce);
    }
    // The tip must not slide, so a soft spring keeps the joints.
    typename R::Action action = R::Action::of_position(begin);
    std::copy(torque.begin(), torque.end(), action.torque.begin());
    action.position_kp.fill(0.01);
    action.position_kd.fill(0.05);

    simulation.robot().reset(begin, {});
    const TimeIndex end =
        robot.append_desired_actions(std::vector<typename R::Action>(2000, action));
    for (const double force : robot.get_observation(end).tip_force) {
      EXPECT_NEAR(force, kForce, 0.05 * kForce) << label(options);
    }
  }
}

TYPED_TEST(Physics, ATipInTheAirFeelsNothing) {
  auto robot = simulate<TypeParam>(options_of<TypeParam>());
  const TimeIndex t = robot.append_desired_action(hold_position(robot.latest_observation()));
  for (const double force : robot.get_observation(t).tip_force) EXPECT_EQ(force, 0.0);
}

// --- Memory

std::atomic<int> mujoco_allocations{0};
void* counting_malloc(std::size_t size) {
  // relaxed: only counted
  mujoco_allocations.fetch_add(1, std::memory_order_relaxed);
  constexpr std::size_t kAlignment = 64;
  return std::aligned_alloc(kAlignment, (size + kAlignment - 1) / kAlignment * kAlignment);
}

TYPED_TEST(Physics, TakesNoMemoryInAStep) {
  using R = TypeParam;
  SimulationOptions options = options_of<R>();
  options.object_period = 3;
  options.object_delay = 7;
  options.object_position_noise = 1e-3;
  options.object_orientation_noise = 1e-3;
  SimulatedRobot robot(options);
  typename R::Observation observation;
  typename R::AppliedAction applied;
  typename R::Action action;
  // Stamp, then the pose of one object.
  CubeObservation element;

  mju_user_malloc = counting_malloc;
  mujoco_allocations = 0;
  const AllocationCounter allocations;
  for (int session = 0; session < 2; ++session) {
    (void)robot.prepare(0);
    for (TimeIndex t = -1; t < 500; ++t) {
      (void)robot.get_latest_observation(&observation);
      while (robot.get_companion_element(0, t, &element)) {
      }
      ASSERT_EQ(robot.hold(&observation, &action).state, DriverReport::State::kReady);
      // The fingers fall on the table and on the cube.
      if (t >= 0) action = {};
      (void)robot.apply_action(&action, &applied);
    }
    (void)robot.stop(0);
  }
  EXPECT_EQ(allocations.count(), 0U);
  EXPECT_EQ(mujoco_allocations.load(), 0);
  mju_user_malloc = nullptr;
}

}  // namespace
}  // namespace trifinger::test
