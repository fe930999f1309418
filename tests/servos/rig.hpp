// SPDX-License-Identifier: BSD-3-Clause
// A robot on emulated motors in simulated time, without threads.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dynamixel/emulated_bus.hpp"
#include "dynamixel/emulated_port.hpp"
#include "dynamixel/stepped_motors.hpp"
#include "servos/servo_robot.hpp"
#include "trifinger/joint/counted.hpp"
#include "trifinger/joint/types.hpp"

namespace trifinger::servos::test {

inline constexpr std::size_t kJoints = 9;

/// The elements of the robot as structs.
struct Claw : JointRobot<kJoints> {
  static constexpr std::string_view kType = "claw";
};

/// Shafts with inertia and friction, some of which may be blocked.
class Shafts final : public dynamixel::Plant {
 public:
  explicit Shafts(std::size_t count)
      : free_(count, {.inertia = 3e-3, .damping = 0.1, .dry_friction = 1e-3}),
        is_blocked(count, false) {}

  [[nodiscard]] double position(std::size_t motor) const noexcept override {
    return free_.position(motor);
  }
  [[nodiscard]] double velocity(std::size_t motor) const noexcept override {
    return is_blocked[motor] ? 0.0 : free_.velocity(motor);
  }
  void step(std::span<const double> torque, Nanoseconds duration) noexcept override {
    for (std::size_t i = 0; i < is_blocked.size(); ++i) before_[i] = free_.position(i);
    free_.step(torque, duration);
    for (std::size_t i = 0; i < is_blocked.size(); ++i) {
      if (is_blocked[i]) free_.set_position(i, before_[i]);
    }
  }
  void set_position(std::size_t motor, double position) { free_.set_position(motor, position); }

 private:
  dynamixel::InertiaPlant free_;
  std::array<double, dynamixel::kMaxMotors> before_{};

 public:
  std::vector<bool> is_blocked;
};

/// What a rig is made of.
struct RigOptions {
  ServoRobotOptions robot{};
  int baud{4'000'000};
  dynamixel::EmulatedBusOptions line{};
  dynamixel::MotorGroupOptions group{};
  Nanoseconds goal_timeout{std::chrono::milliseconds(50)};
};

/// Three fingers like those of D'Claw. Some motors turn the other way.
inline ServoRobotOptions claw_options() {
  ServoRobotOptions options;
  const std::array<JointKind, kJoints> kinds{};
  options.types = describe_counted("claw", kinds);
  for (std::size_t i = 0; i < kJoints; ++i) {
    const std::size_t id = 10 * (i / 3 + 1) + i % 3;
    options.names.push_back("J" + std::to_string(id));
    options.motors.push_back({.id = static_cast<dynamixel::MotorId>(id),
                              .direction = i == 4 ? -1.0 : 1.0,
                              .ratio = 1.0,
                              .zero = i % 3 == 0 ? -1.5 : 0.0});
    JointLimit limit;
    for (const JointLimitField& field : JointLimit::fields()) {
      if (field.may_be_infinite()) limit.*field.value = detail::kNoLimit;
    }
    limit.max_torque = 3.0;
    limit.safety_kd = 0.0;
    limit.soft_lower = -1.2;
    limit.soft_upper = 1.2;
    limit.hard_lower = -1.4;
    limit.hard_upper = 1.4;
    limit.default_kp = 2.0;
    limit.default_kd = 0.02;
    limit.max_kp = 5.0;
    limit.max_kd = 0.1;
    limit.max_velocity = 8.0;
    limit.braking = 100.0;
    options.limits.push_back(limit);
    options.initial_position.push_back(i % 3 == 0 ? 0.0 : i % 3 == 1 ? -1.0 : 1.0);
  }
  options.reset.first = {1, 4, 7};
  options.reset.untangle = {{0, 0.785}, {3, 0.785}, {6, 0.785}};
  return options;
}

/// The motors of a rig, with all that they need.
class RigMotors final : public dynamixel::MotorLink {
 public:
  explicit RigMotors(const RigOptions& options)
      : plant(options.robot.motors.size() + options.robot.sensors.size()),
        line(motors_of(options), plant, kBegin, options.line),
        port(new dynamixel::EmulatedPort(line, options.baud, kBegin)) {
    for (std::size_t i = 0; i < options.robot.motors.size(); ++i) {
      put(options, i, options.robot.initial_position[i]);
    }
    auto group = std::make_unique<dynamixel::MotorGroup>(
        std::unique_ptr<dynamixel::Port>(port), group_options(options.robot, options.group));
    motors_ = std::make_unique<dynamixel::SteppedMotors>(
        std::move(group), dynamixel::SteppedMotorsOptions{.step = options.robot.period,
                                                          .goal_timeout = options.goal_timeout});
  }
  bool read(dynamixel::MotorSnapshot& snapshot) noexcept override {
    return motors_->read(snapshot);
  }
  void set_goals(std::span<const double> goals) noexcept override { motors_->set_goals(goals); }
  std::uint64_t request_start() noexcept override { return motors_->request_start(); }
  std::uint64_t request_release() noexcept override { return motors_->request_release(); }
  void cut() noexcept override { motors_->cut(); }
  [[nodiscard]] Instant now() const noexcept override { return motors_->now(); }

