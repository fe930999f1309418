// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <vector>

#include "sim/robots.hpp"
#include "sim/scene_observation.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::test {
namespace {

using testing::DoubleNear;
using testing::ElementsAre;

// Returns what a reader knows of the cube at every step while the fingers stay where they are.
std::vector<CubeObservation> poses_of(const SimulationOptions& options, int steps) {
  auto robot = simulate(options);
  const Companion<CubeObservation> cube(robot.companion("object"));
  const auto hold = hold_position(robot.latest_observation());
  std::vector<CubeObservation> poses;
  poses.reserve(static_cast<std::size_t>(steps));
  for (int i = 0; i < steps; ++i) {
    poses.push_back(cube.get_latest_at(robot.append_desired_action(hold)).value());
  }
  return poses;
}

TEST(ObjectSession, ShowsThePoseBeforeStepZero) {
  auto robot = simulate<TriFinger>();
  const Companion<CubeObservation> cube(robot.companion("object"));
  const CubeObservation first = cube.get_latest_at(-1).value();
  EXPECT_EQ(first.stamp.arrival_index, -1);
  EXPECT_EQ(first.stamp.capture_index, -1);
  EXPECT_THAT(first.cube.position, ElementsAre(0, 0, 0.0325));
  EXPECT_THAT(first.cube.orientation, ElementsAre(1, 0, 0, 0));
}

TEST(ObjectSession, ShowsAnObjectAsItIsTurnedAtTheStart) {
  SimulationOptions options;
  options.description.objects[0].orientation = {3, 0, 0, 4};
  auto robot = simulate(options);
  const Companion<CubeObservation> cube(robot.companion("object"));
  EXPECT_THAT(cube.get_latest_at(-1).value().cube.orientation, ElementsAre(0.6, 0, 0, 0.8));
}

TEST(ObjectSession, ShowsAPoseAHundredTimesASecond) {
  const auto poses = poses_of({}, 200);
  for (TimeIndex t = 0; t < 200; ++t) {
    const Stamp& stamp = poses[static_cast<std::size_t>(t)].stamp;
    EXPECT_EQ(stamp.capture_index, t / 10 * 10);
    EXPECT_EQ(stamp.arrival_index, stamp.capture_index);
  }
}

TEST(ObjectSession, ShowsAPoseWhenItHasArrived) {
  SimulationOptions options;
  options.object_period = 4;
  options.object_delay = 11;
  const auto poses = poses_of(options, 100);
  for (TimeIndex t = 0; t < 100; ++t) {
    const Stamp& stamp = poses[static_cast<std::size_t>(t)].stamp;
    const TimeIndex expected = t < 11 ? -1 : (t - 11) / 4 * 4;
    EXPECT_EQ(stamp.capture_index, expected) << t;
    EXPECT_EQ(stamp.arrival_index, expected < 0 ? -1 : expected + 11) << t;
    EXPECT_EQ(stamp.arrival_time - stamp.capture_time,
              (stamp.arrival_index - stamp.capture_index) * 1000000);
  }
}

TEST(ObjectSession, ShowsWhereTheObjectWasWhenItWasSeen) {
  // The cube falls, so late poses are higher.
  SimulationOptions options;
  options.description.objects[0].position = {0, 0, 0.2};
  options.object_period = 1;
  const auto now = poses_of(options, 100);
  options.object_delay = 20;
  const auto late = poses_of(options, 100);
  for (std::size_t t = 20; t < 100; ++t) {
    EXPECT_EQ(late[t].cube.position, now[t - 20].cube.position);
  }
  EXPECT_LT(now[99].cube.position[2], 0.16);
}

TEST(ObjectSession, HasTheNoiseThatWasAskedFor) {
  constexpr double kPosition = 2e-3;
  constexpr double kOrientation = 2e-2;
  SimulationOptions options;
  options.object_period = 1;
  options.object_position_noise = kPosition;
  options.object_orientation_noise = kOrientation;
  constexpr int kCount = 4000;
  const auto poses = poses_of(options, kCount);

  for (std::size_t axis = 0; axis < 3; ++axis) {
    double mean = 0;
    double square = 0;
    double turn_square = 0;
    for (const CubeObservation& pose : poses) {
      const double error = pose.cube.position[axis] - (axis == 2 ? 0.0325 : 0.0);
      mean += error / kCount;
      square += error * error / kCount;
      // This is half the sine of the angle; for small angles, half the angle.
      const double turn = 2 * pose.cube.orientation[axis + 1];
      turn_square += turn * turn / kCount;
    }
    // Five standard deviations of the mean and of the standard deviation of 4000 numbers, plus the
    // small depth to which the cube sinks in.
    EXPECT_THAT(mean, DoubleNear(0, 5 * kPosition / std::sqrt(kCount) + 1e-4)) << axis;
    EXPECT_THAT(std::sqrt(square), DoubleNear(kPosition, 0.06 * kPosition)) << axis;
    EXPECT_THAT(std::sqrt(turn_square), DoubleNear(kOrientation, 0.06 * kOrientation)) << axis;
  }
}

TEST(ObjectSession, LosesTheShareOfPosesThatWasAskedForAndKeepsTheOthers) {
  SimulationOptions options;
  options.object_period = 4;
  options.object_delay = 3;
  options.object_loss = 0.3;
  constexpr TimeIndex kCount = 2000;
  const auto poses = poses_of(options, 4 * kCount);
  int num_arrived = 0;
  for (TimeIndex t = 3; t < 4 * kCount; t += 4) {
    const Stamp& stamp = poses[static_cast<std::size_t>(t)].stamp;
    // The newest pose is that of this step, or an older one that had arrived before.
    if (stamp.capture_index == t - 3) {
      ++num_arrived;
    } else {
      EXPECT_EQ(stamp.capture_index, poses[static_cast<std::size_t>(t) - 1].stamp.capture_index);
    }
  }
  // Five standard deviations of a share of 2000.
  EXPECT_THAT(static_cast<double>(num_arrived) / kCount, DoubleNear(0.7, 0.052));
  options.object_loss = 1;
  EXPECT_EQ(poses_of(options, 100).back().stamp.capture_index, -1);
}

TEST(ObjectSession, HasNoNoiseUnlessAsked) {
  auto robot = simulate<TriFinger>();
  const Companion<CubeObservation> cube(robot.companion("object"));
  EXPECT_THAT(cube.get_latest_at(-1).value().cube.position, ElementsAre(0, 0, 0.0325));
}

TEST(ObjectSession, GivesUnitQuaternions) {
  SimulationOptions options;
  options.object_period = 1;
  options.object_orientation_noise = 1.0;
  for (const CubeObservation& pose : poses_of(options, 500)) {
    double norm = 0;
    for (const double value : pose.cube.orientation) norm += value * value;
    EXPECT_NEAR(norm, 1.0, 1e-12);
  }
}

struct TwoObjects {
  Stamp stamp;
  ObjectPose red;
  ObjectPose ball;

