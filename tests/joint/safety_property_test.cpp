// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "joint/limits_of_tests.hpp"
#include "trifinger/joint/safety.hpp"

namespace trifinger {
namespace {

using Chain = SafetyChain<TriFinger>;
using Action = TriFinger::Action;
using Observation = TriFinger::Observation;
using Applied = TriFinger::AppliedAction;

constexpr int kSteps = 1'000'000;
constexpr Nanoseconds kPeriod = std::chrono::milliseconds(1);

// Random numbers like those of a hostile user and a broken sensor.
class Chance {
 public:
  explicit Chance(std::uint32_t seed) : engine_(seed) {}

  [[nodiscard]] Action action() {
    Action action;
    for (std::size_t i = 0; i < 9; ++i) {
      action.torque[i] = one_in(4) ? nasty() : between(-1.0, 1.0);
      action.position[i] = one_in(4) ? nasty() : between(-2.0, 3.0);
      action.position_kp[i] = one_in(4) ? nasty() : between(-1.0, 55.0);
      action.position_kd[i] = one_in(4) ? nasty() : between(-0.1, 0.6);
    }
    return action;
  }

  // Mostly within the hard limits, sometimes beyond, rarely NaN.
  [[nodiscard]] Observation observation() {
    Observation observation;
    const bool is_broken = one_in(8);
    for (std::size_t i = 0; i < 9; ++i) {
      observation.position[i] = is_broken && one_in(4) ? nasty() : between(-2.0, 2.5);
      observation.velocity[i] = is_broken && one_in(4) ? nasty()
                                : one_in(4)            ? 0.0
                                                       : between(-20.0, 20.0);
    }
    return observation;
  }

 private:
  [[nodiscard]] bool one_in(std::uint32_t count) { return engine_() % count == 0; }
  [[nodiscard]] double between(double min, double max) {
    return min + (max - min) * (static_cast<double>(engine_()) / 4294967296.0);
  }
  [[nodiscard]] double nasty() {
    using Limits = std::numeric_limits<double>;
    constexpr std::array kNasty{Limits::quiet_NaN(),
                                Limits::infinity(),
                                -Limits::infinity(),
                                Limits::signaling_NaN(),
                                1e300,
                                -1e300,
                                Limits::max(),
                                Limits::lowest(),
                                Limits::min(),
                                -Limits::min(),
                                Limits::denorm_min(),
                                -Limits::denorm_min(),
                                0.0,
                                -0.0,
                                1e6,
                                -1e6,
                                1e9};
    return kNasty[engine_() % kNasty.size()];
  }

