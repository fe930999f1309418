// SPDX-License-Identifier: BSD-3-Clause
// A robot on emulated boards whose joints are a few equations, with a manual clock.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "boards/board_robot.hpp"
#include "boards/emulator.hpp"
#include "can/memory_bus.hpp"
#include "trifinger/realtime/clock.hpp"

namespace trifinger::boards::test {

/// Joints that know nothing of each other: inertia, friction, weight and two end stops each.
template <class R>
class Joints final : public Plant<R> {
 public:
  using Vector = JointVector<R::kJoints>;

  explicit Joints(const Vector& position) : position_(position) {
    for (std::size_t i = 0; i < R::kJoints; ++i) joint_of_motor[i] = i;
    sign_of_motor.fill(1.0);
  }

  [[nodiscard]] Vector position() const noexcept override { return position_; }
  [[nodiscard]] Vector velocity() const noexcept override { return velocity_; }
  [[nodiscard]] std::array<double, R::kTips> tip_force() const noexcept override {
    return tip_force_;
  }
  void step(const Vector& torque) noexcept override {
    constexpr double kStep = 1e-3;
    constexpr double kInertia = 2e-3;         // [kgm^2]
    constexpr double kDamping = 1e-3;         // [Nms/rad]
    constexpr double kStopStiffness = 200.0;  // [Nm/rad]
    constexpr double kStopDamping = 1.0;      // [Nms/rad]
    Vector driven{};
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      driven[joint_of_motor[i]] += sign_of_motor[i] * torque[i];
    }
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      double total =
          driven[i] + push[i] - kDamping * velocity_[i] + weight * std::sin(position_[i]);
      total -= friction * std::tanh(velocity_[i] / 0.003);
      double upper = upper_stop;
      if (i == 0 && leans_at) {
        if (position_[i] < *leans_at - 0.1) leans_at.reset();
        upper = leans_at.value_or(upper_stop);
      }
      const double beyond = position_[i] - std::clamp(position_[i], lower_stop, upper);
      if (beyond != 0.0) total -= kStopStiffness * beyond + kStopDamping * velocity_[i];
      velocity_[i] += kStep * total / kInertia;
      if (is_blocked) velocity_[i] = 0.0;
      position_[i] += kStep * velocity_[i];
    }
  }

  double lower_stop{-2.2};
  double upper_stop{2.1};
  double weight{0.05};   // [Nm]
  double friction{0.0};  // [Nm]
  bool is_blocked{false};
  // Something that joint 0 leans on, as on an end stop, until it has moved away [rad].
  std::optional<double> leans_at{};
  Vector push{};  // from outside [Nm]
  // Where the cables of the motors lead, and how they are connected.
  std::array<std::size_t, R::kJoints> joint_of_motor{};
  Vector sign_of_motor{};

 private:
  Vector position_;
  Vector velocity_{};
  std::array<double, R::kTips> tip_force_{};
};

template <class R>
BoardRobotOptions<R> options_of_tests() {
  BoardRobotOptions<R> options;
  for (std::size_t i = 0; i < R::kJoints; ++i)
    options.motors[i] = {.board = i / 2, .number = i % 2};
  if constexpr (R::kJoints == 9) options.motors = trifinger_motors();
  const std::size_t boards = R::kJoints == 9 ? 6 : (R::kJoints + 1) / 2;
  for (std::size_t i = 0; i < boards; ++i) options.names.push_back("can" + std::to_string(i));
  if constexpr (R::kTips == 3) options.tips = trifinger_tips();
  options.polarity.fill(1.0);
  for (JointLimit& limit : options.limits) {
    for (const JointLimitField& field : JointLimit::fields()) limit.*field.value = field.usual;
    limit.max_torque = 0.36;
    limit.continuous_torque = 0.32;
    limit.thermal_time = 30.0;
    limit.safety_kd = 0.09;
    limit.soft_lower = -1.5;
    limit.soft_upper = 1.5;
    limit.hard_lower = -1.8;
    limit.hard_upper = 1.8;
    limit.default_kp = 7.0;
    limit.default_kd = 0.02;
    limit.max_velocity = 5.0;
    limit.braking = 10.0;
    limit.stuck_torque = 0.18;
  }
  options.homing.torque.fill(0.22);
  options.homing.method = HomingMethod::kEndStop;
  options.homing.home_position.fill(2.1011);  // The stop gives way a little.
  options.initial_position.fill(0.3);
  options.move_time = std::chrono::seconds(1);
  options.stop.damping_time = std::chrono::milliseconds(50);
  return options;
}

/// The robot, its boards, and the buses in between.
template <class R>
class Rig {
 public:
  explicit Rig(const BoardRobotOptions<R>& options = options_of_tests<R>(),
               const typename Joints<R>::Vector& position = {})
      : joints(position) {
    std::vector<std::unique_ptr<can::Bus>> of_robot;
    std::vector<std::unique_ptr<can::Bus>> of_boards;
    for (std::size_t i = 0; i < options.names.size(); ++i) {
      buses.push_back(std::make_unique<can::MemoryBus>(clock));
      of_robot.push_back(buses.back()->connect());
      of_boards.push_back(buses.back()->connect());
    }
    emulator.emplace(options, std::move(of_boards), joints, clock.now(),
                     EmulatedBoardOptions{.alignment_time = std::chrono::milliseconds(300)});
    robot.emplace(options, std::move(of_robot), clock);
  }

  /// The boards' millisecond.
  void pass() {
    clock.advance(std::chrono::milliseconds(1));
    emulator->tick(clock.now());
  }

  /// Prepares until the robot is ready or at fault; busy if it takes too long.
  DriverReport prepare(int most = 60'000) {
    DriverReport report = DriverReport::busy();
    for (TimeIndex step = 0; step < most && report.state == DriverReport::State::kBusy; ++step) {
      pass();
      report = robot->prepare(step);
    }
    return report;
  }

  /// One step with this action. Returns the report at fault, or that of the action.
  DriverReport step(const typename R::Action& action) {
    pass();
    const DriverReport measured = robot->get_latest_observation(observation);
    if (measured.state != DriverReport::State::kReady) return measured;
    DriverReport report = robot->apply_action(action, applied);
    report.measurement_age = measured.measurement_age;
    report.lost_frames = measured.lost_frames;
    return report;
  }

  ManualClock clock;
  Joints<R> joints;
  std::vector<std::unique_ptr<can::MemoryBus>> buses;
  std::optional<Emulator<R>> emulator;
  std::optional<BoardRobot<R>> robot;
  typename R::Observation observation{};
  typename R::AppliedAction applied{};
};

}  // namespace trifinger::boards::test
