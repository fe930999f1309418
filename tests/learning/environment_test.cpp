// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/learning/environment.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "support/allocation_counter.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/learning/task.hpp"

namespace trifinger::learning {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

// Returns the robot that a task is for.
RobotDescription description_for(std::string_view task) {
  RobotDescription description;
  if (task == "finger_reach") description.arrangement = Arrangement::kSingleFinger;
  if (task == "throw") description.objects = {ball()};
  return description;
}

std::vector<double> numbers(const Start& start) {
  std::vector<double> all(start.position.begin(), start.position.end());
  all.insert(all.end(), start.object.position.begin(), start.object.position.end());
  all.insert(all.end(), start.object.orientation.begin(), start.object.orientation.end());
  all.push_back(start.variation.friction);
  return all;
}

EnvironmentOptions varied(std::string_view task) {
  EnvironmentOptions options = default_options(task);
  options.object_mass = {0.5, 2.0};
  options.friction = {0.7, 1.2};
  options.motor_gain = {0.9, 1.1};
  options.torque_delay = {2, 5};
  options.pair_friction = {{SurfacePair::kTipObject, Range<double>{0.5, 0.9}}};
  options.contact_time = {1.0, 4.0};
  options.rotor_inertia = {0.5, 1.5};
  options.joint_damping = {0.5, 5.0};
  options.joint_friction = {0.001, 0.01};
  options.stop_margin = {0.5, 1.5};
  options.object_speed = {0.1, 0.2};
  return options;
}

class EveryTask : public ::testing::TestWithParam<std::string> {
 protected:
  [[nodiscard]] Environment make(const EnvironmentOptions& options) const {
    return {GetParam(), options, description_for(GetParam())};
  }
};

TEST_P(EveryTask, FindsTheNumbersOfAnAction) {
  for (const ActionKind kind : {ActionKind::kPosition, ActionKind::kPositionChange,
                                ActionKind::kRelativePosition, ActionKind::kTorque}) {
    EnvironmentOptions options = default_options(GetParam());
    options.action = kind;
    const Environment environment = make(options);
    Random random{.seed = 5};
    Episode episode;
    (void)environment.begin(1, 2, episode);
    const std::size_t joints = environment.num_joints();
    for (int count = 0; count < 100; ++count) {
      std::vector<float> numbers(joints);
      for (float& number : numbers) number = static_cast<float>(random.uniform(-1.2, 1.2));
      Episode next = episode;
      std::vector<double> torque(joints);
      std::vector<double> position(joints);
      ASSERT_TRUE(environment.take_action(numbers, next, torque, position));
      std::vector<float> found(joints);
      environment.invert_action(torque, position, episode, found);
      std::vector<double> torque_again(joints);
      std::vector<double> position_again(joints);
      ASSERT_TRUE(environment.take_action(found, episode, torque_again, position_again));
      for (std::size_t i = 0; i < joints; ++i) {
        EXPECT_NEAR(torque_again[i], torque[i], 1e-6);
        if (kind != ActionKind::kTorque) {
          EXPECT_NEAR(position_again[i], position[i], 1e-6);
        }
        if (kind == ActionKind::kPosition || kind == ActionKind::kTorque) {
          EXPECT_NEAR(found[i], std::clamp(numbers[i], -1.0F, 1.0F), 1e-5);
        }
      }
    }
  }
}

TEST_P(EveryTask, BeginsAnEpisodeAsItsSeedAndNumberSay) {
  const Environment environment = make(varied(GetParam()));
  for (std::uint64_t episode = 0; episode < 20; ++episode) {
    Episode first;
    Episode second;
    Episode other;
    const auto one = numbers(environment.begin(3, episode, first));
    (void)environment.begin(4, 99, second);
    EXPECT_EQ(numbers(environment.begin(3, episode, second)), one);
    EXPECT_EQ(first.goal, second.goal);
    EXPECT_NE(numbers(environment.begin(3, episode + 1, other)), one);
    EXPECT_NE(other.goal, first.goal);
  }
}

// Options that were added later must not change the numbers that older episodes draw.
TEST_P(EveryTask, DrawsNothingForAnOptionThatLeavesNoChoice) {
  EnvironmentOptions fixed = default_options(GetParam());
  fixed.pair_friction = {{SurfacePair::kObjectTable, Range<double>{0.5, 0.5}}};
  fixed.contact_time = {2.0, 2.0};
  fixed.joint_friction = {0.01, 0.01};
  Episode usual;
  Episode other;
  (void)make(default_options(GetParam())).begin(3, 7, usual);
  const Start start = make(fixed).begin(3, 7, other);
  EXPECT_EQ(usual.goal, other.goal);
  EXPECT_EQ(usual.random.uniform(0.0, 1.0), other.random.uniform(0.0, 1.0));
  EXPECT_EQ(start.variation.pair_friction[SurfacePair::kObjectTable], 0.5);
  EXPECT_EQ(start.variation.contact_time, 2.0);
  EXPECT_EQ(start.variation.joint_friction, 0.01);
}

TEST_P(EveryTask, DrawsWithinItsBounds) {
  const EnvironmentOptions options = varied(GetParam());
  const Environment environment = make(options);
  for (std::uint64_t number = 0; number < 300; ++number) {
    Episode episode;
    const Start start = environment.begin(0, number, episode);
    for (std::size_t i = 0; i < environment.goal_size(); ++i) {
      EXPECT_GE(episode.goal[i], environment.goal().low[i]);
      EXPECT_LE(episode.goal[i], environment.goal().high[i]);
    }
    for (std::size_t i = 0; i < environment.num_joints(); ++i) {
      EXPECT_GE(start.position[i], environment.position_low()[i]);
      EXPECT_LE(start.position[i], environment.position_high()[i]);
    }
    EXPECT_NO_THROW(start.variation.validate());
    EXPECT_GE(start.variation.torque_delay, 2);
    EXPECT_LE(start.variation.torque_delay, 5);
    EXPECT_GE(start.variation.object_mass, 0.5);
    EXPECT_LT(start.variation.object_mass, 2.0);
    EXPECT_GE(start.variation.pair_friction[SurfacePair::kTipObject], 0.5);
    EXPECT_LT(start.variation.pair_friction[SurfacePair::kTipObject], 0.9);
    EXPECT_EQ(start.variation.pair_friction[SurfacePair::kObjectTable], 1.0);
    EXPECT_GE(start.variation.joint_friction, 0.001);
    EXPECT_LT(start.variation.joint_friction, 0.01);
    const auto [x, y, z] = start.object_velocity.linear;
    EXPECT_GE(std::hypot(x, y), 0.1);
    EXPECT_LT(std::hypot(x, y), 0.2);
    EXPECT_EQ(z, 0.0);
  }
}

TEST_P(EveryTask, DrawsARobotInItsConditionExceptForWhatIsGiven) {
  EnvironmentOptions options = default_options(GetParam());
  options.condition = Condition::kWorn;
  options.backlash = {0.001, 0.001};
  options.joint_friction = {0.03, 0.04};
  const Environment environment = make(options);
  std::set<std::uint64_t> seeds;
  for (std::uint64_t number = 0; number < 50; ++number) {
    Episode episode;
    const Variation robot = environment.begin(0, number, episode).variation;
    EXPECT_NO_THROW(robot.validate());
    seeds.insert(robot.seed);
    EXPECT_EQ(robot.backlash, 0.001);
    EXPECT_GE(robot.joint_friction, 0.03);
    EXPECT_EQ(robot.measurement_delay, 2);
    EXPECT_EQ(robot.homing_error, 0.01);
    EXPECT_LT(robot.pair_friction[SurfacePair::kTipObject], 1.0);
  }
  EXPECT_EQ(seeds.size(), 50);
}

TEST_P(EveryTask, DrawsOtherErrorsOfJointsInEachEpisode) {
  EnvironmentOptions options = default_options(GetParam());
  options.homing_error = {0.002, 0.002};
  const Environment environment = make(options);
  std::set<std::uint64_t> seeds;
  for (std::uint64_t number = 0; number < 50; ++number) {
    Episode episode;
    seeds.insert(environment.begin(0, number, episode).variation.seed);
  }
  EXPECT_EQ(seeds.size(), 50);
}

TEST_P(EveryTask, ObservesAndActsWithoutMemoryAndWithinMinusOneAndOne) {
  EnvironmentOptions options = varied(GetParam());
  options.position_noise = 1.0;  // far beyond all bounds
  options.velocity_noise = 10.0;
  options.mapping = Mapping::kStateAugmentation;
  const Environment environment = make(options);
  const std::size_t joints = environment.num_joints();
  std::vector<float> observation(environment.observation_size());
  std::vector<double> achieved(environment.goal_size());
  std::vector<double> desired(environment.goal_size());
  std::vector<double> torque(joints);
  std::vector<double> position(joints);
  const std::vector<float> action(joints, 0.5F);
  Episode episode;
  const trifinger::test::AllocationCounter allocations;
  const Start start = environment.begin(1, 2, episode);
  const std::array<double, kMaxJoints> velocity{};
  const bool has_object = !environment.object_name().empty();
  for (int i = 0; i < 50; ++i) {
    ASSERT_TRUE(environment.take_action(action, episode, torque, position));
    (void)environment.observe({.position = std::span(start.position).first(joints),
                               .velocity = std::span(velocity).first(joints),
                               .object = has_object ? &start.object : nullptr},
                              episode, observation, achieved, desired);
    for (const float number : observation) {
      ASSERT_GE(number, -1.0F);
      ASSERT_LE(number, 1.0F);
    }
  }
  EXPECT_EQ(allocations.count(), 0);
}

// One robot that is measured wherever a test says.
class Played {
 public:
  Played(const Environment& environment, std::uint64_t number)
      : environment_(environment),
        velocity_(environment.num_joints()),
        has_object_(!environment.object_name().empty()),
        observation(environment.observation_size()),
        torque(environment.num_joints()),
        position(environment.num_joints()) {
    object_ = environment.begin(1, number, episode).object;
  }

