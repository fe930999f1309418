// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/orderly_stop.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "joint/limits_of_tests.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/joint/safety.hpp"

namespace trifinger {
namespace {

using std::chrono::milliseconds;
using Action = TriFinger::Action;
using Observation = TriFinger::Observation;

constexpr Nanoseconds kPeriod = milliseconds(1);
constexpr double kSeconds = 0.001;

// Joints that only have inertia.
class Joints {
 public:
  explicit Joints(unsigned seed) : random_(seed) {
    for (std::size_t i = 0; i < 9; ++i) {
      observation.position[i] = between(limits[i].soft_lower, limits[i].soft_upper);
      observation.velocity[i] = between(-3.0, 3.0);
      rest[i] = between(limits[i].soft_lower, limits[i].soft_upper);
    }
  }

  [[nodiscard]] OrderlyStopOptions options() const {
    OrderlyStopOptions options{.damping_time = milliseconds(200),
                               .rest_position = std::vector(rest.begin(), rest.end())};
    options.move_time = options.shortest_move_time(limits);
    return options;
  }

  // Applies an action to the motors.
  SafetyReport apply(const Action& action) {
    AppliedJointAction<9> applied;
    const SafetyReport report = chain.apply(action, observation, kPeriod, state, applied);
    for (std::size_t i = 0; i < 9; ++i) {
      constexpr double kInertia = 0.002;  // [kg m^2], of a link
      EXPECT_LE(std::abs(applied.torque[i]), limits[i].max_torque);
      observation.velocity[i] += kSeconds * applied.torque[i] / kInertia;
      observation.position[i] += kSeconds * observation.velocity[i];
      EXPECT_GE(observation.position[i], limits[i].hard_lower);
      EXPECT_LE(observation.position[i], limits[i].hard_upper);
    }
    return report;
  }

  JointLimits<9> limits{test::some_limits<9>()};
  SafetyChain<TriFinger> chain{limits};
  SafetyState<9> state;
  Observation observation;
  JointVector<9> rest{};

 private:
  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  std::mt19937 random_;
};

// Writes the action of period `step`. False once the stop is over.
bool next(OrderlyStop& stop, TimeIndex step, const Observation& observation, Action& action) {
  action = {};
  JointVector<9> target{};
  const OrderlyStop::Phase phase = stop.next(step, observation.position, target);
  if (phase == OrderlyStop::Phase::kMove) action.position = target;
  return phase != OrderlyStop::Phase::kOver;
}

TEST(OrderlyStop, EndsAtRestAtThePoseAndNeverLeavesTheLimits) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    Joints joints(seed);
    OrderlyStop stop(joints.options(), kPeriod);
    Action action;
    TimeIndex step = 0;
    for (; next(stop, step, joints.observation, action); ++step) {
      ASSERT_EQ(joints.apply(action).fault, SafetyFault::kNone);
    }
    EXPECT_EQ(step, stop.num_steps());
    for (std::size_t i = 0; i < 9; ++i) {
      EXPECT_NEAR(joints.observation.position[i], joints.rest[i], 0.02) << "seed " << seed;
      EXPECT_NEAR(joints.observation.velocity[i], 0.0, 0.05) << "seed " << seed;
    }
  }
}

TEST(OrderlyStop, AsksForNothingWhileItDampsAndForNoTorqueEver) {
  Joints joints(1);
  OrderlyStop stop(joints.options(), kPeriod);
  Action action;
  for (TimeIndex step = 0; next(stop, step, joints.observation, action); ++step) {
    EXPECT_THAT(action.torque, ::testing::Each(0.0));
    for (const double position : action.position) EXPECT_EQ(std::isnan(position), step < 200);
  }
}

TEST(OrderlyStop, GoesStraightFromWhereItIsToTheRestPosition) {
  const Joints joints(2);
  OrderlyStop stop(joints.options(), kPeriod);
  const JointVector<9> start = joints.observation.position;
  JointVector<9> last = start;
  Action action;
  for (TimeIndex step = 0; next(stop, step, joints.observation, action); ++step) {
    if (step < 200) continue;
    for (std::size_t i = 0; i < 9; ++i) {
      const double before = std::abs(joints.rest[i] - last[i]);
      const double after = std::abs(joints.rest[i] - action.position[i]);
      EXPECT_LE(after, before + 1e-12) << step;
      const auto [low, high] = std::minmax(start[i], joints.rest[i]);
      EXPECT_GE(action.position[i], low - 1e-12);
      EXPECT_LE(action.position[i], high + 1e-12);
    }
    last = action.position;
  }
  for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(last[i], joints.rest[i], 1e-12);
}

