// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/grasp_planner.hpp"

#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include "random_grasps.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/model/robot_model.hpp"

namespace trifinger::control {
namespace {

constexpr double kPi = std::numbers::pi;

Pose on_table(double x, double y, double yaw) {
  return {{x, y, test::kCubeHalfWidth},
          Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()))};
}

std::vector<Motion> upwards(const Pose& from, double height) {
  constexpr int kPoints = 5;
  std::vector<Motion> trajectory(kPoints, {.pose = from});
  for (std::size_t i = 0; i < trajectory.size(); ++i)
    trajectory[i].pose.position.z() += height * static_cast<double>(i) / (kPoints - 1);
  return trajectory;
}

RobotDescription raised() {
  RobotDescription description;
  description.finger_height = 0.300;
  return description;
}

TEST(GraspPlanner, GraspsTheCubeInTheMiddleHoweverItIsTurned) {
  GraspPlanner planner(raised());
  for (int degrees = -180; degrees < 180; degrees += 20) {
    const double yaw = degrees * kPi / 180;
    const auto grasp = planner.plan(upwards(on_table(0, 0, yaw), 0.2));
    ASSERT_TRUE(grasp) << "yaw " << yaw;
    EXPECT_GT(grasp->torque_share, 0.2);
    EXPECT_LT(grasp->torque_share, 0.9);
    for (std::size_t i = 0; i < grasp->touches.size(); ++i) {
      const Touch& touch = grasp->touches[i];
      // The point is on a side face, whose normal points inwards.
      EXPECT_NEAR(touch.point.dot(-touch.normal), test::kCubeHalfWidth, 1e-12);
      EXPECT_LT(touch.point.cwiseAbs().maxCoeff(), test::kCubeHalfWidth + 1e-12);
      EXPECT_EQ(touch.normal.z(), 0.0);
      for (std::size_t k = 0; k < i; ++k)
        EXPECT_LT(touch.normal.dot(grasp->touches[k].normal), 0.5) << "two tips on one face";
    }
  }
}

// The robot looks equal after a third of a turn, and so do its grasps.
TEST(GraspPlanner, TurnsItsGraspsWithTheRobot) {
  GraspPlanner planner(raised());
  for (const auto& [x, y, yaw] : {std::array{0.01, 0.005, 0.3}, std::array{-0.02, 0.01, 1.2},
                                  std::array{0.0, -0.015, -0.7}}) {
    std::optional<double> first;
    for (const double turn : {0.0, 2 * kPi / 3, 4 * kPi / 3}) {
      const auto grasp =
          planner.plan(upwards(on_table(std::cos(turn) * x - std::sin(turn) * y,
                                        std::sin(turn) * x + std::cos(turn) * y, yaw + turn),
                               0.15));
      ASSERT_TRUE(grasp);
      if (!first) first = grasp->torque_share;
      EXPECT_NEAR(grasp->torque_share, *first, 1e-6);
    }
  }
}

TEST(GraspPlanner, TouchesTheCubeWithTipsAndNothingElse) {
  const RobotDescription description = raised();
  GraspPlanner planner(description);
  const RobotModel robot(description);
  const Kinematics kinematics(description);
  const mjModel* model = robot.mujoco();
  const std::unique_ptr<mjData, decltype(&mj_deleteData)> data(mj_makeData(model), &mj_deleteData);
  const double radius = figures(description).tip_radius;
  int grasps = 0;
  for (int degrees = 0; degrees < 360; degrees += 15) {
    const double angle = degrees * kPi / 180;
    // Near the middle some places have no grasp. Those are skipped.
    const auto trajectory =
        upwards(on_table(0.02 * std::cos(angle), 0.02 * std::sin(angle), 2.5 * angle), 0.19);
    const auto grasp = planner.plan(trajectory);
    if (!grasp) continue;
    ++grasps;
    std::array<Eigen::Vector3d, kContacts> near;
    near.fill(Eigen::Vector3d::Map(robot.initial_position().data()));
    for (const Motion& motion : trajectory) {
      mj_resetDataKeyframe(model, data.get(), 0);
      const Eigen::Quaterniond& q = motion.pose.orientation;
      double* const object = data->qpos + robot.object("cube").position;
      Eigen::Map<Eigen::Vector<double, 7>>(object) << motion.pose.position, q.w(), q.x(), q.y(),
          q.z();
      for (int finger = 0; finger < kContacts; ++finger) {
        const auto i = static_cast<std::size_t>(finger);
        const Touch& touch = grasp->touches[i];
        // The tip is slightly off the face, so that the tips do not touch it either.
        const Eigen::Vector3d tip = touch.point - (radius + 1e-4) * touch.normal;
        const FingerPose pose = kinematics.inverse_kinematics(
            finger, motion.pose.position + motion.pose.orientation * tip, near[i]);
        ASSERT_TRUE(pose);
        near[i] = pose.position;
        Eigen::Map<Eigen::Vector3d>(data->qpos + 3 * finger) = pose.position;
      }
      mj_forward(model, data.get());
      for (const mjContact& contact :
           std::span(data->contact, static_cast<std::size_t>(data->ncon))) {
        // The cube may touch the table, and nothing else may touch anything.
        const int first = model->geom_bodyid[contact.geom[0]];
        const int second = model->geom_bodyid[contact.geom[1]];
        const int cube = robot.object("cube").body;
        EXPECT_TRUE((first == cube || second == cube) && std::min(first, second) == 0)
            << "at " << motion.pose.position.z() << " m: " << mj_id2name(model, mjOBJ_BODY, first)
            << " and " << mj_id2name(model, mjOBJ_BODY, second);
      }
    }
  }
  EXPECT_GE(grasps, 12);
}

