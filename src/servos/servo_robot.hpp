// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "dynamixel/motor_group.hpp"
#include "dynamixel/motor_link.hpp"
#include "joint/counted_driver.hpp"
#include "trifinger/base/text.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/joint/counted.hpp"

namespace trifinger::servos {

/// What a motor does with an action.
enum class ServoMode : std::uint8_t {
  /// It gives the torque that the safety chain has found, by its current.
  kTorque,
  /// It goes to the desired position by itself, with at most `max_current`. Torques and gains are
  /// refused. The observed torque of a motor without currents is NaN.
  kPosition,
};

/// A motor at a joint.
struct Servo {
  dynamixel::MotorId id{1};
  double direction{1.0};  ///< 1, or -1 for a motor that turns the other way.
  double ratio{1.0};      ///< Turn of the motor per turn [rad/rad] or way [rad/m] of the joint.
  double zero{0.0};       ///< Angle of the motor where its joint is at 0 [rad].
  double torque_constant{1.3};  ///< Torque of its shaft per ampere, behind its gear [Nm/A].
  const dynamixel::MotorModel* model{nullptr};  ///< What it must be; null: any known model.

  [[nodiscard]] constexpr double joint_position(double motor) const noexcept {
    return direction * (motor - zero) / ratio;
  }
  [[nodiscard]] constexpr double joint_velocity(double motor) const noexcept {
    return direction * motor / ratio;
  }
  [[nodiscard]] constexpr double motor_position(double joint) const noexcept {
    return direction * joint * ratio + zero;
  }
  /// Torque of the motor for a torque or force of the joint, and with `joint_torque` back.
  [[nodiscard]] constexpr double motor_torque(double joint) const noexcept {
    return direction * joint / ratio;
  }
  [[nodiscard]] constexpr double joint_torque(double motor) const noexcept {
    return direction * motor * ratio;
  }
};

/// How a robot goes to its initial position before a session, so that fingers that are entangled
/// come free. Times are those of a hand with light fingers.
struct ResetOptions {
  /// These joints go first, while all others have no torque. Empty: all go together.
  std::vector<std::size_t> first{};
  Nanoseconds first_time{std::chrono::seconds(1)};
  Nanoseconds move_time{std::chrono::seconds(1)};    ///< Then all go there in this time.
  Nanoseconds settle_time{std::chrono::seconds(1)};  ///< They may take so long to arrive.
  double tolerance{0.0873};                          ///< Arrived means this near [rad], [m].
  int attempts{3};  ///< How often to try again after the first time.
  /// Before another attempt all joints have no torque for `release_time`. Then these go to these
  /// positions in `first_time`, while the others have no torque.
  std::vector<std::pair<std::size_t, double>> untangle{};
  Nanoseconds release_time{std::chrono::milliseconds(750)};
};

/// The settings of a robot on Dynamixel motors. Its names are not empty; `all_joints` counts
/// `motors`, then `sensors`.
struct ServoRobotOptions : CountedDriverOptions {
  std::vector<Servo> motors{};  ///< The motor of each joint.
  /// Motors without torque that measure angles of other joints.
  std::vector<Servo> sensors{};
  /// Where the stops of these joints are [rad], [m]; empty, or nothing: a joint has none.
  std::vector<std::optional<std::array<double, 2>>> sensor_ranges{};
  ServoMode mode{ServoMode::kTorque};
  /// No motor ever gets more [A]. Infinite, in `ServoMode::kPosition` only: as much as its supply
  /// gives, which motors without currents need.
  double max_current{1.0};
  ResetOptions reset{};

