// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/manipulation/run.hpp"

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "parts/plan_untried.hpp"
#include "trifinger/manipulation/run_skill.hpp"

namespace trifinger::manipulation {
namespace {

// Lifting and sliding as a skill. Their figures need more than the trace of a skill has, so `run`
// keeps a trace of its own.
class ManipulationSkill final : public Skill {
 public:
  ManipulationSkill(const RobotDescription& description, const ManipulationConfig& config,
                    Seconds period)
      : object_(config.object),
        max_duration_(config.max_duration),
        manipulation_(description, config, period),
        planner_(description, config) {
    note();
  }

  [[nodiscard]] const Manipulation& manipulation() const noexcept { return manipulation_; }

  [[nodiscard]] std::string_view object() const noexcept override { return object_; }
  [[nodiscard]] Seconds max_duration() const noexcept override { return max_duration_; }
  void see(TimeIndex captured, const Pose& pose) noexcept override {
    manipulation_.see(captured, pose);
  }
  [[nodiscard]] const TriFinger::Action& update(
      TimeIndex step, const control::JointState& joints) noexcept override {
    const JointValues& torques = manipulation_.update(step, joints);
    JointValues::Map(action_.torque.data(), torques.size()) = torques;
    note();
    return action_;
  }
  void stop() noexcept override {
    manipulation_.stop();
    note();
  }
  [[nodiscard]] const SkillState& state() const noexcept override { return state_; }

  [[nodiscard]] bool wants_plan() const noexcept override {
    return manipulation_.phase() == Phase::kPlan;
  }
  void plan() override {
    plan_ = plan_untried(tried_,
                         [this] { return planner_.plan(manipulation_.resting_pose(), tried_); });
    if (plan_) tried_.push_back(plan_->touches);
  }
  void begin() noexcept override {
    manipulation_.begin(plan_);
    note();
  }

  [[nodiscard]] std::vector<Figure> figures(const SkillTrace& /*trace*/,
                                            std::span<const SeenPose> /*poses*/) const override {
    return {};
  }

 private:
  void note() noexcept {
    state_ = {.phase = name_of(manipulation_.phase()),
              .has_ended = manipulation_.has_ended(),
              .failure = text_of(manipulation_.failure()),
              .desired = manipulation_.desired(),
              .object = manipulation_.object(),
              .torque_share = manipulation_.grasp().torque_share};
  }

  std::string object_;
  Seconds max_duration_;
  Manipulation manipulation_;
  TaskPlanner planner_;
  std::optional<Plan> plan_;
  std::vector<control::Touches> tried_;  // The grasps of all plans.
  TriFinger::Action action_;
  SkillState state_;
};

TraceStep traced(const SkillStep& step, const Manipulation& manipulation) {
  const control::GraspState& grasp = manipulation.grasp();
  return {.step = step.step,
          .phase = manipulation.phase(),
          .desired = step.desired,
          .estimated = step.estimated,
          .normal_forces = grasp.normal_forces,
          .tangential_forces = grasp.tangential_forces,
          .travel = grasp.travel,
          .is_in_sight = manipulation.is_in_sight(),
          .is_slipping = grasp.is_slipping,
          .torque_share = step.torque_share,
          .status = grasp.wanted.status,
          .cycle_time = step.cycle_time};
}

}  // namespace

Trace run(Frontend<TriFinger>& robot, const RobotDescription& description,
          const ManipulationConfig& config, const RunOptions& options) {
  const Seconds period = robot.session().info().period;
  ManipulationSkill skill(description, config, period);
  const Manipulation& manipulation = skill.manipulation();
  Trace trace;
  trace.period = period;
  const auto most = static_cast<std::size_t>(config.max_duration / period);
  trace.steps.reserve(most);
  bool is_in_sight = true;
  const auto note = [&](const SkillStep& step) {
    if (trace.steps.size() < most) trace.steps.push_back(traced(step, manipulation));
    if (manipulation.is_in_sight() == is_in_sight) return;
    is_in_sight = manipulation.is_in_sight();
    if (options.on_sight) options.on_sight(manipulation);
  };
  const auto tell = [&](const Skill&) {
    if (options.on_phase) options.on_phase(manipulation);
  };
  SkillTrace kept = run_skill(robot, skill,
                              {.realtime = options.realtime,
                               .stop = options.stop,
                               .on_step = options.on_step,
                               .on_update = note,
                               .on_phase = tell});
  trace.seen = std::move(kept.seen);
  trace.end = manipulation.phase();
  trace.failure = manipulation.failure();
  trace.grasps = manipulation.grasps();
  if (manipulation.plan()) trace.planned_torque_share = manipulation.plan()->torque_share;
  return trace;
}

}  // namespace trifinger::manipulation