TEST(GraspPlanner, CarriesMoreWhereItAcceleratesUpwards) {
  GraspPlanner planner(raised());
  std::vector<Motion> trajectory = upwards(on_table(0, 0, 0.2), 0.1);
  const double calm = planner.plan(trajectory).value().torque_share;
  trajectory[1].acceleration.linear.z() = 3.0;
  EXPECT_GT(planner.plan(trajectory).value().torque_share, 1.05 * calm);
}

TEST(GraspPlanner, NeedsLessTorqueWithMoreSidesOfItsPyramids) {
  GraspPlanner four(raised());
  GraspPlanner eight(raised(), "cube", {.friction_sides = 8});
  for (const double yaw : {0.0, 0.3, 0.6, 1.2}) {
    const auto trajectory = upwards(on_table(0, 0, yaw), 0.1);
    EXPECT_LT(eight.plan(trajectory).value().torque_share,
              four.plan(trajectory).value().torque_share);
  }
}

TEST(GraspPlanner, FindsNothingOutOfReach) {
  GraspPlanner planner{RobotDescription()};
  EXPECT_FALSE(planner.plan(upwards(on_table(0, 0, 0), 0.4)));
  EXPECT_FALSE(planner.plan(upwards(on_table(0.18, 0, 0), 0.01)));
  EXPECT_FALSE(planner.plan({}));
}

TEST(GraspPlanner, FindsNothingForWhatIsTooHeavy) {
  RobotDescription description = raised();
  description.objects[0].mass = 2.0;
  GraspPlanner planner(description);
  EXPECT_FALSE(planner.plan(upwards(on_table(0, 0, 0), 0.1)));
}

TEST(GraspPlanner, MeasuresTorquesByTheLimitsThatItIsGiven) {
  const auto trajectory = upwards(on_table(0.01, 0, 0.4), 0.1);
  SafetyLimits limits = safety_limits(raised());
  const auto usual = GraspPlanner(raised(), "cube", {.limits = limits}).plan(trajectory);
  ASSERT_TRUE(usual);
  EXPECT_EQ(usual->torque_share, GraspPlanner(raised()).plan(trajectory).value().torque_share);
  for (double& torque : limits.max_torque) torque /= 4;
  GraspPlanner weak(raised(), "cube", {.largest_torque = 10.0, .limits = limits});
  EXPECT_NEAR(weak.plan(trajectory).value().torque_share, 4 * usual->torque_share, 1e-12);
  EXPECT_FALSE(GraspPlanner(raised(), "cube", {.limits = limits}).plan(trajectory));
}

// Returns the lowest angle of finger 1's last joint on a way.
double lowest_angle(const PlannedGrasp& grasp, std::span<const Motion> trajectory) {
  const Kinematics kinematics(raised());
  const Touch& touch = grasp.touches[1];
  const Eigen::Vector3d tip = touch.point - figures(raised()).tip_radius * touch.normal;
  Eigen::Vector3d near = Eigen::Vector3d::Map(figures(raised()).initial_position.data());
  double lowest = near[2];
  for (const Motion& motion : trajectory) {
    near = kinematics.inverse_kinematics(1, point_of_body(motion, tip).position, near).position;
    lowest = std::min(lowest, near[2]);
  }
  return lowest;
}

