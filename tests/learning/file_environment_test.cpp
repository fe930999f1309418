// SPDX-License-Identifier: BSD-3-Clause
// Environments of robots from files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <span>
#include <string>
#include <vector>

#include "model/file_robots.hpp"
#include "support/allocation_counter.hpp"
#include "support/folder.hpp"
#include "support/message_of.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/learning/environment_batch.hpp"
#include "trifinger/learning/file_body.hpp"
#include "trifinger/learning/task.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::learning {
namespace {

using test::message_of;
using ::testing::Each;
using ::testing::HasSubstr;

SimulationOptions robot_of(const std::string& config,
                           const std::vector<std::string>& overrides = {}) {
  return load_robot_config(config, overrides).simulation;
}

// D'Claw, or D'Claw without its valve.
SimulationOptions dclaw(const std::string& config) {
  return robot_of(TRIFINGER_CONFIG_DIR "/" + config + ".yml");
}

class FileEnvironment : public ::testing::Test {
 protected:
  FileEnvironment() {
    test::write(folder_ / "arm.xml", test::kArm);
    test::write(
        folder_ / "arm.yml",
        std::string("name: arm\ndriver: simulation\nrobot: {mjcf: arm.xml}\n") + test::kArmSafety);
    robot_ = robot_of((folder_ / "arm.yml").string());
  }

  [[nodiscard]] static EnvironmentOptions options() {
    EnvironmentOptions options = default_options("reach");
    options.frames = {"lower", "flap"};
    options.duration = 0.2;
    return options;
  }

