// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include "trifinger/base/time.hpp"
#include "trifinger/guiding/guided_robot.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger::guiding {

/// What a guided robot does.
enum class Mode : std::uint8_t {
  kHold,        ///< Brakes and keeps its pose.
  kMoveJoints,  ///< Moves its joints to given positions.
  kMoveTip,     ///< Moves tips to given points. Fingers without a point keep their targets.
  kFloat,       ///< Carries its own weight, so that a hand can move it.
  kHome,        ///< Moves to its initial pose.
};
[[nodiscard]] std::string_view name_of(Mode mode) noexcept;

/// A setpoint of a guide: what the robot shall do. Only the members that belong to the mode count.
struct Setpoint {
  Mode mode{Mode::kHold};
  int finger{0};                                 ///< kMoveTip: the finger, from 0.
  Eigen::Vector3d tip{Eigen::Vector3d::Zero()};  ///< kMoveTip: the point in the world frame [m].
  JointValues joints{};                          ///< kMoveJoints: one position per joint [rad].
};

/// How fast and how stubbornly a guide moves.
struct GuideSpeeds {
  double joint_speed{1.0};         ///< Largest speed of a joint's reference [rad/s].
  double joint_acceleration{5.0};  ///< Largest acceleration of a reference on its way [rad/s^2].
  double tip_speed{0.15};          ///< Speed of a tip on its line [m/s].
  /// How far the reference of a joint may lead the measured position [rad]. Against an obstacle the
  /// reference waits at this distance.
  double max_lead{0.15};

  /// @throws InvalidArgument that names the value, what was found and what is allowed
  void validate() const;
};

/// The measured joints in one step.
struct MeasuredJoints {
  JointValues position;  ///< [rad]
  JointValues velocity;  ///< [rad/s]
};

/// What the guide asks of the joints in one step: `torque`, plus the robot's own position
/// controller where `position` is given.
struct GuideCommand {
  JointValues torque;    ///< [Nm]
  JointValues position;  ///< [rad]; NaN means "no position"
};

/// What is missing between a finger's last setpoint and its target.
struct Shortfall {
  Reach reach{Reach::kYes};  ///< Why the tip cannot get to the point.
  bool is_clamped{false};    ///< A joint's target was clamped to its soft limit.
};

/// Where a guided robot is and where it goes. Positions are one per joint [rad].
struct ControllerState {
  Mode mode{Mode::kHold};
  JointValues measured;   ///< The newest measurement that is a number.
  JointValues reference;  ///< Where the joints should be now; while floating, the measurement.
  JointValues target;     ///< Where the joints should end; while floating, the measurement.
  /// Joints are at their targets and at rest. Always false while floating.
  bool has_arrived{false};
  std::array<Shortfall, kMaxFingers> shortfalls{};
};

/// Turns setpoints and measurements into commands for joints. It knows no session and no thread,
/// and allocates memory only during construction.
///
/// What always holds:
/// - A reference begins at the measured pose: at `begin`, and after floating.
/// - Between two steps with references, each changes by at most `joint_speed` times the period,
///   and never goes beyond a soft limit, nor further beyond it.
/// - A reference moves away from the measured position only up to `max_lead`. If something moves
/// the
///   joint further away, the reference follows it as fast as it may.
/// - Commands are finite, whatever is measured, except for positions that are not given.
///
/// A tip goes to its point on a straight line, if all points of the line can be reached.
class GuideController {
 public:
  /// `period` is the length of a step.
  /// @throws InvalidArgument
  GuideController(const GuidedRobot& robot, const GuideSpeeds& speeds,
                  Nanoseconds period = std::chrono::milliseconds(1));

  /// Begins to hold the measured pose. Returns false, and does nothing, if a position is not a
  /// number. Before the first success, `accept` and `update` do nothing, and commands have no
  /// torque.
  [[nodiscard]] bool begin(const MeasuredJoints& measured) noexcept TRIFINGER_REALTIME;
  [[nodiscard]] bool has_begun() const noexcept { return has_begun_; }

  /// Takes a setpoint. Targets are clamped to soft limits; a tip that cannot get to its point goes
  /// near it. Returns false, and changes nothing, if the setpoint has numbers that are not finite,
  /// a wrong number of joints, or a finger that does not exist.
  [[nodiscard]] bool accept(const Setpoint& setpoint) noexcept TRIFINGER_REALTIME;

  /// Returns the command of the next step. A measurement that is not a number counts as the one
  /// before.
  [[nodiscard]] const GuideCommand& update(const MeasuredJoints& measured) noexcept
      TRIFINGER_REALTIME;

  [[nodiscard]] const ControllerState& state() const noexcept { return state_; }
  [[nodiscard]] const Kinematics& kinematics() const noexcept { return kinematics_; }
  [[nodiscard]] const GuidedRobot& robot() const noexcept { return robot_; }

 private:
  // The path of a tip to a point.
  struct Line {
    bool is_given{false};
    Eigen::Vector3d at{Eigen::Vector3d::Zero()};      // [m]
    Eigen::Vector3d end{Eigen::Vector3d::Zero()};     // [m]
    Eigen::Vector3d along{Eigen::Vector3d::Zero()};   // Unit vector, or zero before the first step.
    double speed{0.0};                                // [m/s]
    Eigen::Vector3d joints{Eigen::Vector3d::Zero()};  // Joints with the tip at `at` [rad].
    Eigen::Vector3d rates{Eigen::Vector3d::Zero()};   // Their change in the last step [rad/s].
  };

  [[nodiscard]] double max_speed(int joint) const noexcept;
  [[nodiscard]] double max_acceleration(int joint) const noexcept;
  [[nodiscard]] double inside(int joint, double position) const noexcept;
  [[nodiscard]] Eigen::Vector3d inside(int finger, const Eigen::Vector3d& joints) const noexcept;
  [[nodiscard]] Eigen::Vector3d tip_of(int finger, const JointValues& joints) const noexcept;
  void measure(const MeasuredJoints& measured) noexcept;
  void aim_at_rest() noexcept;
  void aim(const JointValues& target) noexcept;
  void aim_tip(int finger, const Eigen::Vector3d& tip) noexcept;
  void advance_line(int finger) noexcept;
  void advance(int joint, double goal, double rate) noexcept;
  void command_float() noexcept;
  void command_reference() noexcept;
  void find_arrival() noexcept;

  GuidedRobot robot_;
  GuideSpeeds speeds_;
  double period_;  // [s]
  Kinematics kinematics_;
  int joints_;
  ActuatorParameters actuator_;

  bool has_begun_{false};
  ControllerState state_;
  JointValues velocity_;            // Measured [rad/s].
  JointValues reference_velocity_;  // [rad/s]
  std::array<Line, kMaxFingers> lines_{};
  std::array<bool, kMaxJoints> is_held_back_{};  // The reference waits at `max_lead`.
  GuideCommand command_;
};

}  // namespace trifinger::guiding
