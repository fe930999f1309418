// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <chrono>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string_view>

#include "trifinger/base/time.hpp"
#include "trifinger/guiding/guided_robot.hpp"
#include "trifinger/realtime/annotations.hpp"

namespace trifinger::guiding {

namespace detail {
class FrameKinematics;
}

/// What a guided robot does.
enum class Mode : std::uint8_t {
  kHold,        ///< Brakes and keeps its pose.
  kMoveJoints,  ///< Moves its joints to given positions.
  kMoveFrame,   ///< Moves frames to given points. Joints of other frames keep their targets.
  kFloat,       ///< Carries its own weight, so that a hand can move it.
  kHome,        ///< Moves to its initial pose.
};
[[nodiscard]] std::string_view name_of(Mode mode) noexcept;

/// A setpoint of a guide: what the robot shall do. Only the members that belong to the mode count.
struct Setpoint {
  Mode mode{Mode::kHold};
  int frame{0};  ///< kMoveFrame: the frame, from 0.
  /// kMoveFrame: its point in the world frame [m].
  Eigen::Vector3d point{Eigen::Vector3d::Zero()};
  /// kMoveJoints: one position per joint [rad], [m]; NaN: the joint keeps its target.
  GuidedJoints joints{};
};

/// How fast and how stubbornly a guide moves. For a joint that slides, 0.1 m counts as 1 rad.
struct GuideSpeeds {
  double joint_speed{1.0};         ///< Largest speed of a joint's reference [rad/s].
  double joint_acceleration{5.0};  ///< Largest acceleration of a reference on its way [rad/s^2].
  double tip_speed{0.15};          ///< Speed of a tip, or another frame, on its line [m/s].
  /// How far the reference of a joint may lead the measured position [rad]. Against an obstacle the
  /// reference waits at this distance.
  double max_lead{0.15};

  /// @throws InvalidArgument that names the value, what was found and what is allowed
  void validate() const;
};

/// The measured joints in one step.
struct MeasuredJoints {
  GuidedJoints position;  ///< [rad], [m]
  GuidedJoints velocity;  ///< [rad/s], [m/s]
  /// Positions of all hinges and slides of the model, also of those that no motor drives, if
  /// somebody measures them. They are read during the call only.
  std::span<const double> all{};
};

/// What the guide asks of the joints in one step: `torque`, plus the robot's own position
/// controller where `position` is given. A robot that refuses torques gets none.
struct GuideCommand {
  GuidedJoints torque;    ///< [Nm], [N]
  GuidedJoints position;  ///< [rad], [m]; NaN means "no position"
};

/// Where a guided robot is and where it goes. Positions are one per joint [rad], [m].
struct ControllerState {
  Mode mode{Mode::kHold};
  GuidedJoints measured;   ///< The newest measurement that is a number.
  GuidedJoints reference;  ///< Where the joints should be now; while floating, the measurement.
  /// Where the joints should end; while floating, the measurement. For points it is computed in the
  /// steps after the setpoint, tens of milliseconds at most.
  GuidedJoints target;
  FramePoints measured_frames;   ///< Points that follow from `measured` [m].
  FramePoints reference_frames;  ///< Points that follow from `reference` [m].
  FramePoints target_frames;     ///< Points that follow from `target` [m].
  /// Joints are at their targets and at rest. Motors that refuse torques sag under their load, so
  /// they may rest up to `GuideSpeeds::max_lead` away. Always false while floating.
  bool has_arrived{false};
  /// Distance that will remain between each frame and its last point [m]; 0: it gets there.
  std::array<double, kMaxGuidedFrames> missing{};
  /// The last target of a joint was clamped to its soft limit.
  std::array<bool, kMaxCountedJoints> is_clamped{};
};

/// Turns setpoints and measurements into commands for joints. It knows no session and no thread,
/// and allocates memory only during construction.
///
/// What always holds:
/// - A reference begins at the measured pose: at `begin`, and after floating.
/// - Between two steps with references, each changes by at most `joint_speed` times the period,
///   and never goes beyond a soft limit, nor further beyond it.
/// - A reference moves away from the measured position only up to `max_lead`. If something moves
///   the joint further away, the reference follows it as fast as it may.
/// - Commands are finite, whatever is measured, except for positions that are not given.
///
/// A frame goes to its point on a straight line, if all points of the line can be reached. Its
/// joints follow by damped least squares. Frames that share joints go to their points together, or
/// near them if not all can be reached. Where the line ends in no posture near to its beginning, a
/// tip of a TriFinger changes its posture, and any other frame goes near its point.
class GuideController {
 public:
  /// `period` is the length of a step.
  /// @throws InvalidArgument
  GuideController(const GuidedRobot& robot, const GuideSpeeds& speeds,
                  Nanoseconds period = std::chrono::milliseconds(1));
  ~GuideController();