  /// @throws InvalidArgument that names the option, the value found and the values allowed
  void validate() const;
};

/// The group of motors that such a robot needs: numbers, mode and largest current. The rest is as
/// in `rest`.
[[nodiscard]] dynamixel::MotorGroupOptions group_options(const ServoRobotOptions& options,
                                                         dynamixel::MotorGroupOptions rest = {});

/// Any robot on Dynamixel motors, with as many joints as it has, and with the same safety chain and
/// the same elements as the robot from its file in simulation.
///
/// Each motor must stay within one turn, -π to π, between the hard limits of its joint: a motor
/// that is switched on knows no more. So must a sensor between the stops of its joint, unless each
/// turn of it is whole turns of the joint, as at a valve; its angle is then known except for whole
/// turns.
///
/// `prepare` sets up the motors and goes to the initial position, unless the robot is there. After
/// a session torque is switched off. In between the loop uses the newest values of the bus, which
/// has a rate of its own: `DriverReport::measurement_age` says how old they are, `lost_frames` how
/// many answers of motors were lost.
///
/// In `ServoMode::kPosition` an action must not have a torque or gains; such joints hold their last
/// position, and the action counts as rejected. Goals move with at most `max_velocity`. A joint
/// without a position holds its last goal. The applied torque is then 0: the motor finds it.
class ServoRobot final : public CountedDriver {
 public:
  using Options = ServoRobotOptions;

  /// Fault codes in addition to those of the safety chain. Those with a joint have its number from
  /// 1 in the bits from 8 on.
  static constexpr std::int32_t kMotorFault = 64;  ///< A motor or the line; `fault_text` says what.
  static constexpr std::int32_t kNotAtStart = 96;  ///< A joint does not reach its initial position.

  /// `motors` are those of `group_options`.
  /// @throws InvalidArgument
  ServoRobot(Options options, std::unique_ptr<dynamixel::MotorLink> motors);
  ~ServoRobot() override;

  [[nodiscard]] const Options& options() const noexcept { return options_; }
  /// What was last seen of the motors. Call this only while nobody runs the robot.
  [[nodiscard]] const dynamixel::MotorSnapshot& motors() const noexcept { return snapshot_; }

  [[nodiscard]] DriverReport prepare(TimeIndex step) noexcept override;
  [[nodiscard]] DriverReport get_latest_observation(void* observation) noexcept override;
  [[nodiscard]] DriverReport apply_action(const void* desired, void* applied) noexcept override;
  [[nodiscard]] DriverReport stop(TimeIndex step) noexcept override;
  void cut() noexcept override { link_->cut(); }

 private:
  enum class Phase : std::uint8_t { kStarting, kFirst, kAll, kSettling, kReleased, kUntangling };

  // Takes what is new from the motors. False if they have failed; the text of the fault then says
  // why, and `code` is its code.
  [[nodiscard]] bool refresh(std::int32_t& code) noexcept;
  // Sets the observed torques of motors without currents.
  void set_unmeasured_torques(double torque) noexcept;
  [[nodiscard]] double distance(std::size_t joint) const noexcept;
  [[nodiscard]] std::optional<std::size_t> find_astray() const noexcept;
  void begin(Phase phase) noexcept;
  // One step of the way to the initial position.
  [[nodiscard]] DriverReport move() noexcept;
  [[nodiscard]] DriverReport drive_towards(double part) noexcept;
  [[nodiscard]] DriverReport try_again() noexcept;
  // Rejects what motors cannot do that follow positions, and says so in `refusal`.
  [[nodiscard]] bool refuse_torques(FixedText& refusal) noexcept;
  void send() noexcept;
  // Switches torque off.
  void release() noexcept;
  void limit_goal(std::size_t joint) noexcept;

  Options options_;
  std::unique_ptr<dynamixel::MotorLink> link_;
  dynamixel::MotorSnapshot snapshot_{};
  std::uint64_t request_{0};
  std::uint64_t lost_before_{0};  // answers lost before this session
  bool may_have_torque_{false};   // since the request to start; only a release takes it away
  bool is_running_{false};        // Motors have started, and the robot knows where they are.

  Phase phase_{Phase::kStarting};
  TimeIndex phase_steps_{0};
  int attempts_{0};
  PerJoint<double> begin_;   // of this phase
  PerJoint<double> target_;  // NaN: no torque
  PerJoint<double> goals_;   // of joints, in ServoMode::kPosition
  std::array<double, dynamixel::kMaxMotors> sent_{};
  CountedAction desired_;
};

}  // namespace trifinger::servos