  std::mt19937 engine_;
};

bool is_same(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }

// What joint `i` is asked to do, computed independently of the code under test: the torque plus the
// PD of the position, with the given gains or the robot's own.
struct Asked {
  double torque;
  double position;
  double kp;
  double kd;
};
Asked asked_of(const Action& action, const Observation& observation, const JointLimits<9>& limits,
               std::size_t i) {
  if (std::isnan(action.position[i])) return {action.torque[i], kNotGiven, kNotGiven, kNotGiven};
  const double kp =
      std::isnan(action.position_kp[i]) ? limits[i].default_kp : action.position_kp[i];
  const double kd =
      std::isnan(action.position_kd[i]) ? limits[i].default_kd : action.position_kd[i];
  const double pd =
      kp * (action.position[i] - observation.position[i]) - kd * observation.velocity[i];
  return {action.torque[i] + pd, action.position[i], kp, kd};
}

bool is_fit(const Action& action, const JointLimits<9>& limits, std::size_t i) {
  if (!std::isfinite(action.torque[i])) return false;
  if (std::isnan(action.position[i])) return true;
  const auto is_gain = [](double gain, double max) {
    return std::isnan(gain) || (gain >= 0 && gain <= max);
  };
  return std::isfinite(action.position[i]) && is_gain(action.position_kp[i], limits[i].max_kp) &&
         is_gain(action.position_kd[i], limits[i].max_kd);
}

TEST(SafetyProperty, fault_06_HoldsForAMillionRandomActions) {
  const JointLimits<9> limits = test::some_limits<9>();
  const Chain chain(limits);
  SafetyState<9> state;
  Chance chance(20261120);
  int faults = 0;
  std::uint64_t seen = 0;

  for (int step = 0; step < kSteps; ++step) {
    const Action desired = chance.action();
    const Observation observation = chance.observation();
    Applied applied;
    const SafetyReport report = chain.apply(desired, observation, kPeriod, state, applied);
    const bool is_fault = report.fault != SafetyFault::kNone;
    faults += is_fault ? 1 : 0;

    bool is_any_unfit = false;
    for (std::size_t i = 0; i < 9; ++i) {
      // SCOPED_TRACE would write nine million messages.
      const auto where = [&] {
        return " at step " + std::to_string(step) + ", joint " + std::to_string(i);
      };
      const double max = limits[i].max_torque;
      seen |= applied.reasons[i];

      // The torque never exceeds the limit and is always finite.
      ASSERT_TRUE(std::isfinite(applied.torque[i])) << where();
      ASSERT_LE(std::abs(applied.torque[i]), max) << where();
      if (!std::isnan(applied.position[i])) {
        ASSERT_GE(applied.position[i], limits[i].soft_lower) << where();
        ASSERT_LE(applied.position[i], limits[i].soft_upper) << where();
      }

      // There are no reasons exactly if the applied action is the one asked for.
      const Asked asked = asked_of(desired, observation, limits, i);
      const bool is_as_asked = std::isfinite(asked.torque) && asked.torque == applied.torque[i] &&
                               is_same(asked.position, applied.position[i]) &&
                               is_same(asked.kp, applied.position_kp[i]) &&
                               is_same(asked.kd, applied.position_kd[i]);
      if (is_fault) {
        ASSERT_NE(applied.reasons[i], 0U) << where();
        continue;
      }
      ASSERT_EQ(applied.reasons[i] == 0, is_as_asked) << names_of(applied.reasons[i]) << where();

      const bool is_unfit = !is_fit(desired, limits, i);
      is_any_unfit = is_any_unfit || is_unfit;
      ASSERT_EQ((applied.reasons[i] & kRejected) != 0, is_unfit) << where();

      // Clips, damps and clips again: computed independently for joints that no other rule has
      // changed.
      const double position = observation.position[i];
      const double velocity = observation.velocity[i];
      const bool is_inside = position >= limits[i].soft_lower && position <= limits[i].soft_upper;
      const bool is_target_inside =
          std::isnan(desired.position[i]) || (desired.position[i] >= limits[i].soft_lower &&
                                              desired.position[i] <= limits[i].soft_upper);
      if (is_inside && is_target_inside && !is_unfit) {
        const double clipped = asked.torque > max ? max : asked.torque < -max ? -max : asked.torque;
        const double damped = clipped - limits[i].safety_kd * velocity;
        ASSERT_EQ(applied.torque[i], damped > max ? max : damped < -max ? -max : damped) << where();
      }

      // Beyond a soft limit, nothing pushes further out except the brake of a joint that is coming
      // back.
      if (position > limits[i].soft_upper && velocity >= 0) {
        ASSERT_LE(applied.torque[i], 0.0) << where();
      }
      if (position < limits[i].soft_lower && velocity <= 0) {
        ASSERT_GE(applied.torque[i], 0.0) << where();
      }
    }
    if (!is_fault) {
      ASSERT_EQ(report.action_rejected, is_any_unfit);
    }
  }

  // The random numbers must have reached every rule.
  EXPECT_GT(faults, kSteps / 100);
  EXPECT_LT(faults, kSteps / 2);
  for (const Reason reason : all_reasons()) {
    // The remaining reasons belong to limits that are switched off here.
    if (reason >= Reason::kTorqueRateLimited) continue;
    if (reason == Reason::kOwnCheck || reason == Reason::kOwnCheckFailed) continue;
    EXPECT_TRUE(has(seen, reason)) << name_of(reason);
  }
}

// Joints that unknown forces push about, between faults of every kind.
class Wanderer {
 public:
  explicit Wanderer(std::uint32_t seed) : engine_(seed) {}