  /// Begins to hold the measured pose. Returns false, and does nothing, if a position is not a
  /// number. Before the first success, `accept` and `update` do nothing, and commands have no
  /// torque.
  [[nodiscard]] bool begin(const MeasuredJoints& measured) noexcept TRIFINGER_REALTIME;
  [[nodiscard]] bool has_begun() const noexcept { return has_begun_; }

  /// Takes a setpoint. Targets are clamped to soft limits; a frame that cannot get to its point
  /// goes near it. Returns false, and changes nothing, if the setpoint has numbers that are not
  /// finite, a wrong number of joints, or a frame that does not exist, or if a robot that refuses
  /// torques shall float.
  [[nodiscard]] bool accept(const Setpoint& setpoint) noexcept TRIFINGER_REALTIME;

  /// Returns the command of the next step. A measurement that is not a number counts as the one
  /// before.
  [[nodiscard]] const GuideCommand& update(const MeasuredJoints& measured) noexcept
      TRIFINGER_REALTIME;

  [[nodiscard]] const ControllerState& state() const noexcept { return state_; }
  [[nodiscard]] const GuidedRobot& robot() const noexcept { return robot_; }

 private:
  // The path of a frame to a point.
  struct Line {
    bool is_given{false};
    Eigen::Vector3d at{Eigen::Vector3d::Zero()};     // [m]
    Eigen::Vector3d end{Eigen::Vector3d::Zero()};    // [m]
    Eigen::Vector3d along{Eigen::Vector3d::Zero()};  // Unit vector, or zero before the first step.
    double speed{0.0};                               // [m/s]
    // The search for the target goes ahead on the line.
    bool is_found{false};
    Eigen::Vector3d ahead{Eigen::Vector3d::Zero()};  // [m]

    [[nodiscard]] bool is_at_end() const noexcept { return is_found && at == end; }
  };

  // The search for the joints with which the frames of a group are at the ends of their lines,
  // since it is there.
  struct Search {
    int steps{0};
    int stuck_steps{0};                                       // that brought hardly anything
    double nearest{std::numeric_limits<double>::infinity()};  // in the last step [m]
  };

  [[nodiscard]] bool can_accept(const Setpoint& setpoint) const noexcept;
  [[nodiscard]] double radian(int joint) const noexcept;
  [[nodiscard]] double max_speed(int joint) const noexcept;
  [[nodiscard]] double max_acceleration(int joint) const noexcept;
  [[nodiscard]] double inside(int joint, double position) const noexcept;
  [[nodiscard]] const JointLimit& limit(int joint) const noexcept;
  void measure(const MeasuredJoints& measured) noexcept;
  [[nodiscard]] double rest(int joint) const noexcept;
  void aim_at_rest() noexcept;
  void aim(const GuidedJoints& target) noexcept;
  void aim_frame(int frame, const Eigen::Vector3d& point) noexcept;
  void begin_line(int frame) noexcept;
  void forget_lines(int group) noexcept;
  void search(int group) noexcept;
  void go_ahead(int frame) noexcept;
  void end_search(int group) noexcept;
  void advance_lines() noexcept;
  void advance_line(int frame) noexcept;
  [[nodiscard]] bool is_at_end(int frame) const noexcept;
  void advance(int joint, double goal, double rate) noexcept;
  void command_float() noexcept;
  void command_reference() noexcept;
  void find_arrival() noexcept;
  void find_frames() noexcept;

  GuidedRobot robot_;
  GuideSpeeds speeds_;
  double period_;  // [s]
  std::unique_ptr<detail::FrameKinematics> kinematics_;
  int joints_;
  int frames_;

  bool has_begun_{false};
  double rest_time_{0.0};  // for how long all joints have been slow, since the last setpoint [s]
  ControllerState state_;
  GuidedJoints velocity_;            // Measured [rad/s].
  GuidedJoints reference_velocity_;  // [rad/s]
  std::array<Line, kMaxGuidedFrames> lines_{};
  std::array<Search, kMaxGuidedFrames> searches_{};     // of groups, by their first frame
  GuidedJoints path_;                                   // Joints with the frames on their lines.
  GuidedJoints path_rates_;                             // Their change in the last step [rad/s].
  std::array<bool, kMaxCountedJoints> is_led_{};        // by a line
  std::array<bool, kMaxCountedJoints> is_held_back_{};  // The reference waits at `max_lead`.
  GuideCommand command_;
};

}  // namespace trifinger::guiding
