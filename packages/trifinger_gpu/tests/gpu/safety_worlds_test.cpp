// SPDX-License-Identifier: BSD-3-Clause
#include "gpu/safety_worlds.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include "joint/limits_of_tests.hpp"
#include "trifinger/joint/safety.hpp"

namespace trifinger::gpu {
namespace {

using Chain = SafetyChain<TriFinger>;

constexpr std::int32_t kWorlds = 16;
constexpr std::size_t kJoints = 9;
constexpr std::size_t kAll = kWorlds * kJoints;
constexpr int kSteps = 20'000;
constexpr Nanoseconds kPeriod = std::chrono::milliseconds(1);

// Limits of which every check is on.
JointLimits<kJoints> strict_limits() {
  JointLimits<kJoints> limits = test::some_limits<kJoints>();
  for (JointLimit& limit : limits) {
    limit.max_velocity = 10.0;
    limit.braking = 100.0;
    limit.max_torque_rate = 100.0;
    limit.continuous_torque = 0.3;
    limit.thermal_time = 3.0;
    limit.max_position_rate = 65.0;
    limit.max_velocity_error = 10.0;
    limit.velocity_error_time = 0.1;
    limit.stuck_torque = 0.1;
    limit.stuck_time = 0.02;
  }
  return limits;
}

class Chance {
 public:
  // A joint that wanders within its limits, and now and then is beyond, still or broken.
  [[nodiscard]] JointMeasurement measurement(const JointMeasurement& before) {
    if (one_in(2000)) return {nasty(), between(-1.0, 1.0), nasty()};
    // A joint that stops stays where it is for a while.
    if (before.velocity == 0.0 ? !one_in(40) : one_in(3)) return before;
    const double velocity = one_in(100) ? 0.0 : between(-8.0, 12.0);
    const double position = std::clamp(before.position + 0.001 * velocity, -1.2, 1.9);
    return {one_in(4000) ? 3.0 : position, velocity, one_in(50) ? 10.0 : between(-0.4, 0.4)};
  }

  [[nodiscard]] JointCommand command() {
    return {one_in(40) ? nasty() : between(-1.0, 1.0), one_in(4) ? nasty() : between(-2.0, 3.0),
            one_in(4) ? kNotGiven : between(-0.5, 55.0),
            one_in(4) ? kNotGiven : between(-0.01, 0.6)};
  }

 private:
  [[nodiscard]] bool one_in(std::uint32_t count) { return engine_() % count == 0; }
  [[nodiscard]] double between(double least, double most) {
    return least + (most - least) * (static_cast<double>(engine_()) / 4294967296.0);
  }
  [[nodiscard]] double nasty() {
    using Limits = std::numeric_limits<double>;
    constexpr std::array kNasty{
        Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(), 1e300, -1e300, 0.0};
    return kNasty[engine_() % kNasty.size()];
  }

  std::mt19937 engine_{20261130};
};

// Bit for bit: NaN is equal to itself, and 0 is not -0.
template <class T>
bool has_same_bits(const T& a, const T& b) {
  return std::memcmp(&a, &b, sizeof(T)) == 0;
}

TEST(SafetyWorlds, GiveWhatTheChainGivesBitForBit) {
  const JointLimits<kJoints> limits = strict_limits();
  const Chain chain(limits);
  std::vector<SafetyState<kJoints>> states(kWorlds);
  std::vector<TriFinger::AppliedAction> expected(kWorlds);
  std::vector<JointMeasurement> measured(kAll);
  std::vector<JointCommand> desired(kAll);
  std::vector<JointMemory> memory(kAll);
  std::vector<CheckedCommand> applied(kAll);
  std::vector<std::int32_t> fault(kWorlds);
  Chance chance;
  std::uint64_t seen = 0;
  int faults = 0;

  for (int step = 0; step < kSteps; ++step) {
    for (std::size_t i = 0; i < kAll; ++i) {
      measured[i] = chance.measurement(measured[i]);
      desired[i] = chance.command();
    }
    apply_to_worlds({.num_worlds = kWorlds,
                     .num_joints = kJoints,
                     .elapsed = 0.001,
                     .limits = limits.data(),
                     .measured = measured.data(),
                     .desired = desired.data(),
                     .memory = memory.data(),
                     .applied = applied.data(),
                     .fault = fault.data()});
    for (std::size_t world = 0; world < kWorlds; ++world) {
      const std::size_t first = world * kJoints;
      TriFinger::Action action;
      TriFinger::Observation observation;
      for (std::size_t i = 0; i < kJoints; ++i) {
        trifinger::detail::set_command(action, i, desired[first + i]);
        observation.position[i] = measured[first + i].position;
        observation.velocity[i] = measured[first + i].velocity;
        observation.torque[i] = measured[first + i].torque;
      }
      const SafetyReport report =
          chain.apply(action, observation, kPeriod, states[world], expected[world]);
      ASSERT_EQ(fault[world], report.joint) << "step " << step << ", robot " << world;
      faults += report.joint >= 0 ? 1 : 0;
      for (std::size_t i = 0; i < kJoints; ++i) {
        const CheckedCommand want{trifinger::detail::command_of(expected[world], i),
                                  expected[world].reasons[i]};
        ASSERT_TRUE(has_same_bits(applied[first + i], want) &&
                    has_same_bits(memory[first + i], states[world].joints[i]))
            << "step " << step << ", robot " << world << ", joint " << i;
        seen |= want.reasons;
      }
    }
    // A robot that has stopped begins anew, near soft limits, so that most steps have no fault.
    for (std::size_t world = 0; world < kWorlds; ++world) {
      if (fault[world] < 0) continue;
      states[world] = {};
      std::fill_n(memory.begin() + static_cast<std::ptrdiff_t>(world * kJoints), kJoints,
                  JointMemory{});
      std::fill_n(measured.begin() + static_cast<std::ptrdiff_t>(world * kJoints), kJoints,
                  JointMeasurement{.position = 1.45});
    }
  }
  EXPECT_GT(faults, 1000);
  EXPECT_LT(faults, kWorlds * kSteps / 2);
  // Every reason that the chain itself can give was met.
  for (const Reason reason : all_reasons()) {
    if (reason == Reason::kOwnCheck || reason == Reason::kOwnCheckFailed) continue;
    EXPECT_TRUE(has(seen, reason)) << name_of(reason);
  }
}

}  // namespace
}  // namespace trifinger::gpu
