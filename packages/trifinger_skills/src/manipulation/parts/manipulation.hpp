// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "manipulation/parts/phased.hpp"
#include "manipulation/parts/pose_average.hpp"
#include "manipulation/parts/task.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/control/grasp_controller.hpp"
#include "trifinger/control/pose_estimator.hpp"
#include "trifinger/manipulation/skill.hpp"

namespace trifinger::manipulation {

// What a manipulation is doing.
enum class Phase : std::uint8_t {
  kLook,     // Averages poses of the resting object.
  kPlan,     // Waits for a plan, which the caller gives to `begin`.
  kGrasp,    // Goes to the object and closes the fingers on it.
  kLead,     // Brings the object to where the task begins.
  kFollow,   // Leads the object along its line or circle.
  kHold,     // Holds the object at the end.
  kLower,    // Puts the object down.
  kRelease,  // Releases the object.
  kDone,     // The object is at its target and released.
  kFailed,   // The task has failed; `Manipulation::failure` says why.
};
[[nodiscard]] std::string_view name_of(Phase phase) noexcept;

// Why a manipulation has failed, if others ask.
inline constexpr std::string_view kLost = "the object got lost";  // As often as allowed.
inline constexpr std::string_view kStopped = "it was stopped";

// The paper's first experiment, from looking for the object until it is released. If the object
// gets lost on the way, the experiment starts again.
//
// It does not use a session: once per step it gets the measurements of joints and cameras, and
// returns the torques to apply. Poses of the object may be few, noisy and late. Planning takes
// longer than a step, so the caller does it. When the phase is kPlan, make a plan for
// `resting_pose()` and give it to `begin`. Until then the tips stay where they are. Memory is
// allocated only during construction.
class Manipulation : public Phased<Manipulation, Phase, NoSkill> {
 public:
  // `period` is the length of a step.
  // Throws InvalidArgument
  Manipulation(const RobotDescription& description, const GraspingConfig& config,
               Seconds period = Seconds(1e-3));

  // Says that the object was at `pose` at step `captured`. Call it before the `update` of the step
  // at which the pose arrives. A pose that is not newer than the previous one, or more than a
  // thousand steps old, is ignored.
  void see(TimeIndex captured, const Pose& pose) noexcept;

  // Says that the upright object rests at `pose`: nobody has to look. Only in the phase kLook.
  void rest_at(const Pose& pose) noexcept;

  // Returns the torques for the next step [Nm] from the measurements of the joints at `step`.
  [[nodiscard]] const JointValues& update(TimeIndex step,
                                          const control::JointState& joints) noexcept;

  // The pose of the resting object, for a plan.
  [[nodiscard]] const Pose& resting_pose() const noexcept { return rest_; }
  // Continues with `plan`; fails if it is empty. Only in the phase kPlan.
  void begin(const std::optional<Plan>& plan) noexcept;

  // Begins anew with a look at `step`, after it has ended or instead of a plan. Any number of
  // steps may have passed without an `update`.
  void begin_again(TimeIndex step) noexcept;

  // Puts the object down where it is, releases it, and fails.
  void stop() noexcept;

  // False if the object is held and was not seen for 0.3 s. Its motion is then the one that the
  // tips feel.
  [[nodiscard]] bool is_visible() const noexcept;

  [[nodiscard]] Phase phase() const noexcept { return phase_; }
  [[nodiscard]] bool has_ended() const noexcept {
    return phase_ == Phase::kDone || phase_ == Phase::kFailed;
  }
  // In words; empty if it has not failed.
  [[nodiscard]] std::string_view failure() const noexcept { return failure_; }
  // Number of grasps begun so far.
  [[nodiscard]] int grasps() const noexcept { return grasps_; }
  // The desired motion of the object at the last step.
  [[nodiscard]] const Motion& desired() const noexcept { return desired_; }
  // The estimated motion of the object.
  [[nodiscard]] const Motion& object() const noexcept { return object_; }
  [[nodiscard]] const control::GraspState& grasp() const noexcept { return controller_.state(); }
  // The current plan, if there is one.
  [[nodiscard]] const std::optional<Plan>& plan() const noexcept { return plan_; }

 private:
  using M = Manipulation;
  using enum Phase;
  friend Phased;
  static const std::array<Row, 10> kPhases;
  friend std::string_view name_of(Phase phase) noexcept;

  void fail(std::string_view failure) noexcept;
  void take_pose() noexcept;
  void feel() noexcept;
  [[nodiscard]] Pose carried(const Pose& pose, const Pose& felt) const noexcept;
  void look_again() noexcept;
  void look(Seconds elapsed) noexcept;
  void finish_look() noexcept;
  [[nodiscard]] bool holds() const noexcept {
    return controller_.state().phase == control::GraspPhase::kHold;
  }
  void begin_trajectory() noexcept { trajectory_begin_ = clock_.step(); }
  [[nodiscard]] Seconds trajectory_time() const noexcept {
    return clock_.time_of(clock_.step() - trajectory_begin_);
  }
  void follow_trajectory(Seconds elapsed) noexcept;
  void give_up(std::string_view failure) noexcept;
  void note_failure(std::string_view failure) noexcept { next_failure_ = failure; }
  void release(std::string_view failure) noexcept;
  void finish_release(Seconds elapsed) noexcept;
  void set_desired() noexcept;

  // What is kept of each step for poses that arrive late.
  struct Remembered {
    Motion desired{};
    Pose felt{};  // Where the tips have felt the object move, from anywhere.
  };
  static constexpr std::size_t kMemory = 1024;
  [[nodiscard]] const Remembered& memory_at(TimeIndex step) const noexcept;

  Seconds look_time_;
  int max_grasps_;
  Eigen::Vector3d half_size_;  // Half of the object's edges [m].
  control::GraspController controller_;
  control::PoseEstimator estimator_;
  double error_gain_;  // [1/s]
  // Of the desired pose, against the object's error.
  Eigen::Vector3d shift_{Eigen::Vector3d::Zero()};  // [m]
  Eigen::Vector3d turn_{Eigen::Vector3d::Zero()};   // [rad]

  std::string_view failure_;
  std::string_view next_failure_;  // The failure to report after the release.
  int grasps_{0};
  TimeIndex trajectory_begin_{0};
  std::optional<SeenPose> new_pose_;
  TimeIndex last_seen_;
  // The object when it was last seen, and what the tips had felt by then.
  struct Known {
    Pose pose{};
    Pose felt{};
  } known_;
  std::optional<Plan> plan_;
  Pose rest_;
  Motion desired_;
  Motion object_;
  Pose felt_;  // See `Remembered::felt`.
  std::vector<Remembered> memory_;
  PoseAverage looked_;  // The poses seen while looking.
};

}  // namespace trifinger::manipulation
