// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/teaching.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "trifinger/base/error.hpp"
#include "trifinger/manipulation/skills.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::evaluation {
namespace {

// Where the hands are at one step.
struct HandsAt {
  TipPositions position;  // [m]
  TipPositions velocity;  // [m/s]
};

// The forces at the tips that make `torques`: least squares, damped where a finger is stretched.
TipPositions forces_of(const JointMatrix& jacobians, const JointValues& torques) {
  constexpr double kDamping = 1e-4;
  const JointMatrix square = jacobians * jacobians.transpose() +
                             kDamping * JointMatrix::Identity(jacobians.rows(), jacobians.rows());
  return square.ldlt().solve(jacobians * torques);
}

std::vector<HandsAt> shown(const SkillTrial& trial, const manipulation::SkillContext& context,
                           const Hands& hands) {
  const Simulation simulation(trial.simulation);
  auto robot = simulation.connect();
  const auto skill = manipulation::make_skill(trial.skill, context, {}, trial.settings);
  Kinematics kinematics(trial.simulation.description);
  std::vector<HandsAt> path;
  const auto note = [&](TimeIndex t) {
    const TriFinger::Observation y = robot.get_observation(t);
    const auto applied = robot.get_applied_action(t);
    const JointValues velocity = joint_values(y.velocity);
    kinematics.update(joint_values(y.position));
    const JointMatrix jacobians = kinematics.tip_jacobians();
    const TipPositions force =
        forces_of(jacobians, joint_values(applied.torque) - kinematics.bias_torques(velocity));
    path.push_back({.position = kinematics.tip_positions() + force / hands.stiffness,
                    .velocity = jacobians * velocity});
  };
  const auto trace = manipulation::run_skill(robot, *skill, {.on_step = note});
  if (!trace.failure.empty())
    throw Error("'" + trial.skill + "' was not shown well: " + std::string(trace.failure));
  return path;
}

}  // namespace

manipulation::TaughtMotion taught(const SkillTrial& trial, const Hands& hands,
                                  control::Seconds interval) {
  const manipulation::SkillContext context{
      .description = trial.believed,
      .limits = manipulation::safety_limits_of(trial.simulation),
      .period = trial.simulation.period};
  const std::vector<HandsAt> path = shown(trial, context, hands);

  const Simulation simulation(trial.simulation);
  auto robot = simulation.connect();
  Kinematics kinematics(trial.simulation.description);
  const auto every =
      std::max<std::size_t>(static_cast<std::size_t>(std::lround(interval / context.period)), 1);
  manipulation::TaughtMotion motion{
      .interval = static_cast<double>(every) * context.period, .positions = {}, .torques = {}};
  TriFinger::Observation y = robot.latest_observation();
  for (std::size_t i = 0; i < path.size(); ++i) {
    const JointValues position = joint_values(y.position);
    const JointValues velocity = joint_values(y.velocity);
    kinematics.update(position);
    const JointMatrix jacobians = kinematics.tip_jacobians();
    const TipPositions force =
        hands.stiffness * (path[i].position - kinematics.tip_positions()) +
        hands.damping * (path[i].velocity - TipPositions(jacobians * velocity));
    const JointValues led = jacobians.transpose() * force;
    // Without its weight and what brakes it, a finger floats.
    const JointValues damping = JointValues::Map(context.limits.safety_kd.data(), kMaxJoints);
    const JointValues torque =
        led + kinematics.bias_torques(velocity) + damping.cwiseProduct(velocity);
    if (i % every == 0) {
      motion.positions.push_back(position);
      motion.torques.push_back(led);
    }
    TriFinger::Action action;
    JointValues::Map(action.torque.data(), kMaxJoints) = torque;
    y = robot.get_observation(robot.append_desired_action(action));
  }
  robot.finish();
  return motion;
}

}  // namespace trifinger::evaluation