  // Acts, and is then measured at `measured`, with its object at `place`.
  void play(std::span<const float> action, std::span<const double> measured,
            const std::array<double, 3>& place) {
    object_.position = place;
    ASSERT_TRUE(environment_.take_action(action, episode, torque, position));
    std::vector<double> achieved(environment_.goal_size());
    std::vector<double> desired(environment_.goal_size());
    outcome = environment_.observe(
        {.position = measured, .velocity = velocity_, .object = has_object_ ? &object_ : nullptr},
        episode, observation, achieved, desired);
  }

 private:
  const Environment& environment_;
  std::vector<double> velocity_;
  bool has_object_;
  ObjectPose object_;

 public:
  Episode episode;
  std::vector<float> observation;
  std::vector<double> torque;
  std::vector<double> position;
  Outcome outcome;
};

// Two robots with other histories, but observed alike, do the same from then on: the decision
// process is Markov (Sutton, Barto 2018, section 3.1). Only the end of the time is not observed.
TEST_P(EveryTask, HidesNothingOfItsHistory) {
  Random random{.seed = 9};
  std::size_t alike = 0;
  const auto compare = [&](const Environment& environment, std::uint64_t trial) {
    const std::size_t joints = environment.num_joints();
    const auto low = environment.position_low();
    const auto high = environment.position_high();
    Played one(environment, trial);
    Played other(environment, trial);
    std::vector<float> action(joints);
    std::vector<double> measured(joints);
    std::array<double, 3> place{};
    double highest = 0.06;
    const auto draw = [&] {
      place = {random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1),
               random.uniform(0.045, highest)};
      for (float& number : action) number = static_cast<float>(random.uniform(-1.0, 1.0));
      for (std::size_t i = 0; i < joints; ++i) measured[i] = random.uniform(low[i], high[i]);
    };
    const auto play = [&](Played& played, std::int64_t count) {
      // In some histories the object has been in the air.
      highest = random.integer(0, 2) == 0 ? 0.06 : 0.2;
      for (; count > 0; --count) {
        draw();
        played.play(action, measured, place);
      }
    };
    const std::int64_t most = environment.episode_actions() - 2;
    const std::int64_t count = random.integer(1, std::min<std::int64_t>(298, most));
    play(one, count);
    // The next goal of a trajectory comes after 300 actions.
    play(other, trial % 2 == 0 ? count : std::min<std::int64_t>(298, most));
    highest = 0.06;
    // Now both do the same, twice: first where no desired position is near, then with the object
    // down.
    for (const bool is_compared : {false, true}) {
      draw();
      if (!is_compared) measured.assign(low.begin(), low.end());
      if (is_compared) place[2] = 0.01;
      one.play(action, measured, place);
      other.play(action, measured, place);
      if (is_compared) {
        EXPECT_EQ(one.torque, other.torque);
        EXPECT_THAT(one.position,
                    ::testing::Pointwise(::testing::NanSensitiveDoubleEq(), other.position));
        EXPECT_EQ(one.outcome.reward, other.outcome.reward);
        EXPECT_EQ(one.outcome.success, other.outcome.success);
        EXPECT_EQ(one.outcome.terminated, other.outcome.terminated);
      }
      if (one.observation != other.observation) {
        EXPECT_FALSE(is_compared);
        return;
      }
    }
    ++alike;
  };
  for (const ActionKind kind : {ActionKind::kPosition, ActionKind::kPositionChange,
                                ActionKind::kRelativePosition, ActionKind::kTorque}) {
    for (const Mapping mapping : {Mapping::kApproximation, Mapping::kStateAugmentation}) {
      for (const Layout layout : {Layout::kFlat, Layout::kDictionary}) {
        EnvironmentOptions options = default_options(GetParam());
        options.action = kind;
        options.mapping = mapping;
        options.layout = layout;
        options.steps_per_action = 100;
        const std::size_t before = alike;
        const Environment environment = make(options);
        for (std::uint64_t trial = 0; trial < 10; ++trial) compare(environment, trial);
        EXPECT_GT(alike, before) << write_options(options);
      }
    }
  }
}

