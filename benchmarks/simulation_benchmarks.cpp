// SPDX-License-Identifier: BSD-3-Clause
#include <mujoco/mujoco.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <numbers>

#include "harness.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::benchmarks {
namespace {

constexpr TimeIndex kSimulationSteps = 8000;

// A slow motion of all joints around the initial pose. The tips stay clear of the table.
TriFinger::Action motion(const TriFinger::Observation& begin, TimeIndex t) {
  TriFinger::Action action = hold_position(begin);
  const double phase = 2.0 * std::numbers::pi * static_cast<double>(t) / 2000.0;
  for (double& position : action.position) position += 0.1 * std::sin(phase);
  return action;
}

}  // namespace

// Measures the safety chain alone. In its motion some checks act, and none ends in a fault.
std::vector<Row> safety_chain(const Effort& effort) {
  constexpr int kApplications = 200'000;
  const SafetyChain<TriFinger> chain(limits_of<TriFinger::kJoints>(default_limits({})));
  Samples samples;
  double sum = 0.0;
  for (int round = 0; round < effort.rounds; ++round) {
    SafetyState<TriFinger::kJoints> state;
    TriFinger::AppliedAction applied;
    TriFinger::Observation observation;
    TriFinger::Action action;
    const auto begin = Clock::now();
    for (int i = 0; i < kApplications; ++i) {
      // The joints move back and forth once a second, at 1 rad/s.
      observation.velocity.fill(i % 1000 < 500 ? 1.0 : -1.0);
      for (double& position : observation.position) position += 1e-3 * observation.velocity[0];
      action.torque.fill(i % 2 == 0 ? 0.4 : -0.1);
      const SafetyReport report = chain.apply(action, observation, kPeriod, state, applied);
      sum += applied.torque[0] + static_cast<double>(report.fault != SafetyFault::kNone);
    }
    samples.add(std::chrono::duration<double, std::nano>(Clock::now() - begin).count() /
                kApplications);
  }
  // The sum is used here, so that the compiler cannot remove the work.
  return {make_row("safety chain, nine joints", "ns", samples, "<= 300 ns",
                   samples.median() <= 300.0 && std::isfinite(sum))};
}

std::vector<Row> simulation(const Effort& effort) {
  const Simulation simulated;
  std::vector<TriFinger::Observation> observations;

  const auto frontend = [&] {
    auto robot = simulated.connect();
    // The action is made beforehand, because a policy's time does not count.
    const auto pose = robot.latest_observation();
    std::vector<TriFinger::Action> actions;
    for (TimeIndex t = 0; t <= kSimulationSteps; ++t) actions.push_back(motion(pose, t));

    const auto begin = Clock::now();
    TimeIndex t = robot.append_desired_action(actions.front());
    while (t < kSimulationSteps) {
      static_cast<void>(robot.get_observation(t));
      t = robot.append_desired_action(actions[static_cast<std::size_t>(t) + 1]);
    }
    const double time = std::chrono::duration<double>(Clock::now() - begin).count();
    observations.resize(static_cast<std::size_t>(kSimulationSteps));
    robot.get_observations(1, observations);
    robot.finish();
    return static_cast<double>(kSimulationSteps) / time;
  };

  const RobotModel model;
  const std::unique_ptr<mjData, decltype(&mj_deleteData)> data(mj_makeData(model.mujoco()),
                                                               &mj_deleteData);
  // Applies the same controls: the torques that the motors delivered above.
  const auto bare = [&] {
    mj_resetDataKeyframe(model.mujoco(), data.get(), 0);
    const auto begin = Clock::now();
    for (const TriFinger::Observation& y : observations) {
      std::ranges::copy(y.torque, data->ctrl);
      mj_step(model.mujoco(), data.get());
    }
    return static_cast<double>(kSimulationSteps) /
           std::chrono::duration<double>(Clock::now() - begin).count();
  };

  const Paired paired = alternate(effort.rounds, frontend, bare);
  Row row = make_row("simulated robot with cube, inline front-end", "steps/s", paired,
                     "bare mj_step of the same model and controls", ">= 0.9x and >= 60 k steps/s",
                     paired.ratio.median() >= 0.9 && paired.measure.median() >= 60000.0);
  const auto& last = observations.back();
  const bool is_same = std::equal(last.position.begin(), last.position.end(), data->qpos);
  row.remark =
      is_same ? "both end in the same state, bit for bit" : "the two end in different states";
  return {row};
}

}  // namespace trifinger::benchmarks