  test::Folder folder_;
  SimulationOptions robot_;
};

TEST_F(FileEnvironment, HasAGoalForEachFrame) {
  const Environment environment("reach", options(), robot_);
  EXPECT_EQ(environment.num_joints(), 4U);
  EXPECT_EQ(environment.num_fingers(), 2U);
  EXPECT_EQ(environment.num_parts(), 2U);
  EXPECT_EQ(environment.goal_size(), 6U);
  EXPECT_EQ(environment.observation_size(), 4U + 4U + 6U);
  EXPECT_EQ(environment.entries()[0].unit, "rad or m");
  // Actions ask for positions within the soft limits: shoulder, elbow, finger, rail.
  EXPECT_THAT(environment.position_low(), ::testing::ElementsAre(-1.8, -2.2, 0.1, -0.8));
}

TEST_F(FileEnvironment, AsksAJointThatHasOneEndForPositionsOnItsSide) {
  const SimulationOptions robot = robot_of(
      (folder_ / "arm.yml").string(),
      {"safety.rail.soft_lower=-.inf", "safety.rail.hard_lower=-.inf", "safety.rail.soft_upper=-4",
       "safety.rail.hard_upper=-3", "robot.initial_position.rail=-5"});
  const Environment environment("reach", options(), robot);
  EXPECT_EQ(environment.position_low()[3], -6.0);
  EXPECT_EQ(environment.position_high()[3], -4.0);
  const Entry& position = environment.entries()[0];
  EXPECT_EQ(position.low[3], -7.0);
  EXPECT_LT(position.low[3], position.high[3]);
}

TEST_F(FileEnvironment, DrawsGoalsThatAPoseFreeOfContactsReaches) {
  const Environment environment("reach", options(), robot_);
  const FileBody body(robot_, options().frames);
  for (std::uint64_t number = 0; number < 200; ++number) {
    Episode episode;
    Episode again;
    (void)environment.begin(3, number, episode);
    (void)environment.begin(3, number, again);
    EXPECT_EQ(episode.goal, again.goal);
    for (std::size_t i = 0; i < 6; ++i) {
      EXPECT_GE(episode.goal[i], environment.goal().low[i]);
      EXPECT_LE(episode.goal[i], environment.goal().high[i]);
    }
    // The upper arm is 20 cm long and hangs at the rail, which is 80 cm high.
    EXPECT_NEAR(std::hypot(episode.goal[2] - 0.8, 0.0), 0.1, 0.101);
  }
}

TEST_F(FileEnvironment, SeesJointsWithoutMotorsAndFreeBodies) {
  class Look final : public Task {
   public:
    [[nodiscard]] Entry goal() const override {
      return {.name = "goal", .unit = "1", .low = {-9, -9}, .high = {9, 9}};
    }
    void draw_start(const Workspace& workspace, Random& /*random*/,
                    Start& start) const noexcept override {
      start.model_position[5] = 0.25;  // the flap
      EXPECT_EQ(workspace.kinematics, nullptr);
    }
    void draw_goal(const Workspace& /*workspace*/, Random& /*random*/,
                   std::span<double> /*goal*/) const noexcept override {}
    void achieve(const View& view, Episode& /*episode*/,
                 std::span<double> achieved) const noexcept override {
      achieved[0] = view.model_position[5];
      achieved[1] = view.bodies[1].position[0];
    }
    [[nodiscard]] double reward(std::span<const double> /*achieved*/,
                                std::span<const double> /*desired*/) const noexcept override {
      return 3.0;
    }
    [[nodiscard]] double cost(const View& view) const noexcept override { return view.position[1]; }
    [[nodiscard]] bool is_success(std::span<const double> /*achieved*/,
                                  std::span<const double> /*desired*/,
                                  const Episode& /*episode*/) const noexcept override {
      return false;
    }
    [[nodiscard]] std::vector<std::string> scores() const override { return {"speed"}; }
    void score(const View& view, std::span<const double> /*achieved*/,
               std::span<const double> /*desired*/,
               std::span<double> scores) const noexcept override {
      scores[0] = view.velocity[0] + 7.0;
    }
  };
  add_task({.name = "look", .num_fingers = 0, .is_for_files = true, .make = [](Workspace&) {
              return std::make_unique<Look>();
            }});
  EnvironmentBatch batch("look", {}, robot_, 2, 1);
  batch.reset();
  const Results& results = batch.results();
  EXPECT_EQ(results.seen.achieved, (std::vector<double>{0.25, -0.5, 0.25, -0.5}));
  EXPECT_THAT(results.seen.scores, Each(7.0));
  batch.step(std::vector<float>(8, 0.0F));
  EXPECT_THAT(results.reward, Each(::testing::AllOf(::testing::Lt(3.0), ::testing::Gt(1.0))));
  // Where a body is may be known with noise, which each simulation and episode has of its own.
  robot_.object_position_noise = 0.01;
  EnvironmentBatch noisy("look", {}, robot_, 2, 1);
  std::vector<double> seen;
  for (int episode = 0; episode < 2; ++episode) {
    noisy.seed(0, 1, static_cast<std::uint64_t>(episode));
    noisy.seed(1, 2, static_cast<std::uint64_t>(episode));
    noisy.reset();
    for (const std::size_t i : {1U, 3U}) seen.push_back(noisy.results().seen.achieved[i]);
  }
  for (const double place : seen) EXPECT_NEAR(place, -0.5, 0.06);
  std::ranges::sort(seen);
  EXPECT_EQ(std::ranges::adjacent_find(seen), seen.end());
  EXPECT_EQ(message_of<InvalidArgument>(
                [] { return Environment("look", {}, RobotDescription{}).num_joints(); }),
            "the task 'look' is for a robot from a file, such as trifinger_edu");
}

TEST_F(FileEnvironment, GivesTheSameWhateverTheNumberOfThreadsAndSimulations) {
  EnvironmentOptions varied = options();
  varied.position_noise = 1e-3;
  varied.motor_gain = {0.8, 1.1};
  varied.torque_delay = {0, 3};
  varied.friction = {0.5, 1.5};
  varied.object_mass = {0.5, 1.5};
  varied.contact_time = {1.0, 2.0};
  varied.rotor_inertia = {0.8, 1.2};
  varied.joint_damping = {0.5, 2.0};
  varied.joint_friction = {0.0, 0.1};
  constexpr std::size_t kMany = 5;
  EnvironmentBatch many("reach", varied, robot_, kMany, 3);
  std::vector<std::unique_ptr<EnvironmentBatch>> ones;
  for (std::size_t i = 0; i < kMany; ++i) {
    ones.push_back(std::make_unique<EnvironmentBatch>("reach", varied, robot_, 1, 1));
    ones[i]->seed(0, 40 + i);
    many.seed(i, 40 + i);
    (*ones[i]).reset();
  }
  many.reset();
  Random random{.seed = 1};
  const std::size_t width = many.environment().observation_size();
  for (int step = 0; step < 20; ++step) {
    std::vector<float> actions(kMany * 4);
    for (float& number : actions) number = static_cast<float>(random.uniform(-1.0, 1.0));
    many.step(actions, Autoreset::kSameStep);
    for (std::size_t i = 0; i < kMany; ++i) {
      ones[i]->step(std::span(actions).subspan(4 * i, 4), Autoreset::kSameStep);
      const Results& one = ones[i]->results();
      const Results& all = many.results();
      const std::span seen = std::span(all.seen.observation).subspan(i * width, width);
      ASSERT_TRUE(std::ranges::equal(seen, one.seen.observation)) << "step " << step;
      EXPECT_EQ(all.reward[i], one.reward[0]);
      EXPECT_EQ(all.fault[i], 0);
    }
  }
}

TEST_F(FileEnvironment, ObservesAndDrawsWithoutMemoryFromTheHeap) {
  const Environment environment("reach", options(), robot_);
  std::vector<float> observation(environment.observation_size());
  std::vector<double> achieved(environment.goal_size());
  std::vector<double> desired(environment.goal_size());
  const std::vector<double> joints(4, 0.3);
  const std::vector<double> model(6, 0.1);
  const std::vector<ObjectPose> bodies(2);
  Episode episode;
  const test::AllocationCounter allocations;
  (void)environment.begin(1, 2, episode);
  (void)environment.observe({.position = joints,
                             .velocity = joints,
                             .torque = joints,
                             .model_position = model,
                             .model_velocity = model,
                             .bodies = bodies},
                            episode, observation, achieved, desired);
  EXPECT_EQ(allocations.count(), 0);
}

TEST_F(FileEnvironment, AsksTheConfigurationForPosesAsItsOptionsWantThem) {
  EXPECT_EQ(config_overrides(find_task("reach"), options(), true), std::vector<std::string>{});
  EnvironmentOptions wanted = options();
  wanted.object_period = 0.006;
  wanted.object_delay = 0.03;
  wanted.object_position_noise = 0.001;
  wanted.object_orientation_noise = 0.02;
  wanted.object_loss = 0.1;
  const SimulationOptions robot =
      robot_of((folder_ / "arm.yml").string(), config_overrides(find_task("reach"), wanted, true));
  EXPECT_EQ(robot.object_period, 3);
  EXPECT_EQ(robot.object_delay, 15);
  EXPECT_EQ(robot.object_position_noise, 0.001);
  EXPECT_EQ(robot.object_orientation_noise, 0.02);
  EXPECT_EQ(robot.object_loss, 0.1);
  EXPECT_NO_THROW(Environment("reach", wanted, robot));
}

TEST_F(FileEnvironment, RefusesWhatItCannotDo) {
  const auto message = [&](auto change) {
    EnvironmentOptions wanted = options();
    change(wanted);
    return message_of<InvalidArgument>(
        [&] { return Environment("reach", wanted, robot_).num_joints(); });
  };
  EXPECT_THAT(message([](auto& wanted) { wanted.frames = {}; }),
              HasSubstr("reach needs the names of the sites, bodies or geoms"));
  EXPECT_THAT(message([](auto& wanted) { wanted.frames = {"hand"}; }),
              HasSubstr("the model has no frame 'hand'"));
  EXPECT_THAT(message([](auto& wanted) { wanted.frames.assign(33, "flap"); }),
              HasSubstr("there are 33 frames, allowed are 32"));
  EXPECT_THAT(message([](auto& wanted) { wanted.per_finger = true; }),
              HasSubstr("per_finger is for TriFingers"));
  EXPECT_THAT(message_of<InvalidArgument>([&] {
                EnvironmentOptions wanted = options();
                wanted.layout = Layout::kImages;
                return EnvironmentBatch("reach", wanted, robot_, 1).size();
              }),
              HasSubstr("need simulated cameras, which are missing"));
  EXPECT_THAT(message([](auto& wanted) { wanted.stop_margin = {0.5, 1.0}; }),
              HasSubstr("stop_margin is for TriFingers"));
  EXPECT_THAT(message_of<InvalidArgument>([&] {
                return Environment("push", default_options("push"), robot_).num_joints();
              }),
              HasSubstr("the task 'push' is for a TriFinger, this robot is from a file"));
  EXPECT_THAT(message_of<InvalidArgument>(
                  [&] { return Environment("reach", options(), RobotDescription{}).num_joints(); }),
              HasSubstr("frames are for robots from files"));
}

// ---- D'Claw ----

class DClaw : public ::testing::Test {
 protected:
  // One observation of a task, of joints that are measured there.
  struct Seen {
    Outcome outcome;
    std::vector<float> observation;
    std::vector<double> achieved;
    std::vector<double> desired;
  };
  [[nodiscard]] static Seen look(const Environment& environment, Episode& episode,
                                 std::span<const double> joints, double valve, double speed = 0.0,
                                 double torque = 0.0) {
    Seen seen{.outcome = {},
              .observation = std::vector<float>(environment.observation_size()),
              .achieved = std::vector<double>(environment.goal_size()),
              .desired = std::vector<double>(environment.goal_size())};
    const std::vector<double> velocity(9, speed);
    const std::vector<double> torques(9, torque);
    std::vector<double> model(joints.begin(), joints.end());
    model.push_back(valve);
    const std::vector<double> still(10, 0.0);
    seen.outcome = environment.observe({.position = joints,
                                        .velocity = velocity,
                                        .torque = torques,
                                        .model_position = model,
                                        .model_velocity = still},
                                       episode, seen.observation, seen.achieved, seen.desired);
    return seen;
  }

