// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/repose.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "manipulation/parts/carrier.hpp"
#include "manipulation/parts/fetcher.hpp"
#include "manipulation/parts/object_observer.hpp"
#include "manipulation/skills/makers.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/manipulation/run_skill.hpp"
#include "trifinger/manipulation/skills.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::manipulation {
namespace {

using Eigen::AngleAxisd;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;

SimulationOptions pushing() { return load_robot_config("pushing").simulation; }

SkillContext context() {
  const auto options = pushing();
  return {.description = options.description,
          .limits = safety_limits_of(options),
          .period = options.period};
}

control::JointState at_rest() {
  control::JointState joints;
  joints.position = joint_values(std::array{0.0, 0.9, -1.7, 0.0, 0.9, -1.7, 0.0, 0.9, -1.7});
  joints.velocity = JointValues::Zero(9);
  joints.torque = JointValues::Zero(9);
  return joints;
}

Pose lying(double x, double y, double turn = 0.0) {
  return {{x, y, 0.0325}, Quaterniond(AngleAxisd(turn, Vector3d::UnitZ()))};
}

// Few rollouts: what is tested does not depend on good plans.
std::unique_ptr<Skill> place_at_start(
    const std::string& goal = "{place: [0, 0], face: +z, turn: 0}") {
  return make_skill("place", context(), {}, {"goals=[" + goal + "]", "plan.samples=4"});
}

TEST(LyingOn, TurnsEveryFaceUp) {
  for (const Vector3d& axis : {Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(0, 0, 1)}) {
    for (const double sign : {1.0, -1.0}) {
      const Vector3d face = sign * axis;
      for (const double turn : {0.0, 1.0, -2.5})
        EXPECT_NEAR((lying_on(face, turn) * face).z(), 1.0, 1e-12);
    }
  }
}

TEST(DeviationOfAGoal, IgnoresATurnAboutTheVerticalIfOnlyAnAxisCounts) {
  const Goal goal{.pose = {Vector3d::Zero(), lying_on(Vector3d::UnitX(), 0.0)},
                  .axis = Vector3d::UnitX(),
                  .free_radius = 0.05};
  for (const double turn : {0.3, 1.5, -3.0}) {
    const Pose pose{{0.03, 0.02, 0.0}, lying_on(Vector3d::UnitX(), turn)};
    EXPECT_NEAR(deviation_of(goal, pose).orientation, 0.0, 1e-7);
    EXPECT_EQ(deviation_of(goal, pose).position, 0.0);
  }
  const Pose tilted{{0.08, 0.0, 0.0},
                    AngleAxisd(0.2, Vector3d::UnitX()) * lying_on(Vector3d::UnitX(), 1.0)};
  EXPECT_NEAR(deviation_of(goal, tilted).orientation, 0.2, 1e-9);
  EXPECT_NEAR(deviation_of(goal, tilted).position, 0.03, 1e-12);
}

TEST(ObjectObserver, AveragesTheNoiseOfAnObjectThatNobodyTouches) {
  control::PlanningModel model(context().description, {.limits = context().limits});
  ObjectObserver observer(std::move(model), 0, 0.3);
  const Pose truth = lying(0.02, -0.01, 0.4);
  std::vector<JointSample> history;
  Random random{.seed = 3};
  constexpr double kNoise = 1e-3;
  double sum = 0.0;
  int count = 0;
  for (int step = 0; step < 2000; ++step) {
    history.push_back({Seconds(1e-3 * step), at_rest()});
    if (step % 10 != 0) continue;
    Pose seen = truth;
    for (int i = 0; i < 3; ++i) seen.position[i] += kNoise * random.normal();
    observer.correct(history.back().time, seen, history);
    if (step < 500) continue;
    const Pose estimate = observer.motion_of(observer.now(history)).pose;
    sum += (estimate.position - truth.position).head<2>().squaredNorm() / 2;
    ++count;
  }
  EXPECT_LT(std::sqrt(sum / count), 0.7 * kNoise);
}

TEST(ObjectObserver, FollowsAnObjectThatSomebodyHasTakenElsewhere) {
  control::PlanningModel model(context().description, {.limits = context().limits});
  ObjectObserver observer(std::move(model), 0, 0.3);
  const std::vector<JointSample> history{{Seconds(0), at_rest()}, {Seconds(0.01), at_rest()}};
  observer.correct(Seconds(0), lying(0, 0), history);
  observer.correct(Seconds(0.01), lying(0.1, 0), history);
  EXPECT_NEAR(observer.motion_of(observer.now(history)).pose.position.x(), 0.1, 1e-9);
}

TEST(Fetcher, ReachesBehindACubeOnEverySide) {
  const SkillContext robot = context();
  Fetcher fetcher(robot, robot.description.objects[0], {10, 0.015});
  constexpr int kSides = 24;
  for (const double distance : {0.08, 0.11}) {
    for (int i = 0; i < kSides; ++i) {
      const double azimuth = 2 * kPi * i / kSides;
      EXPECT_TRUE(fetcher.begin(Seconds(0), at_rest(),
                                lying(distance * std::cos(azimuth), distance * std::sin(azimuth)),
                                Vector3d::Zero()))
          << distance << " m, " << azimuth << " rad";
    }
  }
}

// A cube in a simulation, and what the carrier is told of it.
class Carried {
 public:
  explicit Carried(const Pose& start)
      : simulation_(with_cube(start)), robot_(simulation_.connect()) {
    y_ = robot_.latest_observation();
  }