TEST_P(EveryTask, NamesEveryNumberOnce) {
  const Environment environment = make(default_options(GetParam()));
  std::vector<std::string> names = environment.flat_names();
  EXPECT_EQ(names.size(), environment.observation_size());
  std::ranges::sort(names);
  EXPECT_EQ(std::ranges::adjacent_find(names), names.end());
}

// Names of the tasks of TriFingers.
std::vector<std::string> tasks_of_fingers() {
  std::vector<std::string> names = task_names();
  std::erase_if(names, [](const std::string& name) { return find_task(name).num_fingers == 0; });
  return names;
}

INSTANTIATE_TEST_SUITE_P(Learning, EveryTask, ::testing::ValuesIn(tasks_of_fingers()),
                         [](const auto& task) { return std::string(task.param); });

// A scene that is turned about the middle by a third of a circle: each joint is where that of the
// finger before was.
struct Scene {
  std::array<double, 9> joints{};
  ObjectPose object{};
  std::vector<double> goal{};

  [[nodiscard]] Scene turned(double angle) const {
    Scene scene = *this;
    std::ranges::rotate_copy(joints, joints.end() - 3, scene.joints.begin());
    const Eigen::AngleAxisd turn(angle, Eigen::Vector3d::UnitZ());
    const auto place = [&turn](double* xyz) {
      Eigen::Map<Eigen::Vector3d>(xyz, 3) = turn * Eigen::Vector3d(xyz);
    };
    const auto rotate = [&turn](double* wxyz) {
      Eigen::Quaterniond all = turn * Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
      if (all.w() < 0.0) all.coeffs() *= -1.0;  // Goals are drawn so.
      std::ranges::copy(std::array{all.w(), all.x(), all.y(), all.z()}, wxyz);
    };
    place(scene.object.position.data());
    rotate(scene.object.orientation.data());
    place(scene.goal.data());
    if (goal.size() == 7) rotate(&scene.goal[3]);
    return scene;
  }
};

