// SPDX-License-Identifier: BSD-3-Clause
// A robot on emulated boards whose joints are a few equations, with a manual clock.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "boards/board_robot.hpp"
#include "boards/emulator.hpp"
#include "can/memory_bus.hpp"
#include "trifinger/core/description.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/realtime/clock.hpp"

namespace trifinger::boards::test {

/// A test rig of one joint.
struct OneJoint : JointRobot<1> {
  static constexpr std::string_view kType = "one_joint";
};

/// A test rig of two joints on one board.
struct TwoJoints : JointRobot<2> {
  static constexpr std::string_view kType = "two_joints";
};

/// An element of the companion "wear" of a robot with N joints.
template <std::size_t N>
struct WearElement {
  Stamp stamp;
  std::uint64_t starts{0};
  std::uint64_t homings{0};
  std::uint64_t faults{0};
  JointVector<N> powered_time{};
  JointVector<N> revolutions{};
  JointVector<N> work{};
  JointVector<N> squared_current{};
  std::array<std::uint64_t, N> index_slips{};

  static constexpr auto fields() {
    return std::tuple{field("stamp", &WearElement::stamp),
                      field("starts", &WearElement::starts),
                      field("homings", &WearElement::homings),
                      field("faults", &WearElement::faults),
                      field("powered_time", &WearElement::powered_time, "s"),
                      field("revolutions", &WearElement::revolutions),
                      field("work", &WearElement::work, "J"),
                      field("squared_current", &WearElement::squared_current, "A^2s"),
                      field("index_slips", &WearElement::index_slips)};
  }
};

/// Joints that know nothing of each other: inertia, friction, weight and two end stops each.
template <class R>
class Joints final : public Plant {
 public:
  using Vector = JointVector<R::kJoints>;

  explicit Joints(const Vector& position) : position_(position) {
    for (std::size_t i = 0; i < R::kJoints; ++i) joint_of_motor[i] = i;
    sign_of_motor.fill(1.0);
  }

  [[nodiscard]] std::span<const double> position() const noexcept override { return position_; }
  [[nodiscard]] std::span<const double> velocity() const noexcept override { return velocity_; }
  [[nodiscard]] std::span<const double> tip_force() const noexcept override { return tip_force_; }
  void step(std::span<const double> torque) noexcept override {
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

/// The wiring of the original robots: finger k has boards 2k and 2k+1, which drive its middle and
/// lower joint, and its upper joint. Its tip is input A of board 2k.
inline Terminal trifinger_motor(std::size_t joint) {
  const std::size_t finger = joint / 3;
  return joint % 3 == 0 ? Terminal{.board = 2 * finger + 1, .number = 0}
                        : Terminal{.board = 2 * finger, .number = joint % 3 - 1};
}

template <class R>
BoardRobotOptions options_of_tests() {
  BoardRobotOptions options;
  options.types = describe_robot<R>();
  options.names.resize(R::kJoints);
  options.num_tips = R::kTips;
  const bool is_trifinger = R::kJoints == 9;
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    options.motors.push_back(
        {.place = is_trifinger ? trifinger_motor(i) : Terminal{.board = i / 2, .number = i % 2},
         // The stop gives way a little.
         .homing = {.method = HomingMethod::kEndStop, .torque = 0.22, .home_position = 2.1011}});
  }
  const std::size_t boards = is_trifinger ? 6 : (R::kJoints + 1) / 2;
  for (std::size_t i = 0; i < boards; ++i) options.interfaces.push_back("can" + std::to_string(i));
  for (std::size_t i = 0; i < R::kTips; ++i) options.tips.push_back({.board = 2 * i});
  options.limits.resize(R::kJoints);
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
  options.initial_position.assign(R::kJoints, 0.3);
  options.move_time = std::chrono::seconds(1);
  options.stop.damping_time = std::chrono::milliseconds(50);
  return options;
}

inline void set_method(BoardRobotOptions& options, HomingMethod method) {
  for (BoardMotor& motor : options.motors) motor.homing.method = method;
}

inline void set_home_position(BoardRobotOptions& options, double position) {
  for (BoardMotor& motor : options.motors) motor.homing.home_position = position;
}

/// The robot, its boards, and the buses in between.
template <class R>
class Rig {
 public:
  explicit Rig(const BoardRobotOptions& options = options_of_tests<R>(),
               const typename Joints<R>::Vector& position = {})
      : joints(position) {
    std::vector<std::unique_ptr<can::Bus>> of_robot;
    std::vector<std::unique_ptr<can::Bus>> of_boards;
    for (std::size_t i = 0; i < options.interfaces.size(); ++i) {
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
    const DriverReport measured = robot->get_latest_observation(&observation);
    if (measured.state != DriverReport::State::kReady) return measured;
    DriverReport report = robot->apply_action(&action, &applied);
    report.measurement_age = measured.measurement_age;
    report.lost_frames = measured.lost_frames;
    return report;
  }

  ManualClock clock;
  Joints<R> joints;
  std::vector<std::unique_ptr<can::MemoryBus>> buses;
  std::optional<Emulator> emulator;
  std::optional<BoardRobot> robot;
  typename R::Observation observation{};
  typename R::AppliedAction applied{};
};

}  // namespace trifinger::boards::test
