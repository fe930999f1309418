// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/planning_model.hpp"

#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <set>
#include <utility>

#include "random_grasps.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::control {
namespace {

using test::Random;
using trifinger::test::AllocationCounter;

TEST(PlanningModel, HasTheStateOfTheRobotsModel) {
  const RobotDescription description{.objects = {cube(), stick()}};
  const RobotModel robot(description);
  const PlanningModel model(description);
  EXPECT_EQ(model.position_size(), robot.mujoco()->nq);
  EXPECT_EQ(model.velocity_size(), robot.mujoco()->nv);
  EXPECT_EQ(model.num_joints(), robot.num_joints());
  const PlanningState state = model.initial_state();
  EXPECT_TRUE(std::ranges::equal(state.position,
                                 std::span(robot.mujoco()->key_qpos, state.position.size())));
  EXPECT_EQ(model.object("stick").position, robot.object("stick").position);
  EXPECT_THROW((void)model.object("ball"), InvalidArgument);
}

TEST(PlanningModel, TurnsWithTheSafetyChecksDamping) {
  SafetyLimits limits = safety_limits({});
  limits.safety_kd.fill(0.5);
  const PlanningModel model({}, {.limits = limits});
  const double own = RobotModel().mujoco()->dof_damping[0];
  for (int i = 0; i < model.num_joints(); ++i)
    EXPECT_DOUBLE_EQ(model.mujoco()->dof_damping[i], 0.5 + own);
}

// Pairs of geoms that touch when everything that moves is at random places close to each other.
std::set<std::pair<int, int>> touching_pairs(const mjModel& model, int num_joints, Random& random) {
  std::set<std::pair<int, int>> pairs;
  const std::unique_ptr<mjData, decltype(&mj_deleteData)> data(mj_makeData(&model), &mj_deleteData);
  for (int i = 0; i < 2000; ++i) {
    for (int joint = 0; joint < num_joints; ++joint)
      data->qpos[joint] =
          random.between(model.jnt_range[2 * joint], model.jnt_range[2 * joint + 1]);
    for (int axis = 0; axis < 3; ++axis)
      data->qpos[num_joints + axis] = random.between(-0.1, 0.1) + (axis == 2 ? 0.1 : 0);
    mj_fwdPosition(&model, data.get());
    for (int k = 0; k < data->ncon; ++k)
      pairs.emplace(data->contact[k].geom[0], data->contact[k].geom[1]);
  }
  return pairs;
}

TEST(PlanningModel, OnlyTipsAndLowerLinksTouch) {
  RobotDescription description{.boundary = false};
  for (const bool has_pairs : {false, true}) {
    // With its own friction, each pair is listed in the model.
    if (has_pairs) description.contact.friction = decltype(description.contact.friction)::all(0.7);
    const RobotModel robot(description);
    for (const bool links : {true, false}) {
      const PlanningModel model(description, {.lower_links = links, .fingers_touch = links});
      Random random(1);
      const auto pairs = touching_pairs(*model.mujoco(), model.num_joints(), random);
      EXPECT_FALSE(pairs.empty());
      const int object_body = model.object("cube").body;
      std::set<int> link_geoms;
      for (const auto& pair : pairs) {
        for (const int geom : {pair.first, pair.second}) {
          const int body = model.mujoco()->geom_bodyid[geom];
          const bool is_tip = std::ranges::count(robot.tip_geoms(), geom) > 0;
          if (is_tip || body == 0 || body == object_body) continue;
          link_geoms.insert(geom);
          const auto of_tip = [&](int tip) { return robot.mujoco()->geom_bodyid[tip] == body; };
          EXPECT_TRUE(std::ranges::any_of(robot.tip_geoms(), of_tip)) << "geom " << geom;
        }
      }
      EXPECT_EQ(link_geoms.size(), links ? 3U : 0U);
    }
  }
}

TEST(PlanningModel, ObjectsAreWhereTheyWerePut) {
  const PlanningModel model({});
  const ObjectAddress& cube = model.object("cube");
  PlanningState state = model.initial_state();
  Random random(2);
  for (int i = 0; i < 20; ++i) {
    const Pose pose = random.pose();
    const Twist twist{random.numbers<3>(1.0), random.numbers<3>(5.0)};
    const AllocationCounter counter;
    PlanningModel::set_object(cube, pose, twist, state);
    EXPECT_EQ(counter.count(), 0);
    const Pose found = PlanningModel::object_pose(cube, state.position);
    EXPECT_EQ(found.position, pose.position);
    EXPECT_LT(rotation_error(found.orientation, pose.orientation).norm(), 1e-12);
    const Twist moves = PlanningModel::object_twist(cube, state.position, state.velocity);
    EXPECT_EQ(moves.linear, twist.linear);
    EXPECT_LT((moves.angular - twist.angular).norm(), 1e-12);
    // MuJoCo moves it as the twist says.
    Pose later = pose;
    const Seconds step{1e-4};
    std::vector<double> position = state.position;
    mj_integratePos(model.mujoco(), position.data(), state.velocity.data(), step.count());
    later.position += step.count() * twist.linear;
    later.orientation =
        rotation_from_vector(Eigen::Vector3d(step.count() * twist.angular)) * pose.orientation;
    const Pose moved = PlanningModel::object_pose(cube, position);
    EXPECT_LT((moved.position - later.position).norm(), 1e-9);
    EXPECT_LT(rotation_error(moved.orientation, later.orientation).norm(), 1e-9);
  }
}

TEST(PlanningModel, RefusesWhatMakesNoSense) {
  EXPECT_THROW(PlanningModel({}, {.time_step = Seconds(0)}), InvalidArgument);
  EXPECT_THROW(PlanningModel({}, {.iterations = 0}), InvalidArgument);
  EXPECT_THROW(PlanningModel({}, {.impratio = -1}), InvalidArgument);
  EXPECT_THROW(PlanningModel({}, {.torque_share = 1.1}), InvalidArgument);
  const PlanningModel model({});
  PlanningState state = model.initial_state();
  EXPECT_NO_THROW(model.check(state));
  state.velocity[3] = std::nan("");
  EXPECT_THROW(model.check(state), InvalidArgument);
  state = model.initial_state();
  state.position.pop_back();
  EXPECT_THROW(model.check(state), InvalidArgument);
  // The tenth joint of the robot's model is that of the cube.
  const std::vector<PlannedJoint> ten(10, {.lower = -1, .upper = 1, .max_torque = 1});
  EXPECT_THROW(PlanningModel(*model.mujoco(), ten), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::control
