// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "manipulation/parts/manipulation.hpp"
#include "manipulation/parts/task.hpp"
#include "trifinger/manipulation/skill.hpp"

namespace trifinger::manipulation {

// Grasps a box with three tips, leads it along the way of a task, and releases it: the skills that
// do this differ in their task.
class GraspedMotion final : public Skill {
 public:
  // Throws InvalidArgument.
  GraspedMotion(const SkillContext& context, const ManipulationConfig& config);

  [[nodiscard]] std::string_view object() const noexcept override { return config_.object; }
  [[nodiscard]] Seconds max_duration() const noexcept override { return config_.max_duration; }
  void see(TimeIndex captured, const Pose& pose) noexcept override {
    manipulation_.see(captured, pose);
  }
  [[nodiscard]] const TriFinger::Action& update(
      TimeIndex step, const control::JointState& joints) noexcept override;
  void stop() noexcept override;
  [[nodiscard]] const SkillState& state() const noexcept override { return state_; }
  [[nodiscard]] bool wants_plan() const noexcept override {
    return manipulation_.phase() == Phase::kPlan;
  }
  void plan() override;
  void begin() noexcept override;
  [[nodiscard]] std::vector<Figure> figures(const SkillTrace& trace,
                                            std::span<const SeenPose> poses) const override;

 private:
  void note() noexcept;

  ManipulationConfig config_;
  Manipulation manipulation_;
  TaskPlanner planner_;
  std::optional<Plan> plan_;
  std::vector<control::Touches> tried_;  // The grasps of all plans.
  TriFinger::Action action_{};
  SkillState state_;
};

}  // namespace trifinger::manipulation
