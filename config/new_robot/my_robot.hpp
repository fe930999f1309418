// SPDX-License-Identifier: BSD-3-Clause
// The robot my_robot: its joints, its motors and its driver. All that is special about it is here
// and in my_robot.yml. FILL_IN marks what you replace.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/base/text.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/joint/read_backend.hpp"
#include "trifinger/joint/read_limits.hpp"
#include "trifinger/joint/safety.hpp"
#include "trifinger/joint/types.hpp"

// What programs know about this robot. As for every robot with joints, an action has `torque`,
// `position`, `position_kp` and `position_kd`; an observation has `position`, `velocity` and
// `torque`. FILL_IN: the number of its joints.
struct MyRobot : trifinger::JointRobot<2> {
  static constexpr std::string_view kType = "my_robot";
  // FILL_IN: their names, in the order of the values above. my_robot.yml uses them, too.
  static constexpr std::array<std::string_view, kJoints> kJointNames{"shoulder", "elbow"};
};

using MyRobotJoints = trifinger::JointVector<MyRobot::kJoints>;

// What my_robot.yml says.
struct MyRobotConfig {
  std::string name;  // of the session: `trifinger status NAME`
  trifinger::JointLimits<MyRobot::kJoints> limits;
  trifinger::BackendOptions backend;
  trifinger::SessionOptions session;

  // Throws trifinger::Error that names the line of the file.
  static MyRobotConfig load(const std::string& path) {
    const auto file = trifinger::config::File::load(path);
    MyRobotConfig config;
    config.name = file.root().required<std::string>("name");
    std::vector<trifinger::NamedJoint> joints;
    for (const auto name : MyRobot::kJointNames) joints.push_back({.name = std::string(name)});
    const auto limits = trifinger::read_limits_by_name(file.root(), joints);
    for (std::size_t i = 0; i < limits.size(); ++i) config.limits[i] = limits[i];
    config.backend = trifinger::read_backend(file.root().section("backend"), config.session);
    file.reject_unknown_keys();
    // Logs keep the configuration with the session.
    config.session.documents = {{"configuration.yml", "application/yaml", file.text()}};
    return config;
  }
};

// The motors. Those here only exist in memory, so that everything runs before your hardware does.
// FILL_IN: talk to your bus. `read` and `write` are called once per period, in the thread that
// keeps time: they must not wait, print, allocate or throw.
class MyRobotMotors {
 public:
  // FILL_IN: open the bus; throw trifinger::Error with a sentence if that fails.
  explicit MyRobotMotors(trifinger::Nanoseconds period)
      : period_(std::chrono::duration<double>(period).count()) {}

  // Gets the newest measurements [rad], [rad/s]. False if the motors are silent.
  [[nodiscard]] bool read(MyRobotJoints& position, MyRobotJoints& velocity) noexcept {
    position = position_;
    velocity = velocity_;
    return true;
  }

  // Sets the torques of the motors [Nm]. False if the motors are silent.
  [[nodiscard]] bool write(const MyRobotJoints& torque) noexcept {
    constexpr double kInertia = 0.01;   // [kgm^2]
    constexpr double kFriction = 0.05;  // [Nms/rad]
    for (std::size_t i = 0; i < torque.size(); ++i) {
      velocity_[i] += (torque[i] - kFriction * velocity_[i]) / kInertia * period_;
      position_[i] += velocity_[i] * period_;
    }
    return true;
  }

  // Cuts the power. Another thread calls it if one of the functions above hangs.
  void cut() noexcept {}

 private:
  double period_;
  MyRobotJoints position_{};
  MyRobotJoints velocity_{};
};

// Puts the safety chain between what users ask for and the motors.
class MyRobotDriver final : public trifinger::Driver<MyRobot> {
 public:
  // Faults of this driver, in addition to those of the safety chain: 64 and above.
  static constexpr std::int32_t kSilent = 64;

  explicit MyRobotDriver(const MyRobotConfig& config)
      : period_(config.backend.period), safety_(config.limits), motors_(config.backend.period) {}