class WithSymmetry : public ::testing::TestWithParam<std::string> {};

TEST_P(WithSymmetry, SeesAndDoesInATurnedSceneWhatItSeesAndDoesInTheOther) {
  for (const int shown : {0, 1, 2}) {
    EnvironmentOptions options = default_options(GetParam());
    options.symmetric_view = options.object_offsets = true;
    options.keypoints = shown == 1;
    options.symmetric_object = shown == 2 && GetParam() != "lift_pose";
    options.mapping = Mapping::kStateAugmentation;
    options.action = ActionKind::kPositionChange;
    const RobotDescription robot = description_for(GetParam());
    const Environment environment(GetParam(), options, robot);
    const Kinematics kinematics(robot);
    const double third = kinematics.finger_azimuth(1) - kinematics.finger_azimuth(0);
    Random random{.seed = 3};
    std::set<double> firsts;
    for (std::uint64_t number = 0; number < 30; ++number) {
      Episode begun;
      Scene scene{.object = environment.begin(1, number, begun).object};
      scene.goal.assign(begun.goal.begin(),
                        begun.goal.begin() + static_cast<int>(environment.goal_size()));
      for (std::size_t i = 0; i < 9; ++i) {
        scene.joints[i] =
            random.uniform(environment.position_low()[i], environment.position_high()[i]);
      }
      std::vector<float> action(9);
      for (float& one : action) one = static_cast<float>(random.uniform(-1.0, 1.0));
      const std::array<double, 9> velocity{0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9};
      const auto play = [&](const Scene& at, std::span<const double> speeds) {
        Episode episode = begun;
        std::ranges::copy(at.goal, episode.goal.begin());
        environment.begin_at(at.joints, episode);
        std::vector<double> torque(9);
        std::vector<double> position(9);
        EXPECT_TRUE(environment.take_action(action, episode, torque, position));
        std::vector<float> seen(environment.observation_size());
        std::vector<double> achieved(environment.goal_size());
        std::vector<double> desired(environment.goal_size());
        const Outcome outcome =
            environment.observe({.position = at.joints, .velocity = speeds, .object = &at.object},
                                episode, seen, achieved, desired);
        return std::tuple(seen, position, outcome.reward);
      };
      const auto [seen, position, reward] = play(scene, velocity);
      std::array<double, 9> turned_velocity{};
      std::ranges::rotate_copy(velocity, velocity.end() - 3, turned_velocity.begin());
      const auto [other, turned_position, other_reward] =
          play(scene.turned(third), turned_velocity);
      std::vector<double> expected = position;
      std::rotate(expected.begin(), expected.end() - 3, expected.end());
      EXPECT_THAT(other, ::testing::Pointwise(::testing::FloatNear(2e-6F), seen));
      EXPECT_THAT(turned_position, ::testing::Pointwise(::testing::DoubleNear(1e-12), expected));
      EXPECT_NEAR(other_reward, reward, 1e-9);
      firsts.insert(std::round(std::atan2(scene.goal[1], scene.goal[0]) / third));
    }
    EXPECT_GE(firsts.size(), 3);
  }
}