  static constexpr auto fields() {
    return std::tuple{field("stamp", &TwoObjects::stamp), field("red", &TwoObjects::red),
                      field("ball", &TwoObjects::ball)};
  }
};

TEST(ObjectSession, NamesItsObjects) {
  SimulationOptions options;
  options.description.objects = {cube("red"), ball()};
  options.description.objects[1].position = {0.1, 0.05, 0.03};
  auto robot = simulate(options);
  const Companion<TwoObjects> objects(robot.companion("object"));
  const TwoObjects first = objects.get_latest_at(-1).value();
  EXPECT_THAT(first.red.position, ElementsAre(0, 0, 0.0325));
  EXPECT_THAT(first.ball.position, ElementsAre(0.1, 0.05, 0.03));
  EXPECT_THROW(Companion<CubeObservation>(robot.companion("object")), IncompatibleSession);
}

TEST(ObjectSession, IsNotThereWithoutObjects) {
  SimulationOptions options;
  options.description.objects.clear();
  auto robot = simulate(options);
  EXPECT_THROW((void)robot.companion("object"), SessionNotFound);
  EXPECT_NO_THROW((void)robot.get_observation(robot.append_desired_action({})));
}

TEST(ObjectSession, RefusesNamesThatCannotBeNamesOfFields) {
  for (const char* const name : {"a cube", "cube.position", "stamp"}) {
    SimulationOptions options;
    options.description.objects[0].name = name;
    EXPECT_THROW(SimulatedRobot{options}, InvalidArgument) << name;
  }
}

TEST(SceneSession, SaysWhereEverythingIsAtEveryPeriod) {
  SimulationOptions options;
  options.scene_period = 7;
  // What is known of objects is late and noisy; the scene is not.
  options.object_delay = 50;
  options.object_position_noise = 0.01;
  const Simulation simulation(options);
  auto robot = simulation.connect();
  const UntypedFrontend scene = robot.companion(kSceneCompanion);
  const std::size_t numbers = configuration_size(*make_model(options));
  ASSERT_EQ(scene.session().element(Series::kObservation).size(),
            sizeof(Stamp) + numbers * sizeof(double));
  std::vector<std::byte> element(sizeof(Stamp) + numbers * sizeof(double));
  std::vector<double> expected = simulation.robot().configuration();
  ASSERT_TRUE(scene.get_latest_at(-1, element.data(), Nanoseconds::zero()));
  for (TimeIndex t = 0; t < 60; ++t) {
    if (t % 7 == 0) expected = simulation.robot().configuration();
    ASSERT_EQ(robot.append_desired_action({}), t);
    ASSERT_TRUE(scene.get_latest_at(t, element.data(), kForever));
    Stamp stamp;
    std::memcpy(&stamp, element.data(), sizeof(stamp));
    EXPECT_EQ(stamp.capture_index, t / 7 * 7);
    EXPECT_EQ(stamp.arrival_index, t / 7 * 7);
    std::vector<double> found(numbers);
    std::memcpy(found.data(), element.data() + sizeof(stamp), numbers * sizeof(double));
    EXPECT_EQ(found, expected) << t;
  }
}

TEST(SceneSession, IsThereOnlyIfItIsAskedFor) {
  auto robot = simulate<TriFinger>();
  EXPECT_THROW(static_cast<void>(robot.companion(kSceneCompanion)), SessionNotFound);
  EXPECT_THROW(static_cast<void>(simulate<TriFinger>({.scene_period = -1})), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::test
