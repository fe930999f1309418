// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "manipulation/parts/carrier.hpp"
#include "manipulation/parts/fetcher.hpp"
#include "manipulation/parts/phase_clock.hpp"
#include "manipulation/parts/pose_average.hpp"
#include "manipulation/parts/pusher.hpp"
#include "trifinger/config/node.hpp"
#include "trifinger/manipulation/skill.hpp"

namespace trifinger::manipulation {

// Settings of the skills that push an object on the table to poses. config/skills/pushing.yml
// documents them as a file.
struct ReposeConfig {
  std::string object;
  Seconds max_duration;
  Seconds look_time;
  double position_tolerance;
  double orientation_tolerance;
  double closeness;
  Seconds settle_time;
  Seconds leave_time;
  Seconds stuck_time;
  double fetch_distance;
  PushConfig push;
  // How the object is carried for the last part of the way; without it, it is only pushed.
  std::optional<CarrierConfig> carry;
};

// Reads what these skills share. Throws config::ConfigError.
[[nodiscard]] ReposeConfig read_repose(const config::Node& root);
// Reads how an object is carried. Throws config::ConfigError, InvalidArgument, SystemError.
[[nodiscard]] CarrierConfig read_carrier(const SkillContext& context, const config::Node& section,
                                         const std::string& object);
// Reads the name of a face: its normal in the object's frame. Throws config::ConfigError.
[[nodiscard]] Eigen::Vector3d read_face(const config::Node& section, std::string_view key);
// The orientation of a box with the face of this normal up, then turned about the vertical.
[[nodiscard]] Eigen::Quaterniond lying_on(const Eigen::Vector3d& face, double turn);

// The goal of this number, from 0, for an object that rests at `pose`; nothing after the last one.
using NextGoal = std::function<std::optional<Goal>(int number, const Pose& pose)>;

// Brings an object on the table to one pose after the other: pushes it there, takes the tips away,
// looks whether it lies where it should, and tries again if it does not.
class Repose final : public Skill {
 public:
  // Throws InvalidArgument. `next_goal` must not throw.
  Repose(const SkillContext& context, ReposeConfig config, NextGoal next_goal);

  [[nodiscard]] std::string_view object() const noexcept override { return config_.object; }
  [[nodiscard]] Seconds max_duration() const noexcept override { return config_.max_duration; }
  void see(TimeIndex captured, const Pose& pose) noexcept override;
  [[nodiscard]] const TriFinger::Action& update(
      TimeIndex step, const control::JointState& joints) noexcept override;
  void stop() noexcept override;
  [[nodiscard]] const SkillState& state() const noexcept override { return state_; }
  [[nodiscard]] bool wants_plan() const noexcept override {
    return pusher_.wants_plan() || phase_ == Phase::kPlan;
  }
  void plan() override;
  void begin() noexcept override;
  [[nodiscard]] std::vector<Figure> figures(const SkillTrace& trace,
                                            std::span<const SeenPose> poses) const override;

 private:
  enum class Phase : std::uint8_t {
    kLook,
    kFetch,
    kPush,
    kLeave,
    kCheck,
    kPlan,
    kCarry,
    kDone,
    kFailed
  };

  void enter(Phase phase) noexcept;
  void end(std::string_view failure) noexcept;
  void give_up(std::string_view failure) noexcept;
  void attempt(const Pose& rest) noexcept;
  void push(bool is_rough) noexcept;
  void leave() noexcept;
  void look_again() noexcept;
  void take_goal(const Pose& rest) noexcept;
  [[nodiscard]] bool is_at_goal(const Pose& rest) const noexcept;
  void follow_phases(const control::JointState& joints) noexcept;
  void follow_push() noexcept;
  [[nodiscard]] bool is_close() const noexcept;
  [[nodiscard]] double uprightness(const Pose& pose) const noexcept;
  void check() noexcept;
  [[nodiscard]] bool is_unseen() const noexcept;

  ReposeConfig config_;
  NextGoal next_goal_;
  PhaseClock clock_;
  Pusher pusher_;
  Fetcher fetcher_;
  std::unique_ptr<Carrier> carrier_;  // Nothing if the object is only pushed.
  SkillState state_{};
  Phase phase_{Phase::kLook};
  Goal goal_{};
  Goal target_{};          // What the object is pushed to.
  Pose rest_{};            // Where the object was before this attempt.
  bool is_rough_{false};   // It is pushed only to where it can be carried from.
  bool can_carry_{false};  // What the last plan has found.
  Pose seen_{};            // The newest pose.
  Seconds last_seen_{0};
  PoseAverage mean_;
  std::string_view next_failure_;  // Of the end after the tips have left.
  std::optional<Seconds> close_since_;
  double least_{0.0};  // Least deviation so far, in multiples of what is allowed.
  Seconds progress_{0};
  bool wants_fetch_{false};
  bool has_fetched_{false};  // Since the last push.
  int reached_{0};
  int attempts_{0};
  int fetches_{0};
  int carries_{0};
};

}  // namespace trifinger::manipulation