INSTANTIATE_TEST_SUITE_P(Learning, WithSymmetry,
                         ::testing::Values("push", "lift", "lift_pose", "move_cube_on_trajectory"));

// The faces of a cube differ in colours only: all 24 orientations that look alike without them are
// seen as one. Other orientations are seen as others, and near ones as near ones.
TEST(Symmetry, SeesAllFacesOfACubeAlike) {
  EnvironmentOptions options = default_options("lift");
  options.symmetric_object = options.symmetric_view = true;
  options.layout = Layout::kDictionary;
  const Environment environment("lift", options, RobotDescription{});
  std::size_t place = 0;
  for (const Entry& entry : environment.entries()) {
    if (entry.name == "object_faces") break;
    place += entry.low.size();
  }
  ASSERT_LT(place, environment.observation_size());
  const Eigen::AngleAxisd about_x(std::numbers::pi / 2, Eigen::Vector3d::UnitX());
  const Eigen::AngleAxisd about_z(std::numbers::pi / 2, Eigen::Vector3d::UnitZ());
  Random random{.seed = 5};
  for (std::uint64_t number = 0; number < 20; ++number) {
    Episode episode;
    Start start = environment.begin(2, number, episode);
    const auto seen_as = [&](const Eigen::Quaterniond& rotation) {
      start.object.orientation = {rotation.w(), rotation.x(), rotation.y(), rotation.z()};
      const std::array<double, 9> still{};
      std::vector<float> seen(environment.observation_size());
      std::array<double, 3> achieved{};
      std::array<double, 3> desired{};
      Episode same = episode;
      (void)environment.observe({.position = std::span(start.position).first(9),
                                 .velocity = still,
                                 .object = &start.object},
                                same, seen, achieved, desired);
      return seen;
    };
    const Eigen::Quaterniond begin(
        Eigen::Vector4d::NullaryExpr([&random] { return random.normal(); }).normalized());
    const std::vector<float> first = seen_as(begin);
    Eigen::Quaterniond rotation = begin;
    std::set<int> orientations;
    for (int k = 0; k < 300; ++k) {
      rotation = (rotation * (random.uniform(0.0, 1.0) < 0.5 ? about_x : about_z)).normalized();
      const std::vector<float> other = seen_as(rotation);
      for (std::size_t i = 0; i < first.size(); ++i) ASSERT_NEAR(first[i], other[i], 1e-6) << i;
      const Eigen::Matrix3d relative = (begin.conjugate() * rotation).toRotationMatrix();
      const Eigen::Vector3d shape(1.0, 3.0, 9.0);
      orientations.insert(static_cast<int>(std::lround((relative * shape)[0] * 100) +
                                           std::lround((relative * shape)[1] * 10)));
    }
    EXPECT_EQ(orientations.size(), 24U);
    // A degree about any axis is seen, in proportion.
    for (int k = 0; k < 20; ++k) {
      const Eigen::Vector3d axis =
          Eigen::Vector3d::NullaryExpr([&random] { return random.normal(); }).normalized();
      const auto change = [&](double angle) {
        const std::vector<float> other =
            seen_as(Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis)) * rotation);
        double square = 0.0;
        for (std::size_t i = place; i < place + 9; ++i) {
          square += std::pow(static_cast<double>(other[i] - first[i]), 2);
        }
        return std::sqrt(square);
      };
      EXPECT_GT(change(kDegree), 0.01);
      EXPECT_LT(change(kDegree), 0.1);
      EXPECT_NEAR(change(kDegree / 4), change(kDegree) / 4, 2e-3);
    }
  }
  options.keypoints = true;
  EXPECT_THAT([&] { Environment("lift", options, RobotDescription{}); },
              ThrowsMessage<InvalidArgument>(HasSubstr("choose one of them")));
  options.keypoints = options.symmetric_view = false;
  for (const auto* const task : {"lift_pose", "throw", "reach"}) {
    EXPECT_THAT([&] { Environment(task, options, description_for(task)); },
                ThrowsMessage<InvalidArgument>(HasSubstr("symmetric_object is for tasks")));
  }
}