  static constexpr double kThird = std::numbers::pi / 3;
  const std::vector<double> nominal_{0, -kThird, kThird, 0, -kThird, kThird, 0, -kThird, kThird};
};

TEST_F(DClaw, RewardsATurnAsPublished) {
  EnvironmentOptions options = default_options("dclaw_turn_fixed");
  options.layout = Layout::kDictionary;
  const Environment environment("dclaw_turn_fixed", options, dclaw("dclaw"));
  EXPECT_EQ(environment.episode_actions(), 40);
  Episode episode;
  const Start start = environment.begin(1, 1, episode);
  EXPECT_EQ(start.model_position[9], 0.0);
  EXPECT_EQ(episode.goal[0], std::numbers::pi);

  Seen seen = look(environment, episode, nominal_, 0.0);
  EXPECT_DOUBLE_EQ(seen.outcome.reward, -5.0 * std::numbers::pi);
  EXPECT_NEAR(seen.outcome.scores[0], 0.0, 1e-12);
  EXPECT_NEAR(seen.observation[9], 1.0, 1e-6);
  EXPECT_NEAR(seen.observation[20], std::numbers::pi, 1e-6);

  // 0.2 rad beyond the goal, which may be counted from the other side.
  for (const double turns : {0.0, 1.0, -1.0}) {
    seen = look(environment, episode, nominal_, std::numbers::pi * (1.0 + 2.0 * turns) + 0.2);
    EXPECT_NEAR(seen.outcome.reward, -1.0 + 10.0, 1e-9);
    EXPECT_NEAR(seen.observation[20], -0.2, 1e-6);
    EXPECT_NEAR(seen.outcome.distance[0], 0.2, 1e-9);
    EXPECT_FALSE(seen.outcome.success);
  }
  seen = look(environment, episode, nominal_, std::numbers::pi - 0.05);
  EXPECT_NEAR(seen.outcome.reward, -0.25 + 10.0 + 50.0, 1e-9);
  EXPECT_NEAR(seen.outcome.scores[0], 1.0 - 0.05 / std::numbers::pi, 1e-9);
  EXPECT_TRUE(seen.outcome.success);

  // Slow joints cost nothing, fast ones their norm; so does a pose away from the nominal one.
  EXPECT_NEAR(look(environment, episode, nominal_, std::numbers::pi, 0.49).outcome.reward, 60.0,
              1e-9);
  EXPECT_NEAR(look(environment, episode, nominal_, std::numbers::pi, 2.0).outcome.reward,
              60.0 - 6.0, 1e-9);
  std::vector<double> away = nominal_;
  away[0] = 0.3;
  away[4] += 0.4;
  EXPECT_NEAR(look(environment, episode, away, std::numbers::pi).outcome.reward, 60.0 - 0.5, 1e-9);
}

TEST_F(DClaw, CountsWhatIsNotSafe) {
  const Environment environment("dclaw_turn_fixed", default_options("dclaw_turn_fixed"),
                                dclaw("dclaw"));
  EXPECT_THAT(environment.scores(), ::testing::ElementsAre("points", "joints_near_limit",
                                                           "fast_joints", "high_currents"));
  Episode episode;
  (void)environment.begin(1, 1, episode);
  std::vector<double> joints(9, 0.0);
  joints[0] = 0.48 - 0.08;   // 4.6 degrees from the end of its range
  joints[1] = kThird - 0.1;  // 5.7 degrees
  const Outcome outcome = look(environment, episode, joints, 0.0, -1.1, 0.27).outcome;
  EXPECT_EQ(outcome.scores[1], 1.0);
  EXPECT_EQ(outcome.scores[2], 9.0);
  EXPECT_EQ(outcome.scores[3], 9.0);
  const Outcome calm = look(environment, episode, joints, 0.0, 0.9, 0.25).outcome;
  EXPECT_EQ(calm.scores[2], 0.0);
  EXPECT_EQ(calm.scores[3], 0.0);
}

TEST_F(DClaw, TheGoalOfAScrewMoves) {
  const Environment environment("dclaw_screw_fixed", default_options("dclaw_screw_fixed"),
                                dclaw("dclaw"));
  EXPECT_EQ(environment.episode_actions(), 80);
  Episode episode;
  (void)environment.begin(1, 1, episode);
  episode.actions = 20;  // 2 s
  Seen seen = look(environment, episode, nominal_, 0.85);
  EXPECT_NEAR(seen.desired[0], 1.0, 1e-9);
  EXPECT_NEAR(seen.outcome.distance[0], 0.15, 1e-9);
  EXPECT_TRUE(seen.outcome.success);
  EXPECT_FALSE(look(environment, episode, nominal_, 0.79).outcome.success);
  // A whole turn makes no difference.
  seen = look(environment, episode, nominal_, 0.85 - 2 * std::numbers::pi);
  EXPECT_NEAR(seen.outcome.distance[0], 0.15, 1e-9);
}

TEST_F(DClaw, RandomTurnsAndScrewsAreInThePublishedRanges) {
  const SimulationOptions robot = dclaw("dclaw");
  const Environment turn("dclaw_turn_random", default_options("dclaw_turn_random"), robot);
  const Environment screw("dclaw_screw_random", default_options("dclaw_screw_random"), robot);
  double fastest = 0.0;
  for (std::uint64_t number = 0; number < 300; ++number) {
    Episode episode;
    const Start start = turn.begin(0, number, episode);
    EXPECT_LE(std::abs(start.model_position[9]), kThird);
    EXPECT_LE(std::abs(episode.goal[0] - std::numbers::pi), kThird);
    const Start other = screw.begin(0, number, episode);
    EXPECT_LE(std::abs(other.model_position[9]), std::numbers::pi);
    EXPECT_EQ(episode.goal[0], other.model_position[9]);
    episode.actions = 10;  // 1 s
    const Seen seen = look(screw, episode, nominal_, 0.0);
    fastest = std::max(fastest, std::abs(seen.desired[0] - other.model_position[9]));
  }
  EXPECT_LE(fastest, 0.75);
  EXPECT_GT(fastest, 0.7);
}

TEST_F(DClaw, RewardsAPoseAsPublished) {
  EnvironmentOptions options = default_options("dclaw_pose_fixed");
  options.layout = Layout::kDictionary;
  const Environment environment("dclaw_pose_fixed", options, dclaw("dclaw_without_valve"));
  EXPECT_EQ(environment.episode_actions(), 80);
  Episode episode;
  for (std::uint64_t number = 0; number < 50; ++number) {
    const Start start = environment.begin(1, number, episode);
    for (std::size_t i = 0; i < 9; ++i) {
      // Middle joints never go inward, and nothing is beyond the soft limits.
      EXPECT_LE(episode.goal[i], i % 3 == 1 ? 0.0 : 1.571);
      EXPECT_GE(episode.goal[i], i % 3 == 0 ? -0.44 : -1.571);
      EXPECT_NE(episode.goal[i], start.position[i]);
    }
  }
  std::vector<double> joints(episode.goal.begin(), episode.goal.begin() + 9);
  const auto outcome = [&](double speed) {
    const std::vector<double> velocity(9, speed);
    std::vector<float> observation(environment.observation_size());
    std::vector<double> achieved(9);
    std::vector<double> desired(9);
    return environment.observe({.position = joints, .velocity = velocity, .torque = velocity},
                               episode, observation, achieved, desired);
  };
  EXPECT_EQ(outcome(3.0).reward, 0.0);
  EXPECT_NEAR(outcome(4.0).reward, -0.1 * 12.0, 1e-9);
  for (double& joint : joints) joint += 0.1;
  EXPECT_NEAR(outcome(0.0).reward, -0.3, 1e-9);
  EXPECT_NEAR(outcome(0.0).distance[0], 0.1, 1e-9);
  EXPECT_TRUE(outcome(0.0).success);
  EXPECT_NEAR(outcome(0.0).scores[0], 1.0 - 0.1 / (std::numbers::pi / 4), 1e-9);
  for (double& joint : joints) joint += 0.1;
  EXPECT_FALSE(outcome(0.0).success);  // 11.5 degrees
}

TEST_F(DClaw, IsForThisRobotOnly) {
  EXPECT_THAT(message_of<InvalidArgument>([] {
                return Environment("dclaw_turn_fixed", default_options("dclaw_turn_fixed"),
                                   dclaw("dclaw_without_valve"))
                    .num_joints();
              }),
              HasSubstr("the robot has no joint 'valve'"));
  EXPECT_THAT(message_of<InvalidArgument>([] {
                EnvironmentOptions options = default_options("dclaw_turn_fixed");
                options.layout = Layout::kGoal;
                return Environment("dclaw_turn_fixed", options, dclaw("dclaw")).num_joints();
              }),
              HasSubstr("has no part without its goal"));
}

}  // namespace
}  // namespace trifinger::learning
