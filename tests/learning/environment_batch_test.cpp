// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/learning/environment_batch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sim/robot_cameras.hpp"
#include "support/child_process.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/random.hpp"
#include "trifinger/core/errors.hpp"

namespace trifinger::learning {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

EnvironmentOptions noisy(std::string_view task) {
  EnvironmentOptions options = default_options(task);
  options.duration = 0.2;
  options.position_noise = 1e-3;
  options.object_mass = {0.8, 1.2};
  options.torque_delay = {0, 3};
  return options;
}

SimulationOptions late_poses() {
  SimulationOptions options;
  options.object_delay = 13;
  options.object_position_noise = 1e-3;
  return options;
}

std::vector<float> random_actions(Random& random, std::size_t count) {
  std::vector<float> actions(count);
  for (float& number : actions) number = static_cast<float>(random.uniform(-1.0, 1.0));
  return actions;
}

TEST(EnvironmentBatch, GivesTheSameWhateverTheNumberOfThreadsAndSimulations) {
  constexpr std::size_t kMany = 5;
  EnvironmentBatch many("push", noisy("push"), late_poses(), kMany, 3);
  std::vector<std::unique_ptr<EnvironmentBatch>> owners;
  std::vector<EnvironmentBatch*> ones;
  for (std::size_t i = 0; i < kMany; ++i) {
    owners.push_back(std::make_unique<EnvironmentBatch>("push", noisy("push"), late_poses(), 1, 1));
    ones.push_back(owners.back().get());
    ones[i]->seed(0, 40 + i);
    many.seed(i, 40 + i);
    ones[i]->reset();
  }
  many.reset();
  Random random{.seed = 1};
  const std::size_t width = many.environment().observation_size();
  for (const Autoreset mode : {Autoreset::kNextStep, Autoreset::kSameStep}) {
    for (int step = 0; step < 15; ++step) {
      const std::vector<float> actions = random_actions(random, kMany * 9);
      many.step(actions, mode);
      for (std::size_t i = 0; i < kMany; ++i) {
        ones[i]->step(std::span(actions).subspan(9 * i, 9), mode);
        const Results& one = ones[i]->results();
        const Results& all = many.results();
        const std::span seen = std::span(all.seen.observation).subspan(i * width, width);
        ASSERT_TRUE(std::ranges::equal(seen, one.seen.observation)) << "step " << step;
        EXPECT_EQ(all.reward[i], one.reward[0]);
        EXPECT_EQ(all.truncated[i], one.truncated[0]);
      }
    }
  }
}

// Positions of the joints after two seconds of the same random actions, with steps of this length.
std::vector<double> moved_with(std::chrono::milliseconds physics_step, TimeIndex delay) {
  constexpr int kSize = 4;
  EnvironmentOptions options = default_options("reach");
  options.torque_delay = {delay, delay};
  options.duration = 10.0;
  options.layout = Layout::kDictionary;
  // Fingers that touch each other or the table would amplify any difference.
  options.action = ActionKind::kPositionChange;
  options.position_change = 0.01;
  EnvironmentBatch batch("reach", options,
                         {.description{.objects = {}}, .physics_step = physics_step}, kSize, 1);
  batch.reset();
  Random random{.seed = 1};
  std::vector<float> actions(std::size_t{9} * kSize);
  for (int i = 0; i < 100; ++i) {
    if (i % 10 == 0) actions = random_actions(random, actions.size());
    batch.step(actions);
  }
  std::vector<double> positions;
  const auto& seen = batch.results().seen.observation;
  for (std::size_t i = 0; i < kSize; ++i) {
    const auto first = seen.begin() + static_cast<std::ptrdiff_t>(i * seen.size() / kSize);
    positions.insert(positions.end(), first, first + 9);
  }
  return positions;
}

TEST(EnvironmentBatch, MovesNearlyAlikeWithLongSteps) {
  using std::chrono::milliseconds;
  for (const TimeIndex delay : {0, 4}) {
    const std::vector<double> reference = moved_with(milliseconds(1), delay);
    double before = 0.0;
    for (const int step : {2, 4, 5}) {
      const std::vector<double> other = moved_with(milliseconds(step), delay);
      double furthest = 0.0;
      for (std::size_t i = 0; i < other.size(); ++i) {
        furthest = std::max(furthest, std::abs(other[i] - reference[i]));
      }
      EXPECT_LT(furthest, 0.05) << step << " ms, delays of " << delay;
      EXPECT_GT(furthest, 1e-6);
      if (delay == 0) {
        EXPECT_GT(furthest, before);
      }
      before = furthest;
    }
  }
}

TEST(EnvironmentBatch, SaysWhichLengthsOfStepsAreAllowed) {
  const auto make = [](Nanoseconds step) {
    return EnvironmentBatch("push", default_options("push"), {.physics_step = step}, 1).size();
  };
  using std::chrono::microseconds;
  for (const int wrong : {0, -1000, 1500, 12000, 700}) {
    EXPECT_THAT([&] { make(microseconds(wrong)); },
                ThrowsMessage<InvalidArgument>(HasSubstr("physics_step is ")))
        << wrong;
  }
  EXPECT_THAT([&] { make(microseconds(3000)); },
              ThrowsMessage<InvalidArgument>(HasSubstr("must be a multiple of 3")));
  EXPECT_EQ(make(microseconds(500)), 1);
  EXPECT_EQ(make(microseconds(10'000)), 1);
  EXPECT_THAT([] { SimulatedRobot({.physics_step = std::chrono::milliseconds(2)}); },
              ThrowsMessage<InvalidArgument>(HasSubstr("many simulations")));
}

TEST(EnvironmentBatch, fault_64_RefusesToMoveInAForkedChildAndGoesOnInItsParent) {
  auto batch = std::make_unique<EnvironmentBatch>("reach", noisy("reach"), late_poses(), 3, 2);
  EnvironmentBatch other("reach", noisy("reach"), late_poses(), 3, 2);
  const std::vector<float> actions(27, 0.1F);
  (*batch).reset();
  other.reset();
  test::ChildProcess child([&] {
    const auto refuses = [](const auto& call) {
      try {
        call();
        return false;
      } catch (const InheritedHandle&) {
        return true;
      }
    };
    if (!refuses([&] { (*batch).reset(); }) || !refuses([&] { batch->step(actions); })) return 2;
    batch = nullptr;  // waits for no thread
    EnvironmentBatch own("reach", noisy("reach"), late_poses(), 3, 2);
    own.reset();
    own.step(actions);
    return 0;
  });
  EXPECT_EQ(child.wait(), 0);
  batch->step(actions);
  other.step(actions);
  EXPECT_EQ(batch->results().reward, other.results().reward);
}

rendering::VisionOptions small_images() {
  rendering::VisionOptions vision{.cameras = calibration_of_figures({}).cameras,
                                  .capture = {.period = 12, .delay = 7},
                                  .rendering = {},
                                  .varies = true};
  for (camera::Camera& camera : vision.cameras) camera = camera.reduced(18);
  return vision;
}

TEST(EnvironmentBatch, SeesTheSameWhateverTheNumberOfThreads) {
  EnvironmentOptions options = noisy("push");
  options.layout = Layout::kImages;
  EnvironmentBatch one("push", options, late_poses(), 3, 1, small_images());
  EnvironmentBatch many("push", options, late_poses(), 3, 3, small_images());
  ASSERT_EQ(many.cameras().size(), 3U);
  ASSERT_EQ(many.results().seen.images[0].size(), 3U * 30 * 30 * 3);
  one.reset();
  many.reset();
  Random random{.seed = 1};
  for (int step = 0; step < 12; ++step) {
    const std::vector<float> actions = random_actions(random, 3 * std::size_t{9});
    const auto before = many.results().seen.images;
    one.step(actions, Autoreset::kSameStep);
    many.step(actions, Autoreset::kSameStep);
    EXPECT_EQ(one.results().seen.images, many.results().seen.images);
    EXPECT_EQ(one.results().seen.image_age, many.results().seen.image_age);
    EXPECT_EQ(one.results().final.images, many.results().final.images);
    EXPECT_NE(before, many.results().seen.images);
  }
}

TEST(EnvironmentBatch, AgesOfImagesEndWhereTheirSpaceEnds) {
  EnvironmentOptions options = default_options("push");
  options.layout = Layout::kImages;
  options.steps_per_action = 1000;
  options.duration = 100;
  rendering::VisionOptions vision = small_images();
  vision.capture.period = 100000;
  EnvironmentBatch batch("push", options, late_poses(), 1, 1, vision);
  batch.reset();
  const std::vector<float> actions(9);
  std::vector<float> ages;
  for (int i = 0; i < 11; ++i) {
    batch.step(actions);
    ages.push_back(batch.results().seen.image_age[0]);
  }
  EXPECT_EQ(ages[8], 9000);
  EXPECT_EQ(ages[10], kOldestImage) << "at step 11000";
}

TEST(EnvironmentBatch, APoseIsSureUntilTheNextOneOfThisSimulationShouldBeThere) {
  const EnvironmentOptions options = default_options("push");
  EXPECT_EQ(EnvironmentBatch("push", options, late_poses(), 1).oldest_sure_age(), 13 + 10 - 1);
  rendering::VisionOptions vision = small_images();
  vision.capture.pose_delay = 9;
  vision.finds_objects = true;
  EXPECT_EQ(EnvironmentBatch("push", options, late_poses(), 1, 1, vision).oldest_sure_age(),
            9 + 12 - 1);
}

TEST(EnvironmentBatch, NeedsCamerasForWhatIsSeen) {
  EnvironmentOptions options = noisy("push");
  options.layout = Layout::kImages;
  EXPECT_THAT([&] { EnvironmentBatch("push", options, late_poses(), 1); },
              ThrowsMessage<InvalidArgument>(HasSubstr("need simulated cameras")));
}

TEST(EnvironmentBatch, BeginsOnlyThoseEpisodesThatAreMarked) {
  EnvironmentBatch batch("push", noisy("push"), late_poses(), 3, 2);
  batch.reset();
  Random random{.seed = 2};
  batch.step(random_actions(random, 27));
  const std::vector<double> before = batch.results().seen.desired;
  batch.reset(std::vector<std::uint8_t>{0, 1, 0});
  const std::vector<double>& after = batch.results().seen.desired;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto goal_of = [i](const std::vector<double>& goals) {
      return std::span(goals).subspan(3 * i, 3);
    };
    EXPECT_EQ(std::ranges::equal(goal_of(before), goal_of(after)), i != 1);
  }
}

TEST(EnvironmentBatch, AShareOfTheEpisodesBeginsInTheMidstAndTheOthersAsBefore) {
  constexpr std::size_t kMany = 200;
  const EnvironmentOptions options = noisy("lift");
  EnvironmentBatch usual("lift", options, late_poses(), kMany);
  EnvironmentBatch batch("lift", options, late_poses(), kMany);
  const std::vector<double> position{0.1, 0.8, -1.6, 0.0, 0.9, -1.7, -0.1, 0.9, -1.8};
  const RobotDescription robot;
  std::vector<double> torque(9);
  torque[4] = 0.05 * figures(robot).kp[1];
  torque[8] = -10.0;  // further than the leash allows
  ResetStates resets{.share = 0.3};
  for (const double height : {0.2, 0.3}) {
    resets.states.push_back({position, torque, ObjectPose{.position = {0.0, 0.0, height}}});
  }
  batch.set_reset_states(resets);
  usual.reset();
  batch.reset();
  const Results& plain = usual.results();
  const Results& mixed = batch.results();
  EXPECT_EQ(plain.seen.desired, mixed.seen.desired);
  const std::size_t width = batch.environment().observation_size();
  const std::vector<std::string> names = batch.environment().flat_names();
  const auto place_of = [&names](std::string_view name) {
    return static_cast<std::size_t>(std::ranges::find(names, name) - names.begin());
  };
  const auto row_of = [width](const Results& results, std::size_t i) {
    return std::span(results.seen.observation).subspan(i * width, width);
  };
  std::array<int, 3> counts{};
  for (std::size_t i = 0; i < kMany; ++i) {
    const double height = mixed.seen.achieved[3 * i + 2];
    if (height < 0.1) {
      ++counts[0];
      EXPECT_TRUE(std::ranges::equal(row_of(plain, i), row_of(mixed, i)));
      continue;
    }
    ++counts[height < 0.25 ? 1 : 2];
    const auto shown = [&](std::string_view name) { return row_of(mixed, i)[place_of(name)]; };
    // The measured positions have noise of 1 mrad.
    EXPECT_NEAR(shown("tracking_error[4]"), 0.05 / options.leash, 0.05);
    EXPECT_NEAR(shown("tracking_error[8]"), -1.0, 0.05);
  }
  EXPECT_NEAR(counts[1] + counts[2], 0.3 * kMany, 20);
  EXPECT_NEAR(counts[1], counts[2], 25);
  EXPECT_GT(counts[0], 0);
}

TEST(EnvironmentBatch, RefusesToBeginWhereNoRobotCanBe) {
  EnvironmentBatch batch("lift", noisy("lift"), late_poses(), 1);
  const std::vector<double> position(9, 0.0);
  const auto refuses = [&](const ResetStates& resets, const char* reason) {
    EXPECT_THAT([&] { batch.set_reset_states(resets); },
                ThrowsMessage<InvalidArgument>(HasSubstr(reason)));
  };
  const double none = std::numeric_limits<double>::quiet_NaN();
  const ObjectPose lying{.position = {0.0, 0.0, 0.0325}};
  std::vector<double> far = position;
  far[3] = 10.0;
  refuses({{{position, position, lying}}, 1.5}, "must be 0 to 1");
  refuses({{{position, position, lying}}, none}, "must be 0 to 1");
  refuses({{}, 0.5}, "0 without states");
  refuses({{{position, {0.0}, lying}}, 0.5}, "torques, must have 9");
  refuses({{{position, std::vector<double>(9, none), lying}}, 0.5}, "not finite");
  refuses({{{far, position, lying}}, 0.5}, "joint 3 at 10");
  refuses({{{position, position, ObjectPose{.position = {none, 0.0, 0.0}}}}, 0.5}, "no pose");
  refuses({{{position, position}}, 0.5}, "has no pose of an object");
  EnvironmentBatch reach("reach", noisy("reach"), late_poses(), 1);
  EXPECT_THAT([&] { reach.set_reset_states({{{position, position, lying}}, 0.5}); },
              ThrowsMessage<InvalidArgument>(HasSubstr("has a pose of an object")));
  reach.set_reset_states({{{position, position}}, 0.5});
}

// A robot that is homed wrongly asks for the same torques, and says what it asks for.
TEST(EnvironmentBatch, TheLastActionOfAStateAsksForItsTorques) {
  const RobotDescription robot;
  const std::vector<double> position{0.1, 0.8, -1.6, 0.0, 0.9, -1.7, -0.1, 0.9, -1.8};
  std::vector<double> torque(9);
  for (std::size_t i = 0; i < 9; ++i) torque[i] = 0.03 * static_cast<double>(i) - 0.1;
  for (const ActionKind kind :
       {ActionKind::kPosition, ActionKind::kPositionChange, ActionKind::kTorque}) {
    EnvironmentOptions options = default_options("lift");
    options.action = kind;
    options.mapping = Mapping::kStateAugmentation;
    options.homing_error = {0.005, 0.005};
    EnvironmentBatch batch("lift", options, {}, 1);
    const ObjectPose high{.position = {0.0, 0.0, 0.3}};
    batch.set_reset_states({{{position, torque, high}}, 1.0});
    batch.reset();
    const Environment& environment = batch.environment();
    const auto numbers_of = [&](std::string_view name) {
      const std::vector<std::string> names = environment.flat_names();
      const auto first = std::ranges::find(names, name) - names.begin();
      const auto begin = batch.results().seen.observation.begin() + first;
      return std::vector<double>(begin, begin + 9);
    };
    const Entry& joints = environment.entries()[0];
    const auto scaled = [](double number, double low, double high_end) {
      return low + 0.5 * (number + 1.0) * (high_end - low);
    };
    for (std::size_t i = 0; i < 9; ++i) {
      const double kp = figures(robot).kp[i % 3];
      const double measured =
          scaled(numbers_of("joint_position[0]")[i], joints.low[i], joints.high[i]);
      EXPECT_GT(std::abs(measured - position[i]), 1e-4);
      if (kind == ActionKind::kTorque) {
        EXPECT_NEAR(numbers_of("action[0]")[i] * actuator(robot).torque_limit, torque[i], 1e-6);
      } else if (kind == ActionKind::kPosition) {
        const double desired = scaled(numbers_of("action[0]")[i], environment.position_low()[i],
                                      environment.position_high()[i]);
        EXPECT_NEAR(kp * (desired - measured), torque[i], 1e-5);
      } else {
        const double ahead = options.leash * numbers_of("tracking_error[0]")[i];
        EXPECT_NEAR(kp * ahead, torque[i], 1e-5);
      }
    }
  }
}

TEST(EnvironmentBatch, MovesNothingBehindAnEndUntilItIsReset) {
  EnvironmentBatch batch("push", noisy("push"), late_poses(), 1, 1);
  batch.reset();
  Random random{.seed = 3};
  for (int i = 0; i < 10; ++i) batch.step(random_actions(random, 9), Autoreset::kDisabled);
  ASSERT_EQ(batch.results().truncated[0], 1);
  const std::vector<float> last = batch.results().seen.observation;
  batch.step(random_actions(random, 9), Autoreset::kDisabled);
  EXPECT_EQ(batch.results().seen.observation, last);
}

// MuJoCo calls this in every step. It leaves the step by a jump.
int steps_before_error = 0;
void fail_after_some_steps(const mjModel* /*model*/, mjData* /*data*/) {
  if (--steps_before_error == 0) mju_error("the test wants it so");
}

TEST(EnvironmentBatch, fault_61_BeginsAnewWhatMujocoCannotGoOnWith) {
  for (const Autoreset mode : {Autoreset::kNextStep, Autoreset::kSameStep}) {
    EnvironmentBatch batch("reach", noisy("reach"), late_poses(), 1, 1);
    EnvironmentBatch other("reach", noisy("reach"), late_poses(), 1, 1);
    batch.seed(0, 4);
    other.seed(0, 4, 1);
    batch.reset();
    other.reset();
    Random random{.seed = 2};
    steps_before_error = 5;
    mjcb_control = &fail_after_some_steps;
    batch.step(random_actions(random, 9), mode);
    mjcb_control = nullptr;
    EXPECT_NE(batch.results().fault[0], 0);
    EXPECT_EQ(batch.results().truncated[0], 1);
    EXPECT_EQ(batch.results().terminated[0], 0);
    if (mode == Autoreset::kNextStep) {
      EXPECT_NE(batch.results().seen.observation, other.results().seen.observation);
      batch.step(random_actions(random, 9), mode);
    }
    EXPECT_EQ(batch.results().seen.observation, other.results().seen.observation);
    const std::vector<float> actions = random_actions(random, 9);
    batch.step(actions, mode);
    other.step(actions, mode);
    EXPECT_EQ(batch.results().seen.observation, other.results().seen.observation);
    EXPECT_EQ(batch.results().fault[0], 0);
  }
}

TEST(EnvironmentBatch, RefusesActionsThatAreNotFiniteAndMovesNothing) {
  EnvironmentBatch batch("push", noisy("push"), late_poses(), 2, 1);
  batch.reset();
  const std::vector<float> before = batch.results().seen.observation;
  std::vector<float> actions(18, 0.1F);
  actions[10] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT([&] { batch.step(actions); },
              ThrowsMessage<InvalidArgument>(HasSubstr("number 1 of the action of simulation 1")));
  EXPECT_EQ(batch.results().seen.observation, before);
  EXPECT_THROW(batch.step(std::vector<float>(17)), InvalidArgument);
  EXPECT_THROW(batch.reset(std::vector<std::uint8_t>(3)), InvalidArgument);
  EXPECT_THROW(batch.seed(2, 0), InvalidArgument);
}

TEST(EnvironmentBatch, RefusesNoSimulations) {
  EXPECT_THAT([] { EnvironmentBatch("push", {}, SimulationOptions{}, 0); },
              ThrowsMessage<InvalidArgument>(HasSubstr("number of simulations is 0")));
}

}  // namespace
}  // namespace trifinger::learning