  using Driver::apply_action;
  using Driver::get_latest_observation;
  using Driver::hold;

  // Called once per period before a session begins, until it returns ready(). FILL_IN: if your
  // robot has to home first, do a step of it here and return busy().
  [[nodiscard]] trifinger::DriverReport prepare(trifinger::TimeIndex) noexcept override {
    memory_ = {};
    torque_ = {};
    return trifinger::DriverReport::ready();
  }

  [[nodiscard]] trifinger::DriverReport get_latest_observation(
      Observation& observation) noexcept override {
    if (!motors_.read(observation_.position, observation_.velocity)) return silent();
    observation_.torque = torque_;  // FILL_IN: the measured torque, if your motors measure it
    observation = observation_;
    return trifinger::DriverReport::ready();
  }

  [[nodiscard]] trifinger::DriverReport apply_action(const Action& desired,
                                                     AppliedAction& applied) noexcept override {
    const auto report = safety_.apply(desired, observation_, period_, memory_, applied, &thrown_);
    torque_ = applied.torque;  // After a fault these only brake.
    if (!motors_.write(torque_)) return silent();
    if (report.fault == trifinger::SafetyFault::kInterrupted) {
      return trifinger::DriverReport::interrupted();
    }
    if (report.fault != trifinger::SafetyFault::kNone) {
      fault_text_ = report.fault == trifinger::SafetyFault::kOwnCheck
                        ? thrown_
                        : trifinger::describe(report, name_of(report.joint));
      return trifinger::DriverReport::fault(trifinger::fault_code_of(report));
    }
    if (report.action_rejected) {
      const auto rejected = safety_.find_rejected(desired, applied);
      rejection_text_ = trifinger::describe(rejected, MyRobot::kJointNames[rejected.joint],
                                            safety_.limits()[rejected.joint]);
    }
    return {.action_rejected = report.action_rejected};
  }

  // What the robot does before the first action of a user: it keeps its pose. FILL_IN: add the
  // torques that carry its weight, if it would sink.
  [[nodiscard]] trifinger::DriverReport hold(const Observation& observation,
                                             Action& action) noexcept override {
    action = trifinger::hold_position(observation);
    return trifinger::DriverReport::ready();
  }

  // Called once per period after a session, until it returns ready(). FILL_IN: bring the robot to
  // rest. Here the joints are damped for half a second.
  [[nodiscard]] trifinger::DriverReport stop(trifinger::TimeIndex step) noexcept override {
    const bool is_over = step * period_ >= std::chrono::milliseconds(500);
    for (std::size_t i = 0; i < torque_.size(); ++i) {
      const trifinger::JointLimit& limit = safety_.limits()[i];
      const double velocity = is_over ? 0.0 : observation_.velocity[i];
      torque_[i] = trifinger::limit_torque(0.0, velocity, limit.max_torque, limit).torque;
    }
    if (!motors_.write(torque_)) return silent();
    return is_over ? trifinger::DriverReport::ready() : trifinger::DriverReport::busy();
  }

  void cut() noexcept override { motors_.cut(); }

  [[nodiscard]] std::string_view fault_text(std::int32_t) const noexcept override {
    return fault_text_.view();
  }
  [[nodiscard]] std::string_view rejection_text() const noexcept override {
    return rejection_text_.view();
  }

 private:
  [[nodiscard]] trifinger::DriverReport silent() noexcept {
    fault_text_ = trifinger::FixedText("the motors are silent");
    return trifinger::DriverReport::fault(kSilent);
  }
  [[nodiscard]] static std::string_view name_of(std::int32_t joint) noexcept {
    return joint < 0 ? std::string_view() : MyRobot::kJointNames[static_cast<std::size_t>(joint)];
  }

  trifinger::Nanoseconds period_;
  trifinger::SafetyChain<MyRobot> safety_;
  MyRobotMotors motors_;

  trifinger::SafetyState<MyRobot::kJoints> memory_;
  Observation observation_;
  MyRobotJoints torque_{};
  trifinger::FixedText fault_text_;
  trifinger::FixedText rejection_text_;
  trifinger::FixedText thrown_;
};
