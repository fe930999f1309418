// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "sim/recording.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::test {
namespace {

using testing::AllOf;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Poses are delayed all the time, and noise is drawn.
template <class R>
SimulationOptions noisy_options() {
  SimulationOptions options;
  if constexpr (std::is_same_v<R, Finger>) {
    options.description.arrangement = Arrangement::kSingleFinger;
  }
  options.seed = 3;
  options.object_period = 7;
  options.object_delay = 23;
  options.object_position_noise = 1e-3;
  options.object_orientation_noise = 1e-2;
  return options;
}

template <class R>
class SavedState : public testing::Test {
 public:
  static constexpr int kSteps = 400;

  Poking<R> poking() const { return Poking<R>(options.description, centre, 1); }

  const SimulationOptions options = noisy_options<R>();
  const Triple centre = SimulatedRobot(options).object_pose("cube").position;
};

using Robots = testing::Types<TriFinger, Finger>;
TYPED_TEST_SUITE(SavedState, Robots);

// Step `first` of the first recording corresponds to step 0 of the second one.
template <class R>
std::string first_difference_from(const Recording<R>& whole, int first, const Recording<R>& rest) {
  Recording<R> expected{{whole.observations.begin() + first, whole.observations.end()},
                        {whole.applied.begin() + first, whole.applied.end()},
                        {whole.cube.begin() + first, whole.cube.end()}};
  for (CubeObservation& element : expected.cube) {
    element.stamp.capture_index -= first;
    // Everything known before a session is known at its step -1.
    element.stamp.arrival_index = std::max<TimeIndex>(element.stamp.arrival_index - first, -1);
  }
  return first_difference(expected, rest);
}

TYPED_TEST(SavedState, GoesOnBitForBitInANewSession) {
  using R = TypeParam;
  for (const int first : {1, 6, 7, 8, 23, 150, 399}) {
    const Simulation simulation(this->options);
    auto policy = this->poking();
    Recording<R> whole;
    SimulationState state;
    {
      auto robot = simulation.connect<R>();
      record(robot, policy, first, whole);
      state = simulation.robot().save();
      auto same_policy = policy;
      record(robot, same_policy, this->kSteps, whole);
    }
    simulation.robot().restore(state);
    auto robot = simulation.connect<R>();
    Recording<R> rest;
    record(robot, policy, this->kSteps, rest);
    EXPECT_EQ(first_difference_from(whole, first, rest), "") << "saved before step " << first;
  }
}

TYPED_TEST(SavedState, GoesOnBitForBitInAnotherSimulation) {
  using R = TypeParam;
  constexpr int kFirst = 200;
  const Simulation simulation(this->options);
  auto robot = simulation.connect<R>();
  auto policy = this->poking();
  Recording<R> whole;
  record(robot, policy, kFirst, whole);
  const SimulationState state = simulation.robot().save();
  auto same_policy = policy;
  record(robot, same_policy, this->kSteps, whole);

  const Simulation other(this->options);
  other.robot().restore(state);
  auto other_robot = other.connect<R>();
  Recording<R> rest;
  record(other_robot, policy, this->kSteps, rest);
  EXPECT_EQ(first_difference_from(whole, kFirst, rest), "");
}

TYPED_TEST(SavedState, TakesEffectAtOnceInASessionThatGoesOn) {
  using R = TypeParam;
  constexpr int kFirst = 200;
  const Simulation simulation(this->options);
  auto robot = simulation.connect<R>({.strict = false});
  auto policy = this->poking();
  Recording<R> before;
  record(robot, policy, kFirst, before);
  const SimulationState state = simulation.robot().save();
  auto same_policy = policy;
  Recording<R> one;
  record(robot, policy, this->kSteps, one);
  // The observation of the next step has been read by now. The next action must not be judged by
  // it.
  (void)robot.get_observation(kFirst + this->kSteps);
  simulation.robot().restore(state);
  Recording<R> other;
  record(robot, same_policy, this->kSteps, other);
  // The first observation of the second part existed before.
  one.observations.front() = other.observations.front();
  one.cube = other.cube;
  EXPECT_EQ(first_difference(one, other), "");
}

TYPED_TEST(SavedState, IsTheSameHoweverOftenItIsRestored) {
  using R = TypeParam;
  const Simulation simulation(this->options);
  {
    auto robot = simulation.connect<R>();
    auto policy = this->poking();
    Recording<R> unused;
    record(robot, policy, 100, unused);
  }
  const SimulationState state = simulation.robot().save();
  simulation.robot().restore(state);
  EXPECT_EQ(simulation.robot().save(), state);
}

TEST(SimulatedRobot, BeginsASessionWhereItWasPutDuringTheOneBefore) {
  const Simulation simulation;
  const JointVector<9> position{0.1, 0.8, -1.6, 0.2, 0.7, -1.5, 0.0, 1.0, -1.8};
  {
    auto robot = simulation.connect();
    robot.wait_until_time_index(robot.append_desired_action({}));
    simulation.robot().reset(position, {});
    // The session continues from there before it ends.
    robot.wait_until_time_index(robot.append_desired_action({}) + 1);
  }
  EXPECT_EQ(simulation.connect().latest_observation().position, position);
  EXPECT_EQ(simulation.connect().latest_observation().velocity, JointVector<9>{});
}

TEST(SimulatedRobot, BeginsInTheInitialPoseOfItsOptions) {
  SimulationOptions options;
  options.initial_position = std::vector{0.1, 0.8, -1.6, 0.2, 0.7, -1.5, 0.0, 1.0, -1.8};
  EXPECT_THAT(simulate(options).latest_observation().position,
              testing::ElementsAreArray(*options.initial_position));
}

TEST(SimulatedRobot, RefusesTheStateOfAnotherModel) {
  const auto state_of = [](const SimulationOptions& options) {
    return SimulatedRobot(options).save();
  };
  SimulatedRobot robot;
  const auto is_refused = ThrowsMessage<InvalidArgument>(HasSubstr("saved from another model"));
  SimulationOptions pro;
  pro.description.variant = Variant::kPro;
  EXPECT_THAT([&] { robot.restore(state_of(pro)); }, is_refused);
  SimulationOptions heavy;
  heavy.description.objects[0].mass = 0.2;
  EXPECT_THAT([&] { robot.restore(state_of(heavy)); }, is_refused);
  SimulationOptions two;
  two.description.objects.push_back(ball());
  EXPECT_THAT([&] { robot.restore(state_of(two)); }, is_refused);
  SimulationOptions late;
  late.object_delay = 3;
  EXPECT_THAT([&] { robot.restore(state_of(late)); }, is_refused);
  EXPECT_NO_THROW(robot.restore(state_of({.seed = 7})));
}

TEST(SimulatedRobot, RefusesBytesThatAreNoState) {
  SimulatedRobot robot;
  const auto is_refused =
      ThrowsMessage<InvalidArgument>(HasSubstr("not the saved state of a simulation"));
  EXPECT_THAT([&] { robot.restore({}); }, is_refused);
  EXPECT_THAT([&] { robot.restore(SimulationState(100)); }, is_refused);
  SimulationState cut = robot.save();
  cut.pop_back();
  EXPECT_THAT([&] { robot.restore(cut); }, testing::Throws<InvalidArgument>());
}

TEST(SimulatedRobot, RefusesToBeginBeyondAHardLimit) {
  SimulatedRobot robot;
  for (const double bad : {2.0, -2.1, kNan, kInfinity}) {
    JointVector<9> position{0, 0.9, -1.7, 0, 0.9, -1.7, 0, 0.9, -1.7};
    position[3] = bad;
    EXPECT_THAT([&] { robot.reset(position, {}); },
                ThrowsMessage<InvalidArgument>(
                    AllOf(HasSubstr("joint 3"), HasSubstr("hard limits are -2 and 1.6 rad"))));
  }
}

TEST(SimulationState, PushesAnObjectForAsLongAsItIsTold) {
  const Simulation simulation;
  simulation.robot().place_object("cube", {.position = {0.0, 0.0, 1.0}});
  auto robot = simulation.connect();
  const auto hold = hold_position(robot.latest_observation());
  constexpr double kForce = 0.5;    // [N]
  constexpr double kSeconds = 0.1;  // A tenth of a second with the force, another without.
  const auto wait = [&] {
    for (int i = 0; i < 100; ++i) (void)robot.get_observation(robot.append_desired_action(hold));
    return simulation.robot().object_pose("cube").position[0];
  };
  simulation.robot().push_object("cube", {kForce, 0.0, 0.0});
  const double pushed = wait();
  simulation.robot().push_object("cube", {0.0, 0.0, 0.0});
  const double flown = wait();
  const double speed = kForce / cube().mass * kSeconds;
  EXPECT_NEAR(pushed, speed * kSeconds / 2, 1e-3);
  EXPECT_NEAR(flown - pushed, speed * kSeconds, 1e-3);
  EXPECT_THROW(simulation.robot().push_object("cube", {kInfinity, 0.0, 0.0}), InvalidArgument);
  EXPECT_THROW(simulation.robot().push_object("ball", {}), InvalidArgument);
}

TEST(PlaceObject, PutsItThereAtRestAndNormalisesTheOrientation) {
  SimulatedRobot robot;
  robot.place_object("cube", {.position = {0.05, -0.02, 0.0325}, .orientation = {3, 0, 0, 4}});
  const ObjectPose pose = robot.object_pose("cube");
  EXPECT_THAT(pose.position, ElementsAre(0.05, -0.02, 0.0325));
  EXPECT_THAT(pose.orientation, ElementsAre(DoubleNear(0.6, 1e-15), 0, 0, DoubleNear(0.8, 1e-15)));
}

TEST(PlaceObject, IsSeenInTheNextSession) {
  const Simulation simulation({.object_delay = 50});
  const ObjectPose pose{.position = {0.05, -0.02, 0.0325}, .orientation = {0.6, 0, 0, 0.8}};
  {
    auto robot = simulation.connect();
    robot.wait_until_time_index(robot.append_desired_actions(std::vector<JointAction<9>>(100)));
  }
  simulation.robot().place_object("cube", pose);
  auto robot = simulation.connect();
  const Companion<CubeObservation> cube(robot.companion("object"));
  EXPECT_EQ(cube.get_latest_at(-1).value().cube.position, pose.position);
}

TEST(PlaceObject, RefusesWhatIsNoPose) {
  SimulatedRobot robot;
  const auto is_refused =
      ThrowsMessage<InvalidArgument>(HasSubstr("object 'cube' cannot be placed"));
  EXPECT_THAT([&] { robot.place_object("cube", {.position = {kNan, 0, 0}}); }, is_refused);
  EXPECT_THAT([&] { robot.place_object("cube", {.position = {0, kInfinity, 0}}); }, is_refused);
  EXPECT_THAT([&] { robot.place_object("cube", {.orientation = {0, 0, 0, 0}}); }, is_refused);
  EXPECT_THAT([&] { robot.place_object("cube", {.orientation = {1, 0, kNan, 0}}); }, is_refused);
  EXPECT_THAT([&] { robot.place_object("cube", {.orientation = {1e200, 0, 0, 1e200}}); },
              is_refused);
  EXPECT_THAT(robot.object_pose("cube").position, ElementsAre(0, 0, 0.0325));
}

TEST(PlaceObject, NamesTheObjectsThereAre) {
  SimulationOptions options;
  options.description.objects = {cube("red"), cube("blue")};
  SimulatedRobot robot(options);
  const auto names_them = ThrowsMessage<InvalidArgument>(
      AllOf(HasSubstr("'green'"), HasSubstr("red"), HasSubstr("blue")));
  EXPECT_THAT([&] { robot.place_object("green", {}); }, names_them);
  EXPECT_THAT([&] { (void)robot.object_pose("green"); }, names_them);
}

}  // namespace
}  // namespace trifinger::test
