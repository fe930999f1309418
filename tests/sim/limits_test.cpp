// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "sim/robots.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::test {
namespace {

using testing::HasSubstr;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Everything that a user could send: numbers of every size, NaN, infinities, and now and then
// something sensible.
template <class R>
class Hostile {
 public:
  explicit Hostile(std::uint32_t seed) : random_(seed) {}

  typename R::Action operator()() {
    typename R::Action action;
    for (auto* const values :
         {&action.torque, &action.position, &action.position_kp, &action.position_kd}) {
      for (double& value : *values) value = number();
    }
    return action;
  }

 private:
  double number() {
    switch (random_() % 10) {
      case 0:
        return kNotGiven;
      case 1:
        return kInfinity;
      case 2:
        return -1e300;
      case 3:
        return std::pow(10.0, 300 * uniform_(random_));
      default:
        return 3 * uniform_(random_);
    }
  }

  std::mt19937 random_;
  std::uniform_real_distribution<double> uniform_{-1.0, 1.0};
};

// The driver as the back-end calls it, without the back-end's own limits.
template <class R>
class BareDriver {
 public:
  explicit BareDriver(SimulationOptions<R> options) : robot(std::move(options)) {
    (void)robot.prepare(0);
    (void)robot.get_latest_observation(observation);
  }

  DriverReport step(const typename R::Action& desired) {
    const DriverReport report = robot.apply_action(desired, applied);
    (void)robot.get_latest_observation(observation);
    return report;
  }
  DriverReport fault_after(const typename R::Action& desired, int max_steps) {
    for (int i = 0; i < max_steps; ++i) {
      const DriverReport report = step(desired);
      if (report.state == DriverReport::State::kFault) return report;
    }
    return {};
  }