  [[nodiscard]] Pose cube() const {
    const ObjectPose pose = simulation_.robot().object_pose("cube");
    return {Vector3d::Map(pose.position.data()),
            Quaterniond(pose.orientation[0], pose.orientation[1], pose.orientation[2],
                        pose.orientation[3])};
  }
  // Carries out what the carrier has planned. Stops it in this step. Returns the number of steps.
  int carry(Carrier& carrier, int stop = -1) {
    carrier.begin(0);
    int step = 0;
    for (; step < 15000 && !carrier.has_ended(); ++step) {
      const control::JointState joints{.position = joint_values(y_.position),
                                       .velocity = joint_values(y_.velocity),
                                       .torque = joint_values(y_.torque)};
      const Pose pose = cube();
      {
        const test::AllocationCounter allocations;
        carrier.see(step, pose);
        (void)carrier.update(step, joints);
        if (step == stop) carrier.stop();
        allocated_ += allocations.count();
      }
      y_ = robot_.get_observation(robot_.append_desired_action(carrier.action()));
    }
    return step;
  }
  [[nodiscard]] std::size_t allocated() const { return allocated_; }

 private:
  static SimulationOptions with_cube(const Pose& start) {
    auto options = pushing();
    const Quaterniond& q = start.orientation;
    options.description.objects[0].position = {start.position.x(), start.position.y(), 0.0325};
    options.description.objects[0].orientation = {q.w(), q.x(), q.y(), q.z()};
    return options;
  }

