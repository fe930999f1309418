// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/guiding/guide_controller.hpp"
#include "trifinger/guiding/guided_robot.hpp"
#include "trifinger/ipc/fork.hpp"
#include "trifinger/realtime/thread.hpp"

namespace trifinger::guiding {

/// Settings of a guide.
struct GuideOptions {
  GuideSpeeds speeds{};
  /// The frames that can be moved to points: sites, bodies or geoms of the robot's model, at most
  /// `kMaxGuidedFrames`. Default: the ends of the robot, see `end_frames`.
  std::vector<std::string> frames{};
  /// What the guide's thread requests from the machine. Its priority is below that of back-ends.
  RealtimeOptions realtime{.demand = Demand::kTry,
                           .priority = 70,
                           .lock_memory = false,
                           .heap = 0,
                           .keep_cpus_awake = false};
  /// Waits of callers call this at least every 100 ms. It may throw to end the wait.
  std::function<void()> interrupt{};
};

/// Where a guided robot is and where it goes. Positions of joints are in rad, those of slides in m.
struct GuideState {
  TimeIndex step{-1};  ///< Step of the newest measurement; -1 before step 0.
  Mode mode{Mode::kHold};
  GuidedJoints joints;            ///< Measured positions.
  GuidedJoints reference_joints;  ///< Where the joints should be now.
  GuidedJoints target_joints;     ///< Where the joints should end.
  FramePoints frames;             ///< Points that follow from `joints` [m].
  FramePoints reference_frames;   ///< Points that follow from `reference_joints` [m].
  FramePoints target_frames;      ///< Points that follow from `target_joints` [m].
  /// The robot has reached all setpoints so far and rests at their target. Always false while
  /// floating.
  bool has_arrived{false};
  /// One sentence per frame or joint whose last setpoint cannot be reached: what is done instead,
  /// and why. For a point it comes up to tens of milliseconds after `mode`.
  std::string refusal;
};

/// Lets slow callers steer a robot that must hear from its controller every millisecond.
///
/// A thread of its own drives the robot in every step. It follows the newest setpoints of any
/// number of threads and never waits for them. The safety checks of the robot apply as always. At
/// first the robot holds the pose in which it is found.
///
/// Any thread may call any function at any time. After a fork only the parent's guide is usable: in
/// the child all functions throw InheritedHandle.
class Guide {
 public:
  /// Takes control of the robot `name`.
  /// @throws what `connect` throws; InvalidArgument if the robot is not in real-time mode, has no
  /// joints that are driven by torques and positions, has no configuration, or has no such frame
  explicit Guide(const std::string& name, GuideOptions options = {});
  /// Takes over `frontend`, which controls its robot.
  explicit Guide(UntypedFrontend frontend, GuideOptions options = {});
  /// Drives the robot of `frontend`, which others may use to read. Until the guide ends, nobody
  /// else may append actions. The interrupt of `frontend` must call `interrupt_guide`.
  explicit Guide(std::shared_ptr<UntypedFrontend> frontend, GuideOptions options = {});
  /// For a robot whose session has no configuration; the frames are those of `robot`.
  Guide(std::shared_ptr<UntypedFrontend> frontend, const GuidedRobot& robot,
        GuideOptions options = {});
  /// Ends the session at once, if it still runs, and releases the robot. Does not wait for a
  /// back-end that does not answer, nor for a robot that is still homing.
  ~Guide();

  [[nodiscard]] int num_joints() const noexcept;
  /// What is known of the robot: its model, limits and frames.
  [[nodiscard]] const GuidedRobot& robot() const noexcept;

  /// Moves a frame on a straight line to `position` in the world frame [m]. If the frame cannot get
  /// there, it goes near it: see `GuideState::refusal`. Joints of other frames keep their targets.
  ///
  /// A setpoint returns at once. It replaces earlier ones for the same frames and joints.
  /// @throws InvalidArgument for numbers that are not finite, a frame that does not exist, or after
  /// the end of the guide; otherwise what ended the guide
  void move_frame(int frame, const Eigen::Vector3d& position);
  /// `move_frame` for the tip of a finger.
  void move_tip(int finger, const Eigen::Vector3d& position) { move_frame(finger, position); }
  /// Moves all joints to `positions` [rad], [m]. Positions beyond soft limits are clamped: see
  /// `GuideState::refusal`.
  /// @throws like `move_frame`
  void move_joints(const GuidedJoints& positions);
  /// `move_joints` for one joint. The other joints keep their targets. If it moves a frame that is
  /// on its way to a point, this frame gives up its point, and so do frames that share joints with
  /// it.
  /// @throws like `move_frame`
  void move_joint(int joint, double position);
  /// Moves to the robot's initial pose.
  /// @throws like `move_frame`
  void home();
  /// Brakes and keeps the pose.
  /// @throws like `move_frame`
  void hold();
  /// Lets a hand move the robot: motors carry its weight and overcome the friction that its model
  /// knows. The robot's safety damping (`safety_kd`) still acts, and its soft limits
  /// push back.
  /// @throws like `move_frame`; InvalidArgument if the robot's motors refuse torques
  void float_freely();

  /// Returns where the robot is. Waits for the first measurement: a robot may first be homing.
  /// @throws what ended the guide before its first measurement, TimedOut
  [[nodiscard]] GuideState state(Timeout timeout = kForever) const;
  /// Waits until the robot rests at the target of all setpoints so far.
  /// @throws InvalidArgument if the robot floats, what ended the guide, TimedOut
  void wait_until_arrived(Timeout timeout = kForever) const;
  /// True until the guide has ended, for whatever reason.
  [[nodiscard]] bool is_running() const;
  /// Throws what ended the guide, if that was a fault.
  /// @throws RobotStopped, or another error of the guide's thread
  void check() const;

  /// Brakes, ends the session in an orderly way and waits for this. Does nothing more if the guide
  /// has ended.
  /// @throws what ended the guide, if that was a fault; TimedOut if the back-end does not answer:
  /// the guide has then ended, and its session may not have
  void finish(Timeout timeout = std::chrono::seconds(5));
  /// Ends the session at once, whatever other calls wait for; the robot then stops as its driver
  /// does. Faults are left to `check`.
  /// @throws TimedOut like `finish`
  void stop(Timeout timeout = std::chrono::seconds(2));

  /// The front-end of the robot, for reading.
  [[nodiscard]] const UntypedFrontend& frontend() const;
  /// What keeps the guide's thread from being a real-time thread: sentences with the remedies.
  [[nodiscard]] const std::vector<std::string>& realtime_warnings() const noexcept;

 private:
  class Implementation;
  [[nodiscard]] Implementation& own() const;

  ipc::ForkGuard fork_;
  std::unique_ptr<Implementation> implementation_;
};

/// Ends the waits of a guide's thread that shall end. The interrupt of a front-end that a guide
/// shares calls this first. Returns true in the thread of a guide, where nothing else may
/// interrupt.
[[nodiscard]] bool interrupt_guide();

}  // namespace trifinger::guiding
