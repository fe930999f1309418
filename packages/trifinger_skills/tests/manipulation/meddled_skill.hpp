// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "support/allocation_counter.hpp"
#include "trifinger/manipulation/skill.hpp"

namespace trifinger::manipulation {

// A skill that somebody meddles with: some poses and steps never reach it, or poses are wrong.
// Counts what its functions of the loop allocate.
class MeddledSkill final : public Skill {
 public:
  explicit MeddledSkill(std::unique_ptr<Skill> skill) : skill_(std::move(skill)) {}

  // Whether a pose that was captured at this step, or this step, reaches the skill.
  std::function<bool(TimeIndex captured)> lets_see{};
  std::function<bool(TimeIndex step)> lets_step{};
  // What the skill sees in place of a pose.
  std::function<Pose(const Pose& pose)> seen_as{};

  [[nodiscard]] std::size_t allocations() const noexcept { return allocations_; }

  [[nodiscard]] std::string_view object() const noexcept override { return skill_->object(); }
  [[nodiscard]] Seconds max_duration() const noexcept override { return skill_->max_duration(); }
  void see(TimeIndex captured, const Pose& pose) noexcept override {
    if (lets_see && !lets_see(captured)) return;
    const Pose seen = seen_as ? seen_as(pose) : pose;
    const test::AllocationCounter counter;
    skill_->see(captured, seen);
    allocations_ += counter.count();
  }
  [[nodiscard]] const TriFinger::Action& update(
      TimeIndex step, const control::JointState& joints) noexcept override {
    if (lets_step && !lets_step(step)) return action_;
    const test::AllocationCounter counter;
    action_ = skill_->update(step, joints);
    allocations_ += counter.count();
    return action_;
  }
  void stop() noexcept override {
    const test::AllocationCounter counter;
    skill_->stop();
    allocations_ += counter.count();
  }
  [[nodiscard]] const SkillState& state() const noexcept override { return skill_->state(); }
  [[nodiscard]] bool wants_plan() const noexcept override { return skill_->wants_plan(); }
  void plan() override { skill_->plan(); }
  void begin() noexcept override { skill_->begin(); }
  [[nodiscard]] std::vector<Figure> figures(const SkillTrace& trace,
                                            std::span<const SeenPose> poses) const override {
    return skill_->figures(trace, poses);
  }

 private:
  std::unique_ptr<Skill> skill_;
  TriFinger::Action action_;
  std::size_t allocations_{0};
};

}  // namespace trifinger::manipulation