  [[nodiscard]] Observation next(const Applied& applied) {
    for (std::size_t i = 0; i < 9; ++i) {
      observation_.velocity[i] =
          std::clamp(observation_.velocity[i] + 0.5 * uniform_(engine_), -6.0, 6.0);
      // Turns round before a hard limit.
      const double next = observation_.position[i] + 1e-3 * observation_.velocity[i];
      if (std::abs(next) > 1.9) observation_.velocity[i] *= -1.0;
      observation_.position[i] += 1e-3 * observation_.velocity[i];
      observation_.torque[i] = applied.torque[i];
    }
    return observation_;
  }

 private:
  std::mt19937 engine_;
  std::uniform_real_distribution<double> uniform_{-1.0, 1.0};
  Observation observation_;
};

JointLimits<9> every_limit() {
  JointLimits<9> limits = test::some_limits<9>();
  for (JointLimit& limit : limits) {
    limit.max_velocity = 4.0;
    limit.braking = 10.0;
    limit.max_torque_rate = 20.0;
    limit.continuous_torque = 0.18;
    limit.thermal_time = 8.0;
    limit.stuck_torque = 0.2;
    for (const JointLimitField& field : JointLimit::fields()) {
      if (limit.*field.value == test::kOff) limit.*field.value = field.usual;
    }
  }
  return limits;
}

TEST(SafetyProperty, HoldsWithEveryLimitOn) {
  const JointLimits<9> limits = every_limit();
  const Chain chain(limits);
  SafetyState<9> state;
  Chance chance(3);
  Wanderer joints(4);
  Applied applied;
  std::uint64_t seen = 0;
  for (int step = 0; step < kSteps / 5; ++step) {
    // Sometimes the user asks for everything, because otherwise the motors would never get warm.
    const Action desired =
        step % 40'000 < 20'000 ? Action::of_torque(detail::filled<9>(1e9)) : chance.action();
    const std::array<JointMemory, 9> before = state.joints;
    const Observation observation = joints.next(applied);
    const SafetyReport report = chain.apply(desired, observation, kPeriod, state, applied);
    ASSERT_EQ(report.fault, SafetyFault::kNone) << names_of(applied.reasons[0]) << step;
    for (std::size_t i = 0; i < 9; ++i) {
      const JointLimit& limit = limits[i];
      const double torque = applied.torque[i];
      const double velocity = observation.velocity[i];
      const double position = observation.position[i];
      seen |= applied.reasons[i];

      // An obedient motor is never too warm, and gets no more than its heat allows.
      const double heat = state.joints[i].heat;
      ASSERT_LE(heat, 1.0);
      ASSERT_LE(std::abs(torque), derated_torque(heat, limit));
      ASSERT_LE(applied.thermal_margin[i], 1.0 - heat);

      // The damping acts in full, whatever the rate limit delays: against the torque asked for, or
      // against the torque before if that is larger.
      const double outward = velocity > 0.0 ? torque : -torque;
      const double slewed = std::abs(before[i].asked_torque) + limit.max_torque_rate * 1e-3;
      const bool is_inside = position > limit.soft_lower && position < limit.soft_upper;
      if (is_inside) {
        const double damped =
            std::min(limit.max_torque, slewed) - limit.safety_kd * std::abs(velocity);
        ASSERT_LE(outward, std::max(damped, -derated_torque(heat, limit)) + 1e-12);
      }
      if (std::abs(velocity) > limit.max_velocity) {
        ASSERT_LE(outward, 0.0);
      }
      if (position > limit.soft_upper && velocity > 0.0) {
        ASSERT_LT(torque, 0.0);
      }
      if (position < limit.soft_lower && velocity < 0.0) {
        ASSERT_GT(torque, 0.0);
      }
    }
  }
  for (const Reason reason : {Reason::kTorqueRateLimited, Reason::kDerated, Reason::kTooFast}) {
    EXPECT_TRUE(has(seen, reason)) << name_of(reason);
  }
}

TEST(SafetyProperty, fault_10_TheSmallestNumbersActAsZero) {
  using Numbers = std::numeric_limits<double>;
  const Chain chain(test::some_limits<9>());
  const Observation observation{.velocity = detail::filled<9>(5.0)};
  Chance chance(10);
  for (int step = 0; step < 10'000; ++step) {
    for (const auto field :
         {&Action::torque, &Action::position, &Action::position_kp, &Action::position_kd}) {
      Action zero = chance.action();
      zero.*field = {};
      SafetyState<9> state_of_zero;
      Applied expected;
      (void)chain.apply(zero, observation, kPeriod, state_of_zero, expected);
      for (const double tiny : {Numbers::denorm_min(), Numbers::min(), -0.0}) {
        Action action = zero;
        action.*field = detail::filled<9>(tiny);
        SafetyState<9> state;
        Applied applied;
        (void)chain.apply(action, observation, kPeriod, state, applied);
        for (std::size_t i = 0; i < 9; ++i) {
          ASSERT_NEAR(applied.torque[i], expected.torque[i], 1e-300) << tiny;
          ASSERT_EQ(applied.reasons[i], expected.reasons[i]) << tiny;
        }
      }
    }
  }
}

TEST(SafetyProperty, fault_07_NoRequestCancelsTheBrake) {
  const JointLimits<9> limits = test::some_limits<9>();
  const Chain chain(limits);
  Chance chance(7);
  for (int step = 0; step < 100'000; ++step) {
    SafetyState<9> state;
    Applied applied;
    const Observation observation{.velocity = detail::filled<9>(5.0)};
    (void)chain.apply(chance.action(), observation, kPeriod, state, applied);
    for (std::size_t i = 0; i < 9; ++i) {
      ASSERT_LE(applied.torque[i], limits[i].max_torque - limits[i].safety_kd * 5.0 + 1e-12);
    }
  }
}

TEST(SafetyProperty, HoldsWithAnOwnCheckThatDoesItsWorst) {
  const JointLimits<9> limits = test::some_limits<9>();
  Chain chain(limits);
  Chance worst(1);
  chain.add_check([&worst](const Observation&, Action& action) { action = worst.action(); });
  SafetyState<9> state;
  Chance chance(2);
  for (int step = 0; step < 100'000; ++step) {
    const Action desired = chance.action();
    const Observation observation = chance.observation();
    Applied applied;
    const SafetyReport report = chain.apply(desired, observation, kPeriod, state, applied);
    for (std::size_t i = 0; i < 9; ++i) {
      ASSERT_TRUE(std::isfinite(applied.torque[i]));
      ASSERT_LE(std::abs(applied.torque[i]), limits[i].max_torque);
      const Asked asked = asked_of(desired, observation, limits, i);
      const bool is_as_asked = std::isfinite(asked.torque) && asked.torque == applied.torque[i] &&
                               is_same(asked.position, applied.position[i]) &&
                               is_same(asked.kp, applied.position_kp[i]) &&
                               is_same(asked.kd, applied.position_kd[i]);
      if (report.fault == SafetyFault::kNone && (applied.reasons[i] & kRejected) == 0) {
        ASSERT_EQ(applied.reasons[i] == 0, is_as_asked);
      }
    }
  }
}

TEST(SafetyProperty, AStateThatIsSavedAndRestoredContinuesIdentically) {
  const Chain chain(test::some_limits<9>());
  const auto run = [&](SafetyState<9>& state, std::uint32_t seed, int steps) {
    Chance chance(seed);
    std::vector<Applied> all(static_cast<std::size_t>(steps));
    for (Applied& applied : all) {
      const Action desired = chance.action();
      (void)chain.apply(desired, chance.observation(), kPeriod, state, applied);
    }
    return all;
  };

  SafetyState<9> state;
  (void)run(state, 1, 1000);
  const SafetyState<9> saved = state;
  const std::vector<Applied> first = run(state, 2, 1000);
  (void)run(state, 3, 1000);
  state = saved;
  const std::vector<Applied> second = run(state, 2, 1000);
  EXPECT_EQ(std::memcmp(first.data(), second.data(), first.size() * sizeof(Applied)), 0);

  // The state matters: a different state gives a different result.
  SafetyState<9> fresh;
  const std::vector<Applied> other = run(fresh, 2, 1000);
  EXPECT_NE(std::memcmp(first.data(), other.data(), first.size() * sizeof(Applied)), 0);
}

}  // namespace
}  // namespace trifinger