  Simulation simulation_;
  Frontend<TriFinger> robot_;
  TriFinger::Observation y_;
  std::size_t allocated_{0};
};

CarrierConfig carrying() {
  return read_carrier(context(), load_skill_file("place", {}).root().section("carry"), "cube");
}

TEST(Carrier, BringsACubeExactlyToItsGoalWithoutAllocating) {
  const Pose start = lying(-0.03, 0.01, 0.2);
  const Pose goal = lying(0.05, -0.03, -0.1);
  Carried world(start);
  Carrier carrier(context(), carrying());
  ASSERT_TRUE(carrier.plan(start, goal));
  world.carry(carrier);
  EXPECT_TRUE(carrier.has_ended());
  EXPECT_LT((world.cube().position - goal.position).norm(), 0.002);
  EXPECT_LT(world.cube().orientation.angularDistance(goal.orientation), 0.02);
  EXPECT_EQ(world.allocated(), 0U);
}

TEST(Carrier, PutsTheCubeDownWhenItIsStopped) {
  const Pose start = lying(0.0, 0.0);
  // On the way up, on the way to the cube, and while it is carried.
  for (const int stop : {10, 900, 2300}) {
    Carried world(start);
    Carrier carrier(context(), carrying());
    ASSERT_TRUE(carrier.plan(start, lying(0.08, 0.0)));
    EXPECT_LT(world.carry(carrier, stop), stop + 2500) << "stopped at " << stop;
    EXPECT_NEAR(world.cube().position.z(), 0.0325, 1e-3) << "stopped at " << stop;
    EXPECT_LT(world.cube().position.x(), 0.07) << "stopped at " << stop;
    EXPECT_EQ(world.cube().position.x() > 0.005, stop == 2300);
  }
}

TEST(Carrier, FindsNoGraspForHalfATurn) {
  Carrier carrier(context(), carrying());
  EXPECT_FALSE(carrier.plan(lying(0, 0), lying(0, 0, 3.0)));
}

TEST(Fetcher, DragsACubeToItsGoal) {
  auto options = pushing();
  options.description.objects[0].position = {0.11, 0.03, 0.0325};
  const Simulation simulation(options);
  auto robot = simulation.connect();
  const SkillContext known = context();
  Fetcher fetcher(known, known.description.objects[0], {10, 0.015});
  auto y = robot.latest_observation();
  const auto cube = [&] {
    const ObjectPose pose = simulation.robot().object_pose("cube");
    return Pose{Vector3d::Map(pose.position.data()),
                Quaterniond(pose.orientation[0], pose.orientation[1], pose.orientation[2],
                            pose.orientation[3])};
  };
  const auto joints = [&] {
    return control::JointState{.position = joint_values(y.position),
                               .velocity = joint_values(y.velocity),
                               .torque = joint_values(y.torque)};
  };
  ASSERT_TRUE(fetcher.begin(Seconds(0), joints(), cube(), Vector3d::Zero()));
  for (int step = 0; step < 10000 && !fetcher.has_ended(); ++step) {
    const auto t =
        robot.append_desired_action(fetcher.update(Seconds(1e-3 * step), joints(), cube()));
    y = robot.get_observation(t);
  }
  EXPECT_TRUE(fetcher.has_ended());
  EXPECT_LT(cube().position.head<2>().norm(), 0.04);
  EXPECT_NEAR(cube().position.z(), 0.0325, 1e-3);
}

TEST(Place, FailsIfNoPoseEverArrives) {
  const auto skill = place_at_start();
  for (TimeIndex step = -1; step < 3000 && !skill->state().has_ended; ++step)
    (void)skill->update(step, at_rest());
  EXPECT_TRUE(skill->state().has_ended);
  EXPECT_EQ(skill->state().failure, "the object was not seen");
}

// Drives a skill whose cube and joints never move. Stops it at `stop` and returns its last step.
TimeIndex drive(Skill& skill, TimeIndex stop, TimeIndex last_pose = 100000) {
  TimeIndex step = -1;
  for (; step < 20000 && !skill.state().has_ended; ++step) {
    if (step % 10 == 0 && step <= last_pose) skill.see(step, lying(0.03, 0.0));
    (void)skill.update(step, at_rest());
    if (step == stop) skill.stop();
    if (skill.wants_plan()) {
      skill.plan();
      skill.begin();
    }
  }
  return step;
}

TEST(Place, EndsSoonAfterAStopInEveryPhase) {
  // Before the first pose, while it looks, as soon as it pushes, and later.
  for (const TimeIndex stop : {TimeIndex{-1}, TimeIndex{100}, TimeIndex{310}, TimeIndex{500}}) {
    const auto skill = place_at_start();
    EXPECT_LT(drive(*skill, stop), stop + 1700) << "stopped at " << stop;
    EXPECT_EQ(skill->state().failure, "it was stopped");
  }
}

TEST(Place, EndsWhenPosesStop) {
  const auto skill = place_at_start();
  EXPECT_LT(drive(*skill, 100000, 600), 5000);
  EXPECT_EQ(skill->state().failure, "the object was not seen");
}

TEST(Place, DoesNotAllocateInItsSteps) {
  const auto skill = place_at_start();
  std::size_t allocated = 0;
  for (TimeIndex step = -1; step < 600; ++step) {
    const auto joints = at_rest();
    {
      const test::AllocationCounter allocations;
      if (step % 10 == 0) skill->see(step, lying(0.03, 0.0));
      (void)skill->update(step, joints);
      allocated += allocations.count();
    }
    if (!skill->wants_plan()) continue;
    skill->plan();
    const test::AllocationCounter allocations;
    skill->begin();
    allocated += allocations.count();
  }
  EXPECT_EQ(allocated, 0U);
}

TEST(Place, IsDoneWithACubeThatLiesWhereItShould) {
  auto options = pushing();
  options.description.objects[0].position = {0.0, 0.0, 0.0325};
  const Simulation simulation(options);
  auto robot = simulation.connect();
  const auto skill =
      make_skill("place", context(), {}, {"goals=[{place: [0, 0], face: +z, turn: 0}]"});
  const SkillTrace trace = run_skill(robot, *skill);
  EXPECT_EQ(trace.failure, "");
  const ObjectPose pose = simulation.robot().object_pose("cube");
  EXPECT_LT(std::hypot(pose.position[0], pose.position[1]), 0.01);
}

}  // namespace
}  // namespace trifinger::manipulation