TEST(OrderlyStop, WithoutOptionsItIsOverAtOnce) {
  OrderlyStop stop({}, kPeriod);
  Action action;
  EXPECT_EQ(stop.num_steps(), 0);
  EXPECT_FALSE(next(stop, 0, {}, action));
}

TEST(OrderlyStop, WithoutARestPositionItOnlyDamps) {
  Joints joints(3);
  joints.observation.position = {};  // where no soft limit pushes
  OrderlyStop stop({.damping_time = milliseconds(2000)}, kPeriod);
  Action action;
  TimeIndex step = 0;
  for (; next(stop, step, joints.observation, action); ++step) {
    EXPECT_THAT(action.position, ::testing::Each(::testing::IsNan()));
    joints.apply(action);
  }
  EXPECT_EQ(step, 2000);
  for (const double velocity : joints.observation.velocity) EXPECT_NEAR(velocity, 0.0, 0.05);
}

TEST(OrderlyStop, MovesNothingByItselfAfterAFault) {
  const Joints joints(4);
  for (const TimeIndex fault :
       {TimeIndex{0}, TimeIndex{100}, TimeIndex{199}, TimeIndex{200}, TimeIndex{201},
        OrderlyStop(joints.options(), kPeriod).num_steps() - 1}) {
    OrderlyStop stop(joints.options(), kPeriod);
    Action action;
    TimeIndex step = 0;
    for (; next(stop, step, joints.observation, action); ++step) {
      if (step >= fault) stop.give_up(step);
      if (step <= fault) continue;
      EXPECT_THAT(action.position, ::testing::Each(::testing::IsNan()));
    }
    // The stop damps for the whole time, and ends.
    EXPECT_EQ(step, fault < 200 ? 200 : fault + 1 + 200);
  }
}

TEST(OrderlyStop, BeginsAnewAfterEverySession) {
  const Joints joints(5);
  OrderlyStop stop(joints.options(), kPeriod);
  Action action;
  for (int session = 0; session < 3; ++session) {
    TimeIndex step = 0;
    while (next(stop, step, joints.observation, action)) ++step;
    EXPECT_EQ(step, stop.num_steps());
    EXPECT_TRUE(next(stop, 0, joints.observation, action));
    stop.give_up(0);
  }
}

TEST(OrderlyStop, DoesNotAllocate) {
  const Joints joints(6);
  OrderlyStop stop(joints.options(), kPeriod);
  Action action;
  const test::AllocationCounter allocations;
  for (TimeIndex step = 0; next(stop, step, joints.observation, action); ++step) {
    if (step == 300) stop.give_up(step);
  }
  EXPECT_EQ(allocations.count(), 0U);
}

std::string problem_of(const OrderlyStopOptions& options) {
  try {
    options.validate(test::some_limits<9>());
  } catch (const InvalidArgument& error) {
    return error.what();
  }
  return "none";
}

TEST(OrderlyStopOptions, MustMakeSense) {
  const OrderlyStopOptions good{.rest_position = std::vector<double>(9),
                                .move_time = std::chrono::seconds(4)};
  EXPECT_EQ(problem_of(good), "none");
  EXPECT_EQ(problem_of({}), "none");
  OrderlyStopOptions options = good;
  options.damping_time = -kPeriod;
  EXPECT_EQ(problem_of(options), "damping_time is negative");
  options = good;
  (*options.rest_position)[3] = 2.0;
  EXPECT_THAT(problem_of(options), ::testing::HasSubstr("rest_position of joint 3 is 2.0"));
  (*options.rest_position)[3] = kNotGiven;
  EXPECT_THAT(problem_of(options), ::testing::HasSubstr("rest_position of joint 3 is nan"));
  options = good;
  options.move_time = milliseconds(100);
  EXPECT_THAT(problem_of(options), ::testing::HasSubstr("or the joints cannot follow"));
  options.move_time = Nanoseconds::zero();
  EXPECT_THAT(problem_of(options), ::testing::HasSubstr("move_time is 0.0"));
}

}  // namespace
}  // namespace trifinger
