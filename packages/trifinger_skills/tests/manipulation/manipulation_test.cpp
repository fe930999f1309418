// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/manipulation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <deque>
#include <functional>
#include <random>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "evaluation/cube_trial.hpp"
#include "manipulation/parts/task.hpp"
#include "manipulation/skills/lift/lift.hpp"
#include "skill_trials.hpp"
#include "trifinger/core/backend.hpp"

namespace trifinger::manipulation {
namespace {

using evaluation::SkillTrial;
using evaluation::varied;

SkillTrial lift(const std::vector<std::string>& settings = {}) {
  return evaluation::make_skill_trial("sim", "lift", {"fingers.height=0.3"}, settings);
}

// A short lift whose plan is made at once.
SkillTrial short_lift() {
  return lift({"lift.height=0.05", "lift.time=0.8", "lift.hold_time=0.5", "lift.lower_time=0.8",
               "lift.lead_turns=[0]", "lift.lead_distances=[1]"});
}

// A run of the skill, and how often it has grasped the object.
struct Run {
  SkillTrace trace;
  double grasps;
};

Run run_on(const Simulation& simulation, const SkillTrial& trial, const SkillRunOptions& options) {
  MeddledSkill skill = skill_of(trial);
  SkillTrace trace = run(simulation, skill, options);
  const auto figures = skill.figures(trace, trace.seen);
  const double grasps = std::ranges::find(figures, "grasps", &Figure::name)->value;
  return {.trace = std::move(trace), .grasps = grasps};
}

double height_of(const Simulation& simulation) {
  return simulation.robot().object_pose("cube").position[2];
}

TEST(Manipulation, LiftsAndPutsBack) {
  const SkillTrial trial = short_lift();
  const Simulation simulation(trial.simulation);
  double highest = 0.0;
  SkillRunOptions options;
  options.on_step = [&](TimeIndex) { highest = std::max(highest, height_of(simulation)); };
  const auto [trace, grasps] = run_on(simulation, trial, options);
  EXPECT_EQ(trace.failure, "");
  EXPECT_EQ(grasps, 1);
  EXPECT_NEAR(highest, 0.0325 + 0.05, 2e-3);
  EXPECT_NEAR(height_of(simulation), 0.0325, 1e-3);
}

// How high a lift brings the cube at each step, on a robot whose joints are like `robot`.
std::vector<double> heights(const Identified& robot, const Identified& known) {
  SkillTrial trial = short_lift();
  trial.simulation.identified = robot;
  const Simulation simulation(trial.simulation);
  std::vector<double> heights;
  SkillRunOptions options;
  options.identified = known;
  options.on_step = [&](TimeIndex) { heights.push_back(height_of(simulation)); };
  run_on(simulation, trial, options);
  return heights;
}

TEST(Manipulation, OnARobotThatIsIdentifiedIsLikeOnOneAsDescribed) {
  Identified robot;
  for (std::size_t i = 0; i < TriFinger::kJoints; ++i) {
    const auto k = static_cast<double>(i);
    robot.torque_scale.push_back(0.85 + 0.03 * k);
    robot.zero_offset.push_back(0.02 * std::cos(k));
  }
  const std::vector<double> as_described = heights({}, {});
  const std::vector<double> identified = heights(robot, robot);
  const std::vector<double> unknown = heights(robot, {});
  const auto differ = [&](const std::vector<double>& one) {
    double most = 0.0;
    for (std::size_t i = 0; i < std::min(one.size(), as_described.size()); ++i)
      most = std::max(most, std::abs(one[i] - as_described[i]));
    return most;
  };
  // Where joints begin is measured, so offsets move the first poses.
  EXPECT_LT(differ(identified), 1e-3);
  EXPECT_GT(differ(unknown), 3e-3);
}

// Returns whether the controller reports a slipping tip at any step of a lift.
bool is_felt_to_slip(double true_friction) {
  SkillTrial trial = short_lift();
  trial.settings.emplace_back("max_grasps=1");
  trial.simulation.description.contact.tip_friction = true_friction;
  const auto [trace, grasps] = run_on(Simulation(trial.simulation), trial, {});
  return std::ranges::any_of(trace.steps,
                             [](const SkillStep& step) { return step.grasp->is_slipping; });
}

// The largest share of the motors' torque while a cube slides in a circle, if cameras whose
// calibration is off see it this much higher [m] and tilted [rad].
double torque_share_of_slide(double height, double tilt) {
  const SkillTrial trial = evaluation::make_skill_trial("sim", "slide", {}, {"max_grasps=1"});
  const Simulation simulation(trial.simulation);
  MeddledSkill skill = skill_of(trial);
  skill.seen_as = [&](const Pose& pose) {
    return Pose{
        .position = pose.position + height * Eigen::Vector3d::UnitZ(),
        .orientation = Eigen::AngleAxisd(tilt, Eigen::Vector3d::UnitX()) * pose.orientation};
  };
  const SkillTrace trace = run(simulation, skill);
  EXPECT_EQ(trace.failure, "");
  double most = 0.0;
  for (const SkillStep& step : trace.steps) most = std::max(most, step.torque_share);
  return most;
}

TEST(Manipulation, DoesNotPressAnObjectAgainstTheTableItSlidesOn) {
  EXPECT_LT(torque_share_of_slide(0.001, 0.01), 1.2 * torque_share_of_slide(0.0, 0.0));
}

TEST(Manipulation, FeelsTheObjectSlip) {
  EXPECT_FALSE(is_felt_to_slip(0.8));
  EXPECT_TRUE(is_felt_to_slip(0.2));
}

TEST(Manipulation, GraspsAgainWhatGotLost) {
  const SkillTrial trial = short_lift();
  const Simulation simulation(trial.simulation);
  bool is_taken = false;
  SkillRunOptions options;
  options.on_phase = [&](const Skill& at) {
    if (at.state().phase != "hold" || is_taken) return;
    is_taken = true;
    simulation.robot().place_object("cube", {.position = {0.01, -0.01, 0.0325}});
  };
  const auto [trace, grasps] = run_on(simulation, trial, options);
  EXPECT_TRUE(is_taken);
  EXPECT_EQ(trace.failure, "");
  EXPECT_EQ(grasps, 2);
}

TEST(Manipulation, GivesUpWhatItLosesAgainAndAgain) {
  SkillTrial trial = short_lift();
  trial.settings.emplace_back("max_grasps=2");
  const Simulation simulation(trial.simulation);
  SkillRunOptions options;
  options.on_phase = [&](const Skill& at) {
    if (at.state().phase == "hold")
      simulation.robot().place_object("cube", {.position = {0.01, -0.01, 0.0325}});
  };
  const auto [trace, grasps] = run_on(simulation, trial, options);
  EXPECT_EQ(trace.failure, "the object got lost");
  EXPECT_EQ(grasps, 2);
}

TEST(Manipulation, SaysThatNothingReachesTheObject) {
  SkillTrial trial = short_lift();
  trial.simulation.description.objects[0].position = {0.0, 0.17, 0.0325};
  const auto [trace, grasps] = run_on(Simulation(trial.simulation), trial, {});
  EXPECT_EQ(trace.failure, "no grasp reaches the whole way from where the object lies");
}

TEST(Manipulation, PutsTheObjectDownWhenItIsStopped) {
  for (const std::string_view phase : {"grasp", "lead", "follow", "hold"}) {
    const SkillTrial trial = short_lift();
    const Simulation simulation(trial.simulation);
    std::atomic<bool> stop{false};
    double speed = 0.0;
    double before = height_of(simulation);
    SkillRunOptions options;
    options.stop = &stop;
    options.on_phase = [&](const Skill& at) { stop = stop || at.state().phase == phase; };
    options.on_step = [&](TimeIndex) {
      const double now = height_of(simulation);
      speed = std::min(speed, now - before);
      before = now;
    };
    const auto [trace, grasps] = run_on(simulation, trial, options);
    EXPECT_EQ(trace.failure, kStopped) << phase;
    EXPECT_NEAR(height_of(simulation), 0.0325, 1e-3);
    EXPECT_GT(speed, -5e-4) << "it fell with more than half a metre per second";
  }
}

// Returns everything that a run has computed, to be compared bit by bit.
std::vector<double> numbers_of(const SkillTrace& trace) {
  std::vector<double> numbers;
  for (const SkillStep& step : trace.steps) {
    numbers.push_back(static_cast<double>(step.step));
    numbers.push_back(step.torque_share);
    for (const Pose* pose : {&step.desired, &step.estimated}) {
      for (const double value : pose->position) numbers.push_back(value);
      for (const double value : pose->orientation.coeffs()) numbers.push_back(value);
    }
    for (const double value : step.grasp->normal_forces) numbers.push_back(value);
  }
  return numbers;
}

// Runs the robot once with threads and a controller that is slow at random, and once inline.
TEST(Manipulation, ComputesTheSameBitForBitHoweverLongItsStepsTake) {
  const SkillTrial trial = varied(short_lift(), 7);
  const SkillTrace inline_trace = run_on(Simulation(trial.simulation), trial, {}).trace;
  ASSERT_EQ(inline_trace.failure, "");

  SimulatedRobot driver(trial.simulation);
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host);
  const BackendThread thread(backend);
  Frontend<TriFinger> robot(host, {.strict = true});
  std::minstd_rand random(1);
  SkillRunOptions options;
  options.on_step = [&](TimeIndex) {
    if (random() % 8 == 0) std::this_thread::yield();
    for (volatile auto work = random() % 20000; work > 0;) work = work - 1;
  };
  MeddledSkill skill = skill_of(trial);
  const SkillTrace trace = run_skill(robot, skill, options);
  EXPECT_EQ(numbers_of(trace), numbers_of(inline_trace));
}

TEST(Manipulation, DoesNotAllocate) {
  const SkillTrial trial = varied(short_lift(), 3);
  const Simulation simulation(trial.simulation);
  auto robot = simulation.connect();
  const Companion<CubeObservation> object(robot.companion("object"));
  const ManipulationConfig config = load_lift(context_of(trial), trial.settings);
  Manipulation manipulation(trial.believed, config);
  TaskPlanner planner(trial.believed, config);
  auto y = robot.latest_observation();
  TimeIndex t = -1;
  std::size_t count = 0;
  while (!manipulation.has_ended()) {
    const auto seen = object.get_latest_at(t);
    const auto& q = seen->cube.orientation;
    const auto plan = manipulation.phase() == Phase::kPlan
                          ? planner.plan(manipulation.resting_pose())
                          : std::nullopt;
    const control::JointState joints{.position = JointValues::Map(y.position.data(), 9),
                                     .velocity = JointValues::Map(y.velocity.data(), 9),
                                     .torque = JointValues::Map(y.torque.data(), 9)};
    const trifinger::test::AllocationCounter allocations;
    manipulation.see(seen->stamp.capture_index,
                     {.position = Eigen::Vector3d::Map(seen->cube.position.data()),
                      .orientation = Eigen::Quaterniond(q[0], q[1], q[2], q[3])});
    if (plan) manipulation.begin(plan);
    if (manipulation.phase() == Phase::kHold) manipulation.stop();
    const JointValues& torques = manipulation.update(t, joints);
    count += allocations.count();
    TriFinger::Action action;
    JointValues::Map(action.torque.data(), 9) = torques;
    t = robot.append_desired_action(action);
    y = robot.get_observation(t);
  }
  EXPECT_EQ(manipulation.failure(), kStopped);
  EXPECT_EQ(count, 0U);
}

// A lift of 20 cm whose poses come only while `is_seen` says so, as from cameras.
struct LiftWithCameras {
  Phase end{};
  double rms{0.0};    // [m] while it is led, from where it should be
  double worst{0.0};  // [m]
  double angle{0.0};  // [rad], the largest
  int blind_steps{0};
};

LiftWithCameras lift_with_cameras(std::uint64_t seed,
                                  const std::function<bool(const ObjectPose& truth)>& is_seen) {
  SkillTrial trial = varied(lift(), seed);
  trial.simulation.object_period = 33;
  trial.simulation.object_delay = 35;
  const Simulation simulation(trial.simulation);
  auto robot = simulation.connect();
  const Companion<CubeObservation> object(robot.companion("object"));
  const ManipulationConfig config = load_lift(context_of(trial), trial.settings);
  Manipulation manipulation(trial.believed, config);
  TaskPlanner planner(trial.believed, config);
  LiftWithCameras result;
  std::deque<ObjectPose> truths;
  double squares = 0.0;
  int count = 0;
  auto y = robot.latest_observation();
  TimeIndex t = -1;
  while (!manipulation.has_ended()) {
    const ObjectPose truth = simulation.robot().object_pose("cube");
    const auto seen = object.get_latest_at(t);
    const auto& q = seen->cube.orientation;
    if (is_seen(seen->cube)) {
      manipulation.see(seen->stamp.capture_index,
                       {.position = Eigen::Vector3d::Map(seen->cube.position.data()),
                        .orientation = Eigen::Quaterniond(q[0], q[1], q[2], q[3])});
    }
    if (manipulation.phase() == Phase::kPlan)
      manipulation.begin(planner.plan(manipulation.resting_pose()));
    const JointValues& torques =
        manipulation.update(t, {.position = JointValues::Map(y.position.data(), 9),
                                .velocity = JointValues::Map(y.velocity.data(), 9),
                                .torque = JointValues::Map(y.torque.data(), 9)});
    const Phase phase = manipulation.phase();
    if (phase == Phase::kFollow || phase == Phase::kHold || phase == Phase::kLower) {
      if (!manipulation.is_visible()) ++result.blind_steps;
      const Pose& desired = manipulation.desired().pose;
      const double distance =
          (Eigen::Vector3d::Map(truth.position.data()) - desired.position).norm();
      const auto& [w, a, b, c] = truth.orientation;
      result.angle = std::max(
          result.angle,
          control::rotation_error(desired.orientation, Eigen::Quaterniond(w, a, b, c)).norm());
      squares += distance * distance;
      ++count;
    }
    TriFinger::Action action;
    JointValues::Map(action.torque.data(), 9) = torques;
    t = robot.append_desired_action(action);
    y = robot.get_observation(t);
  }
  result.end = manipulation.phase();
  result.rms = std::sqrt(squares / std::max(count, 1));
  return result;
}

TEST(Manipulation, GoesOnByWhatTheTipsFeelWhenTheObjectLeavesTheImages) {
  for (const std::uint64_t seed : {2U, 6U, 8U}) {
    const LiftWithCameras found =
        lift_with_cameras(seed, [](const ObjectPose& cube) { return cube.position[2] < 0.15; });
    EXPECT_EQ(found.end, Phase::kDone);
    EXPECT_GT(found.blind_steps, 10000);
    EXPECT_LT(found.rms, 5e-3);
    EXPECT_LT(found.angle, 0.12);
  }
}

TEST(Manipulation, IsNeverBlindWhileTheObjectIsSeen) {
  EXPECT_EQ(lift_with_cameras(2, [](const ObjectPose&) { return true; }).blind_steps, 0);
}

}  // namespace
}  // namespace trifinger::manipulation