  // Puts a joint somewhere.
  void put(const RigOptions& options, std::size_t joint, double position) {
    plant.set_position(joint, options.robot.motors[joint].motor_position(position));
  }

  Shafts plant;
  dynamixel::EmulatedBus line;
  dynamixel::EmulatedPort* port;  // its group owns it

 private:
  static constexpr Instant kBegin{std::chrono::seconds(1000)};

  static std::vector<dynamixel::EmulatedMotorOptions> motors_of(const RigOptions& options) {
    std::vector<dynamixel::EmulatedMotorOptions> motors;
    for (const auto* const servos : {&options.robot.motors, &options.robot.sensors}) {
      for (const Servo& servo : *servos) motors.push_back({.id = servo.id, .baud = options.baud});
    }
    return motors;
  }

  std::unique_ptr<dynamixel::SteppedMotors> motors_;
};

/// A robot on emulated motors, with the calls of a back-end.
class Rig {
 public:
  explicit Rig(RigOptions rig_options = {.robot = claw_options()})
      : options(std::move(rig_options)),
        owned_(std::make_unique<RigMotors>(options)),
        motors(*owned_),
        robot(options.robot, std::move(owned_)) {}

  [[nodiscard]] dynamixel::EmulatedMotor& motor(std::size_t joint) {
    return motors.line.motor(joint);
  }
  [[nodiscard]] std::int32_t value(std::size_t joint, const dynamixel::Register& which) {
    return motor(joint).value(which);
  }
  // Prepares until it is ready or has a fault, at most so many steps.
  DriverReport prepare(int most = 60'000) {
    DriverReport report = DriverReport::busy();
    for (steps = 0; report.state == DriverReport::State::kBusy && steps < most; ++steps) {
      report = robot.prepare(steps);
    }
    return report;
  }
  void begin() {
    const DriverReport report = prepare();
    ASSERT_EQ(report.state, DriverReport::State::kReady) << robot.fault_text(report.fault_code);
  }
  [[nodiscard]] DriverReport observe() { return robot.get_latest_observation(&observation); }
  [[nodiscard]] DriverReport apply(const Claw::Action& action) {
    return robot.apply_action(&action, &applied);
  }
  // One step of a session. False if it ends; `last` says why.
  bool step(const Claw::Action& action) {
    last = observe();
    if (last.state != DriverReport::State::kReady) return false;
    lost_frames = last.lost_frames;
    last = apply(action);
    return last.state == DriverReport::State::kReady;
  }
  [[nodiscard]] std::string fault() const { return std::string(robot.fault_text(last.fault_code)); }

  RigOptions options;

 private:
  std::unique_ptr<RigMotors> owned_;

 public:
  RigMotors& motors;
  ServoRobot robot;
  Claw::Observation observation{};
  Claw::AppliedAction applied{};
  DriverReport last{};
  std::uint32_t lost_frames{0};
  TimeIndex steps{0};
};

inline Claw::Action to_position(double position) {
  JointVector<kJoints> all{};
  all.fill(position);
  return Claw::Action::of_position(all);
}

}  // namespace trifinger::servos::test
