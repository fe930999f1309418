// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <optional>
#include <string_view>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/control/grasp_controller.hpp"
#include "trifinger/control/pose_estimator.hpp"
#include "trifinger/manipulation/task.hpp"

namespace trifinger::manipulation {

/// What a manipulation is doing.
enum class Phase {
  kLook,     ///< Averages poses of the object, which rests.
  kPlan,     ///< Waits for its plan: give it with `begin`.
  kGrasp,    ///< Goes to the object and closes.
  kLead,     ///< Brings it to where its task begins.
  kFollow,   ///< Leads it along its line or circle.
  kHold,     ///< Holds it at the end.
  kLower,    ///< Puts it down.
  kRelease,  ///< Lets it go.
  kDone,     ///< The object is where it should be, and free.
  kFailed,   ///< It is not; `Manipulation::failure` says why.
};
[[nodiscard]] std::string_view name_of(Phase phase) noexcept;

/// Why a manipulation has failed.
enum class Failure {
  kNone,
  kNotSeen,  ///< Nobody has said where the object is.
  kNoPlan,   ///< No grasp reaches the whole way from where the object lies.
  kLost,     ///< The object got lost as often as it may.
  kStopped,  ///< `stop` was called.
};
[[nodiscard]] std::string_view text_of(Failure failure) noexcept;

/// Where the object was.
struct SeenPose {
  TimeIndex step{0};
  Pose pose{};
};

/// The paper's first experiment, from looking for the object until it is free again, and once more
/// if it gets lost on the way.
///
/// It knows nothing of sessions: it is told what joints and cameras measure and says what torques
/// to apply, once per step. Poses of the object may be few, noisy and late. Planning takes too long
/// for a step, so it is left to the caller: when the phase is kPlan, give a plan for
/// `resting_pose()` to `begin`; meanwhile the tips stay where they are. Allocates only while it is
/// constructed.
class Manipulation {
 public:
  /// `period` is the length of a step.
  /// @throws InvalidArgument
  Manipulation(const RobotDescription& description, const ManipulationConfig& config,
               Seconds period = Seconds(1e-3));

  /// The object was at `pose` at step `captured`; to be called before the `update` of the step at
  /// which that is known. Ignores what is not newer than the one before, and what is more than a
  /// thousand steps old.
  void see(TimeIndex captured, const Pose& pose) noexcept;

  /// The torques for the next step [Nm], from what the joints have measured at `step`.
  [[nodiscard]] const JointValues& update(TimeIndex step,
                                          const control::JointState& joints) noexcept;

  /// Where the object rests, for a plan.
  [[nodiscard]] const Pose& resting_pose() const noexcept { return rest_; }
  /// Goes on with `plan`; fails if there is none. Only in the phase kPlan.
  void begin(const std::optional<Plan>& plan) noexcept;

  /// Puts the object down where it is, lets it go, and fails as kStopped.
  void stop() noexcept;

  [[nodiscard]] Phase phase() const noexcept { return phase_; }
  [[nodiscard]] bool has_ended() const noexcept {
    return phase_ == Phase::kDone || phase_ == Phase::kFailed;
  }
  [[nodiscard]] Failure failure() const noexcept { return failure_; }
  /// How often the object has been grasped, or was to be.
  [[nodiscard]] int grasps() const noexcept { return grasps_; }
  /// How the object should move at the last step.
  [[nodiscard]] const Motion& desired() const noexcept { return desired_; }
  /// How the object moves, as estimated.
  [[nodiscard]] const Motion& object() const noexcept { return object_; }
  [[nodiscard]] const control::GraspState& grasp() const noexcept { return controller_.state(); }
  /// The plan it follows, if it has one.
  [[nodiscard]] const std::optional<Plan>& plan() const noexcept { return plan_; }

 private:
  [[nodiscard]] Seconds time_of(TimeIndex step) const noexcept {
    return period_ * static_cast<double>(step);
  }
  void enter(Phase phase) noexcept;
  void fail(Failure failure) noexcept;
  void take_news() noexcept;
  void look_again() noexcept;
  void finish_look() noexcept;
  void release(Failure failure) noexcept;
  void follow_way() noexcept;
  void follow_phases() noexcept;
  void set_desired() noexcept;

  // Of what was desired, for poses that arrive late.
  static constexpr std::size_t kMemory = 1024;

  Seconds period_;
  Seconds look_time_;
  int max_grasps_;
  double object_height_;  // Of the resting object's centre.
  control::GraspController controller_;
  control::PoseEstimator estimator_;

  Phase phase_{Phase::kLook};
  Failure failure_{Failure::kNone};
  Failure next_failure_{Failure::kNone};  // After the release.
  int grasps_{0};
  TimeIndex step_{-1};
  TimeIndex phase_begin_{-1};
  TimeIndex way_begin_{0};
  std::optional<SeenPose> news_;
  TimeIndex last_seen_;
  std::optional<Plan> plan_;
  Pose rest_;
  Motion desired_;
  Motion object_;
  std::vector<Motion> memory_;

  // Of the poses seen while looking.
  int num_seen_{0};
  Eigen::Vector3d position_sum_;
  Eigen::Vector4d orientation_sum_;
};

}  // namespace trifinger::manipulation