TEST(Symmetry, IsForTasksThatShowAnObject) {
  const auto make = [](std::string_view task, auto change) {
    EnvironmentOptions options = default_options(task);
    change(options);
    return Environment(task, options, description_for(task)).observation_size();
  };
  for (const auto option : {&EnvironmentOptions::symmetric_view,
                            &EnvironmentOptions::object_offsets, &EnvironmentOptions::keypoints}) {
    EXPECT_THAT([&] { make("reach", [option](auto& options) { options.*option = true; }); },
                ThrowsMessage<InvalidArgument>(HasSubstr("tasks with an object")));
    EXPECT_THAT(
        [&] {
          make("push", [option](auto& options) {
            options.*option = true;
            options.layout = Layout::kGoal;
          });
        },
        ThrowsMessage<InvalidArgument>(HasSubstr("tasks with an object")));
  }
  const std::size_t usual = make("lift_pose", [](auto&) {});
  EXPECT_EQ(make("lift_pose", [](auto& options) { options.object_offsets = true; }), usual + 24);
  EXPECT_EQ(make("lift_pose", [](auto& options) { options.keypoints = true; }), usual + 48 - 4);
}

class Actions : public ::testing::Test {
 protected:
  void begin(ActionKind kind) {
    EnvironmentOptions options;
    options.action = kind;
    environment_.emplace("reach", options, RobotDescription{.objects = {}});
    (void)environment_->begin(0, 0, episode_);
  }
  bool take(float number) {
    return environment_->take_action(std::vector<float>(9, number), episode_, torque_, position_);
  }