  SimulatedRobot<R> robot;
  typename R::Observation observation;
  typename R::AppliedAction applied;
};

// --- A million random actions

// A million for each robot in all scenes together; a sanitizer takes ten times as long for each.
#ifdef __SANITIZE_ADDRESS__
constexpr int kRandomActions = 100'000;
#else
constexpr int kRandomActions = 1'000'000;
#endif

struct Scene {
  const char* name;
  Variant variant;
  bool flipped{false};
  double lowered_by{0.0};  // [m]
};
constexpr double kLow = 0.05;  // the table is in the way of the fingers
constexpr Scene kScenes[] = {
    {"Edu", Variant::kEdu},
    {"EduFlipped", Variant::kEdu, true},
    {"EduLow", Variant::kEdu, false, kLow},
    {"Pro", Variant::kPro},
    {"ProFlipped", Variant::kPro, true},
    {"ProLow", Variant::kPro, false, kLow},
    {"One", Variant::kOne},
    {"OneFlipped", Variant::kOne, true},
    {"OneLow", Variant::kOne, false, kLow},
};

// The parameter is the number of a scene, and the seed of its actions.
class RandomActions : public testing::TestWithParam<std::uint32_t> {
 protected:
  template <class R>
  static void expect_limits_hold() {
    constexpr int kSteps = kRandomActions / static_cast<int>(std::size(kScenes)) + 1;
    const Scene& scene = kScenes[GetParam()];
    SimulationOptions<R> options = options_of<R>(scene.variant);
    options.description.flipped = scene.flipped;
    options.description.finger_height =
        figures(options.description).finger_height - scene.lowered_by;
    // Bent, as on the platform: a finger that hangs straight down would begin in the table.
    const auto bent = figures(options_of<TriFinger>(scene.variant).description).initial_position;
    options.initial_position.emplace();
    for (std::size_t i = 0; i < R::kJoints; ++i) (*options.initial_position)[i] = bent[i % 3];
    const JointLimits<R::kJoints> limits = default_limits<R>(options.description);
    BareDriver<R> driver(options);
    Hostile<R> hostile(GetParam());
    int faults = 0;
    for (int i = 0; i < kSteps; ++i) {
      const DriverReport report = driver.step(hostile());
      for (std::size_t joint = 0; joint < R::kJoints; ++joint) {
        // Written so that NaN fails.
        ASSERT_LE(std::abs(driver.applied.torque[joint]), limits.max_torque[joint]);
        ASSERT_LE(std::abs(driver.observation.torque[joint]), limits.max_torque[joint]);
        ASSERT_LE(std::abs(driver.observation.position[joint]), 2 * std::acos(-1.0));
        ASSERT_LE(std::abs(driver.observation.velocity[joint]), 100.0);
      }
      if (report.state != DriverReport::State::kFault) continue;
      ASSERT_NE(report.fault_code, SimulatedRobot<R>::kDiverged) << "step " << i;
      ++faults;
      driver.robot.reset();
      (void)driver.robot.get_latest_observation(driver.observation);
    }
    // Hard limits may be met now and then, or else the test would be about nothing else.
    EXPECT_LT(faults, kSteps / 100);
  }
};

TEST_P(RandomActions, NeverLeadATriFingerOutOfItsLimits) { expect_limits_hold<TriFinger>(); }
TEST_P(RandomActions, NeverLeadAFingerOutOfItsLimits) { expect_limits_hold<Finger>(); }

INSTANTIATE_TEST_SUITE_P(Scenes, RandomActions,
                         testing::Range(0U, static_cast<std::uint32_t>(std::size(kScenes))),
                         [](const auto& scene) { return kScenes[scene.param].name; });

// --- Limits one by one

template <class R>
class Limits : public testing::Test {};
using Robots = testing::Types<TriFinger, Finger>;
TYPED_TEST_SUITE(Limits, Robots);

TYPED_TEST(Limits, SoftLimitsKeepTheJointOffTheHardOnes) {
  using R = TypeParam;
  for (const Variant variant : kVariants) {
    SimulationOptions<R> options = options_of<R>(variant);
    options.description.objects.clear();
    const JointLimits<R::kJoints> limits = default_limits<R>(options.description);
    for (const double sign : {-1.0, 1.0}) {
      BareDriver<R> driver(options);
      typename R::Action action;
      // As hard as can be, but with the default gains: users cannot override the push back.
      for (double& torque : action.torque) torque = sign * 1e3;
      const DriverReport report = driver.fault_after(action, 2000);
      EXPECT_EQ(report.state, DriverReport::State::kReady) << label(options) << ' ' << sign;
      for (std::size_t i = 0; i < R::kJoints; ++i) {
        EXPECT_GT(driver.observation.position[i], limits.hard_lower[i]) << label(options);
        EXPECT_LT(driver.observation.position[i], limits.hard_upper[i]) << label(options);
      }
    }
  }
}

// Soft limits so far out that a joint can run into a hard one.
template <class R>
SimulationOptions<R> without_soft_limits(Variant variant) {
  SimulationOptions<R> options = options_of<R>(variant);
  options.limits = default_limits<R>(options.description);
  options.limits->soft_lower = options.limits->hard_lower;
  options.limits->soft_upper = options.limits->hard_upper;
  options.limits->safety_kd = {};
  return options;
}

TYPED_TEST(Limits, AHardLimitIsAFault) {
  using R = TypeParam;
  for (const Variant variant : kVariants) {
    const Simulation<R> simulation(without_soft_limits<R>(variant));
    Frontend<R> robot = simulation.connect();
    typename R::Action action = hold_position(robot.latest_observation());
    action.position[0] = kNotGiven;
    action.torque[0] = -1e3;
    try {
      for (int i = 0; i < 5000; ++i) {
        (void)robot.get_observation(robot.append_desired_action(action));
      }
      FAIL() << "no fault with variant " << static_cast<int>(variant);
    } catch (const RobotStopped& stopped) {
      EXPECT_EQ(stopped.fault().code, Fault::Code::kDriver);
      EXPECT_EQ(stopped.fault().detail, static_cast<std::int32_t>(SafetyFault::kHardLimit));
      EXPECT_THAT(stopped.what(), HasSubstr("a joint is beyond its hard limit"));
      const auto last = robot.get_observation(stopped.fault().time_index);
      EXPECT_LT(last.position[0], figures(simulation.robot().options().description).hard_lower[0]);
    }
  }
}

// --- Divergence

// A saved state with one speed of the cube beyond all measure.
SimulationState tampered(SimulatedRobot<TriFinger>& robot, double speed) {
  const ObjectPose pose{.position = {0.05, 0.04, 0.0625}};
  robot.place_object("cube", pose);
  SimulationState state = robot.save();
  // The pose is found by its bytes; the speeds stand behind all positions.
  const auto* const bytes = reinterpret_cast<const std::byte*>(pose.position.data());
  const auto place = std::search(state.begin(), state.end(), bytes, bytes + sizeof(pose.position));
  EXPECT_NE(place, state.end());
  constexpr std::ptrdiff_t kNumbersOfPose = 7;
  constexpr std::ptrdiff_t kJoints = 9;
  std::memcpy(&*(place + (kNumbersOfPose + kJoints) * 8), &speed, sizeof(speed));
  return state;
}

TEST(Divergence, fault_61_IsAFaultWithTheStateBefore) {
  const Simulation<TriFinger> simulation;
  SimulatedRobot<TriFinger>& driver = simulation.robot();
  EXPECT_TRUE(driver.state_before_divergence().empty());
  driver.restore(tampered(driver, 1e300));

  Frontend<TriFinger> robot = simulation.connect();
  try {
    (void)robot.get_observation(robot.append_desired_actions(std::vector<JointAction<9>>(100)));
    FAIL() << "it did not diverge";
  } catch (const RobotStopped& stopped) {
    EXPECT_EQ(stopped.fault().code, Fault::Code::kDriver);
    EXPECT_EQ(stopped.fault().detail, SimulatedRobot<TriFinger>::kDiverged);
    EXPECT_THAT(stopped.what(), HasSubstr("the simulation diverged"));
  }
  EXPECT_FALSE(driver.state_before_divergence().empty());
}

TEST(Divergence, HappensAgainFromTheStateBefore) {
  // The speed is such that it takes a few steps until numbers are no longer finite.
  BareDriver<TriFinger> driver({});
  driver.robot.restore(tampered(driver.robot, 3e9));
  const DriverReport first = driver.fault_after({}, 1000);
  ASSERT_EQ(first.fault_code, SimulatedRobot<TriFinger>::kDiverged);

  BareDriver<TriFinger> other({});
  other.robot.restore(driver.robot.state_before_divergence());
  const SimulationState before = other.robot.save();
  EXPECT_EQ(other.step({}).fault_code, SimulatedRobot<TriFinger>::kDiverged);
  EXPECT_TRUE(other.robot.state_before_divergence() == before);
}

TEST(Divergence, TakesNoMemory) {
  BareDriver<TriFinger> driver({});
  driver.robot.restore(tampered(driver.robot, 1e300));
  const AllocationCounter allocations;
  ASSERT_EQ(driver.fault_after({}, 1000).fault_code, SimulatedRobot<TriFinger>::kDiverged);
  EXPECT_EQ(allocations.count(), 0U);
}

TEST(Divergence, IsOverAfterAReset) {
  BareDriver<TriFinger> driver({});
  driver.robot.restore(tampered(driver.robot, 1e300));
  ASSERT_EQ(driver.fault_after({}, 1000).fault_code, SimulatedRobot<TriFinger>::kDiverged);
  driver.robot.reset();
  EXPECT_EQ(driver.fault_after({}, 100).state, DriverReport::State::kReady);
}

TEST(Divergence, fault_61_DoesNotStopTheNextSession) {
  const Simulation<TriFinger> simulation;
  simulation.robot().restore(tampered(simulation.robot(), 1e300));
  {
    Frontend<TriFinger> robot = simulation.connect();
    EXPECT_THROW((void)robot.get_observation(robot.append_desired_action({}) + 1), RobotStopped);
    robot.recover();
  }
  simulation.robot().reset();
  Frontend<TriFinger> robot = simulation.connect();
  EXPECT_NO_THROW((void)robot.get_observation(robot.append_desired_action({})));
}

TEST(Divergence, DoesNotComeFromAnObjectInsideTheTable) {
  BareDriver<TriFinger> driver({});
  driver.robot.place_object("cube", {.position = {0.0, 0.0, 0.0}});
  EXPECT_EQ(driver.fault_after({}, 1000).state, DriverReport::State::kReady);
}

}  // namespace
}  // namespace trifinger::test