TEST(GraspPlanner, StaysWithinTheSoftLimitsThatItIsGiven) {
  const auto trajectory = upwards(on_table(0.01, 0.005, 0.3), 0.15);
  GraspPlannerConfig config{.limit_margin = 0.0, .limits = safety_limits(raised())};
  const auto usual = GraspPlanner(raised(), "cube", config).plan(trajectory);
  ASSERT_TRUE(usual);
  const double lowest = lowest_angle(*usual, trajectory);
  double& limit = config.limits->soft_lower[5];
  limit = lowest - 1e-6;
  EXPECT_EQ(GraspPlanner(raised(), "cube", config).plan(trajectory).value().torque_share,
            usual->torque_share);
  limit = lowest + 1e-6;
  if (const auto other = GraspPlanner(raised(), "cube", config).plan(trajectory)) {
    EXPECT_GT(other->torque_share, usual->torque_share);
    EXPECT_GE(lowest_angle(*other, trajectory), limit);
  }
  limit = 2.9;
  EXPECT_FALSE(GraspPlanner(raised(), "cube", config).plan(trajectory));
}

TEST(GraspPlanner, TouchesABoxOnlyWhereItHasFaces) {
  const RobotDescription robot{.variant = Variant::kPro, .objects = {cuboid()}};
  const Triple& size = robot.objects.front().size;
  // Most of these places are beside the faces of a box that is so small.
  const GraspPlannerConfig config{.offsets = {0.0, 0.009, 0.018, 0.03}, .heights = {0.03, 0.005}};
  GraspPlanner planner(robot, "cuboid", config);
  int num_grasps = 0;
  for (double yaw = 0.0; yaw < 3.0; yaw += 0.25) {
    Pose start = on_table(0.0, 0.0, yaw);
    start.position.z() = size[2] / 2;
    const auto grasp = planner.plan(upwards(start, 0.03));
    if (!grasp) continue;
    ++num_grasps;
    for (const Touch& touch : grasp->touches)
      for (Eigen::Index k = 0; k < 3; ++k)
        EXPECT_LE(std::abs(touch.point[k]), size[static_cast<std::size_t>(k)] / 2 + 1e-9);
  }
  EXPECT_GT(num_grasps, 0);
}

TEST(GraspPlanner, LetsTwoTipsShareALongFaceIfThatIsAllowed) {
  const RobotDescription robot{.variant = Variant::kPro, .objects = {cuboid()}};
  // The short faces are not so long: only the two long ones are left for three tips.
  GraspPlannerConfig config{.offsets = {0.012, 0.024, 0.034}, .heights = {0.002}};
  Pose start = on_table(0.0, 0.0, 0.3);
  start.position.z() = robot.objects.front().size[2] / 2;
  EXPECT_FALSE(GraspPlanner(robot, "cuboid", config).plan(upwards(start, 0.05)));
  config.shared_faces = true;
  const auto grasp = GraspPlanner(robot, "cuboid", config).plan(upwards(start, 0.05));
  ASSERT_TRUE(grasp);
  int shared = 0;
  for (std::size_t i = 0; i < kContacts; ++i) {
    const Touch& one = grasp->touches[i];
    const Touch& other = grasp->touches[(i + 1) % kContacts];
    if (one.normal != other.normal) continue;
    ++shared;
    EXPECT_GE((one.point - other.point).norm(), 2.0 * figures(robot).tip_radius);
  }
  EXPECT_EQ(shared, 1);
}

TEST(GraspPlanner, NeedsThreeFingersAndABox) {
  EXPECT_THROW(GraspPlanner({.arrangement = Arrangement::kSingleFinger}), InvalidArgument);
  EXPECT_THROW(GraspPlanner({.objects = {ball()}}, "ball"), InvalidArgument);
  EXPECT_THROW(GraspPlanner({}, "cup"), InvalidArgument);
}

TEST(GraspPlanner, NeedsSoundFigures) {
  EXPECT_THROW(GraspPlanner({}, "cube", {.friction = 0.0}), InvalidArgument);
  EXPECT_THROW(GraspPlanner({}, "cube", {.clearance = -1e-3}), InvalidArgument);
  SafetyLimits limits = safety_limits({});
  limits.max_torque[3] = 0.0;
  EXPECT_THROW(GraspPlanner({}, "cube", {.limits = limits}), InvalidArgument);
  limits = safety_limits({});
  limits.soft_upper[8] = limits.soft_lower[8];
  EXPECT_THROW(GraspPlanner({}, "cube", {.limits = limits}), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::control