  std::optional<Environment> environment_;
  Episode episode_;
  std::array<double, 9> torque_{};
  std::array<double, 9> position_{};
};

TEST_F(Actions, ArePositionsBetweenTheirBounds) {
  begin(ActionKind::kPosition);
  const auto low = environment_->position_low();
  const auto high = environment_->position_high();
  for (const auto& [number, share] :
       {std::pair{-1.0F, 0.0}, {0.0F, 0.5}, {1.0F, 1.0}, {7.0F, 1.0}}) {
    ASSERT_TRUE(take(number));
    for (std::size_t i = 0; i < 9; ++i) {
      EXPECT_NEAR(position_[i], low[i] + share * (high[i] - low[i]), 1e-12);
      EXPECT_EQ(torque_[i], 0.0);
    }
  }
}

TEST_F(Actions, AreChangesOfThePositionThatWasAskedForLast) {
  begin(ActionKind::kPositionChange);
  ASSERT_TRUE(take(0.0F));
  const auto before = position_;
  ASSERT_TRUE(take(0.5F));
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_NEAR(position_[i], std::min(before[i] + 0.05, environment_->position_high()[i]), 1e-12);
  }
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(take(-1.0F));
  EXPECT_TRUE(std::ranges::equal(position_, environment_->position_low()));
}

TEST_F(Actions, AreRelativeToWhatWasMeasuredLastWhateverWasAskedForBefore) {
  begin(ActionKind::kRelativePosition);
  std::vector<float> observation(environment_->observation_size());
  std::vector<double> achieved(environment_->goal_size());
  std::vector<double> desired(environment_->goal_size());
  std::array<double, 9> measured{};
  const std::array<double, 9> velocity{};
  const auto high = environment_->position_high();
  for (const float before : {-1.0F, 0.3F, 1.0F}) {
    for (std::size_t i = 0; i < 9; ++i) measured[i] = high[i] - 0.07;
    ASSERT_TRUE(take(before));
    (void)environment_->observe({.position = measured, .velocity = velocity, .object = nullptr},
                                episode_, observation, achieved, desired);
    ASSERT_TRUE(take(0.5F));
    for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(position_[i], measured[i] + 0.05, 1e-12);
    ASSERT_TRUE(take(1.0F));
    for (std::size_t i = 0; i < 9; ++i) EXPECT_EQ(position_[i], high[i]);
  }
}

TEST_F(Actions, AreSharesOfTheLargestTorque) {
  begin(ActionKind::kTorque);
  ASSERT_TRUE(take(-0.5F));
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_NEAR(torque_[i], -0.18, 1e-12);
    EXPECT_TRUE(std::isnan(position_[i]));
  }
}

TEST_F(Actions, ThatAreNotFiniteChangeNothing) {
  begin(ActionKind::kPositionChange);
  ASSERT_TRUE(take(0.3F));
  const Episode before = episode_;
  const auto position_before = position_;
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    EXPECT_FALSE(take(bad));
    EXPECT_EQ(episode_.actions, before.actions);
    EXPECT_EQ(episode_.target, before.target);
    EXPECT_EQ(position_, position_before);
  }
}

TEST(EnvironmentOptions, AreCheckedByName) {
  const auto refuses = [](auto change, const char* name) {
    EnvironmentOptions options;
    change(options);
    EXPECT_THAT([&] { options.validate(); }, ThrowsMessage<InvalidArgument>(HasSubstr(name)));
  };
  refuses([](auto& options) { options.steps_per_action = 0; }, "steps_per_action is 0");
  refuses([](auto& options) { options.steps_per_action = 1; }, "mapping 'approximation'");
  refuses([](auto& options) { options.duration = -1.0; }, "duration is -1");
  refuses([](auto& options) { options.friction = {1.0, 0.5}; }, "friction is 1 to 0.5");
  refuses([](auto& options) { options.torque_delay = {0, 11}; }, "torque_delay is 0 to 11");
  refuses([](auto& options) { options.position_noise = std::nan(""); }, "position_noise is nan");
  EXPECT_THAT([] { (void)default_options("fly"); },
              ThrowsMessage<InvalidArgument>(HasSubstr("there are 'reach', 'finger_reach'")));
}

// A task of many that begins at `start`, with goals at a half.
class Everywhere final : public TaskOfMany {
 public:
  explicit Everywhere(std::vector<Entry> entries = {}, double start = 0.0)
      : entries_(std::move(entries)), start_(start) {}

  [[nodiscard]] bool has_goals_of_fingers() const noexcept override { return true; }
  [[nodiscard]] Entry goal() const override {
    return {.name = "goal",
            .unit = "m",
            .low = std::vector<double>(9, -1.0),
            .high = std::vector<double>(9, 1.0)};
  }
  [[nodiscard]] std::vector<Entry> entries() const override { return entries_; }
  void begin(std::span<const Beginning> robots) const override {
    for (const Beginning& one : robots) one.start->position.front() = start_;
    draw_goals(robots);
  }
  void draw_goals(std::span<const Beginning> robots) const override {
    for (const Beginning& one : robots) one.episode->goal.fill(0.5);
  }
  void judge(std::span<Observed> robots) const override {
    for (Observed& one : robots) {
      std::ranges::fill(one.achieved, 0.25);
      one.outcome.reward = 7.0;
    }
  }
  void reward(std::span<const double> achieved, std::span<const double> /*desired*/,
              std::span<double> rewards) const override {
    for (std::size_t i = 0; i < rewards.size(); ++i) rewards[i] = achieved[9 * i];
  }
  void show(std::span<const Observed> /*robots*/, std::span<double> shown) const override {
    std::ranges::fill(shown, 0.0);
  }

 private:
  std::vector<Entry> entries_;
  double start_;
};

Environment everywhere(const std::vector<Entry>& entries = {}, double start = 0.0) {
  const TaskDescription task{.name = "everywhere", .make = [=](Workspace&) {
                               return std::make_unique<Everywhere>(entries, start);
                             }};
  return {task, {}, RobotDescription{}};
}

TEST(TaskOfMany, AnswersForOneRobot) {
  const Environment environment = everywhere();
  Episode episode;
  const Start start = environment.begin(1, 0, episode);
  EXPECT_EQ(episode.goal.front(), 0.5);
  std::vector<float> observation(environment.observation_size());
  std::vector<double> achieved(9);
  std::vector<double> desired(9);
  const Outcome outcome = environment.observe({.position = std::span(start.position).first(9),
                                               .velocity = std::span(start.position).first(9)},
                                              episode, observation, achieved, desired);
  EXPECT_EQ(outcome.reward, 7.0);
  EXPECT_EQ(achieved.front(), 0.25);
  EXPECT_EQ(desired.front(), 0.5);
  EXPECT_EQ(environment.reward(achieved, desired), 0.25);
  EXPECT_THROW((void)environment.reward(achieved, std::span(desired).first(8)), InvalidArgument);
}

TEST(TaskOfMany, BeginsWhereARobotCanBe) {
  Episode episode;
  EXPECT_THAT([&] { (void)everywhere({}, 9.0).begin(1, 0, episode); },
              ThrowsMessage<InvalidArgument>(HasSubstr("joint 0 at 9 in row 0")));
}

TEST(TaskOfMany, ShowsFingersThreeNumbersEach) {
  const Entry way{.name = "way", .unit = "m", .low = {-1.0}, .high = {1.0}};
  EXPECT_THAT([&] { (void)everywhere({way}); },
              ThrowsMessage<InvalidArgument>(HasSubstr("'way' has 1 numbers, not 9")));
}

}  // namespace
}  // namespace trifinger::learning
