// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manipulation/parts/grasp_config.hpp"
#include "manipulation/parts/manipulation.hpp"
#include "manipulation/parts/phase_clock.hpp"
#include "manipulation/parts/pose_average.hpp"
#include "manipulation/parts/repose.hpp"
#include "manipulation/parts/settings.hpp"
#include "manipulation/parts/torque_action.hpp"
#include "manipulation/parts/torque_figure.hpp"
#include "manipulation/skills/carry/carry_planner.hpp"
#include "manipulation/skills/makers.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger::manipulation {
namespace {

using config::Node;
using config::Range;

// config/skills/carry.yml explains every key.
struct CarryConfig {
  ManipulationConfig handling;  // With a CarryTask.
  RestConfig rests;
  ReposeConfig pushing;
  Seconds push_time;
  int attempts;
  double position_tolerance;  // For the mean pose while it was held [m].
  double orientation_tolerance;
};

// Carries an object on the table to a pose in the air with three tips, holds it there, and brings
// it back. From where no grasp reaches the goal, it is pushed to another pose on the table first.
class Carry final : public Skill {
 public:
  Carry(const SkillContext& context, CarryConfig config)
      : context_(context),
        config_(std::move(config)),
        goal_(std::get<CarryTask>(config_.handling.task).goal),
        clock_(context.period),
        planner_(context.description, config_.handling, config_.rests),
        handling_(context.description, config_.handling, context.period) {
    state_.phase = name_of(handling_.phase());
    state_.desired.pose = goal_;
    // The loop must not allocate memory.
    attempt_reports_.reserve(static_cast<std::size_t>(config_.attempts));
  }

  [[nodiscard]] std::string_view object() const noexcept override {
    return config_.handling.object;
  }
  [[nodiscard]] Seconds max_duration() const noexcept override {
    return config_.handling.max_duration;
  }

  void see(TimeIndex captured, const Pose& pose) noexcept override {
    if (!pose.position.allFinite() || !pose.orientation.coeffs().allFinite()) return;
    if (is_pushing_) {
      if (captured >= push_begin_) push_->see(captured - push_begin_, pose);
      return;
    }
    handling_.see(captured, pose);
    if (handling_.phase() == Phase::kHold) held_.add(captured, pose);
  }

  [[nodiscard]] const TriFinger::Action& update(
      TimeIndex step, const control::JointState& joints) noexcept override {
    clock_.advance(step);
    if (!is_pushing_ || state_.has_ended) return handle(step, joints);
    const TriFinger::Action& action = push_->update(step - push_begin_, joints);
    follow_push();
    return action;
  }

  void stop() noexcept override {
    is_stopped_ = true;
    if (state_.has_ended) return;
    if (is_pushing_)
      push_->stop();
    else
      handling_.stop();
  }

  [[nodiscard]] const SkillState& state() const noexcept override { return state_; }

  [[nodiscard]] bool wants_plan() const noexcept override {
    if (state_.has_ended) return false;
    return is_pushing_ ? push_->wants_plan() : handling_.phase() == Phase::kPlan;
  }

  void plan() override {
    if (is_pushing_) {
      push_->plan();
      return;
    }
    next_push_.reset();
    const Pose& rest = handling_.resting_pose();
    // A grasp that has failed fails again, from wherever the object lies.
    planned_ = planner_.plan(rest, tried_);
    change_ = "the tips touch the object elsewhere";
    std::optional<Rest> better;
    if (!planned_) better = planner_.find_rest(rest, tried_);
    if (!planned_ && !better) {
      change_ = "nothing: all grasps have failed";
      tried_.clear();
      planned_ = planner_.plan(rest);
    }
    if (planned_) tried_.push_back(planned_->touches);
    if (!better) return;
    next_push_ = std::make_unique<Repose>(
        context_, config_.pushing, [goal = better->pose](int number, const Pose&) {
          return number == 0 ? std::optional<Goal>({.pose = goal}) : std::nullopt;
        });
  }

  void begin() noexcept override {
    is_planning_ = false;
    if (is_pushing_) {
      push_->begin();
      return;
    }
    if (handling_.phase() != Phase::kPlan) return;  // It was stopped meanwhile.
    if (planned_) {
      handling_.begin(planned_);
      ++attempts_;
      if (std::exchange(is_brought_, false)) change_ = "the object was brought elsewhere first";
      attempt_reports_.push_back({.change = attempts_ > 1 ? change_ : "", .end = ""});
    } else if (next_push_) {
      push_.swap(next_push_);
      push_begin_ = clock_.step() + 1;
      clock_.begin_phase();
      is_pushing_ = is_brought_ = true;
      ++pushes_;
    } else {
      end("no grasp reaches the goal, from wherever the object lies");
    }
  }

  [[nodiscard]] std::vector<Figure> figures(const SkillTrace& trace,
                                            std::span<const SeenPose> poses) const override;
  [[nodiscard]] std::vector<ReportFile> report_files(
      const SkillTrace& /*trace*/, std::span<const SeenPose> /*poses*/) const override {
    std::string text = "attempt,change,end\n";
    for (std::size_t i = 0; i < attempt_reports_.size(); ++i) {
      const auto& [change, end] = attempt_reports_[i];
      text += std::to_string(i + 1) + "," + std::string(change) + "," +
              std::string(end.empty() ? "done" : end) + "\n";
    }
    return {{.name = "attempts.csv", .text = text}};
  }

 private:
  // What the report says of an attempt.
  struct AttemptReport {
    std::string_view change;  // Against those before.
    std::string_view end;     // Why it has failed.
  };

  void end(std::string_view failure) noexcept {
    if (!attempt_reports_.empty()) attempt_reports_.back().end = failure;
    state_.phase = failure.empty() ? "done" : "failed";
    state_.failure = failure;
    state_.has_ended = true;
  }

  const TriFinger::Action& handle(TimeIndex step, const control::JointState& joints) noexcept {
    const Phase before = handling_.phase();
    const JointValues& torques = handling_.update(step, joints);
    set_torques(action_, torques);
    const Phase phase = handling_.phase();
    if (phase == Phase::kHold && before != Phase::kHold)
      held_.restart(step + static_cast<TimeIndex>(kSettle / clock_.period()));
    if (state_.has_ended) return action_;
    state_.phase = name_of(phase);
    state_.torque_share = handling_.grasp().torque_share;
    state_.object = handling_.object();
    state_.desired = handling_.desired();
    if (handling_.has_ended()) follow_handling();
    return action_;
  }

  void follow_handling() noexcept {
    if (handling_.phase() == Phase::kFailed) {
      if (handling_.failure() == kLost)
        try_again_or_fail(kLost);
      else
        end(handling_.failure());
      return;
    }
    // It was held. What counts is whether it was where it should have been.
    const Pose held = held_.count() > 0 ? held_.mean() : Pose{};
    const bool is_good = held_.count() > 0 &&
                         (held.position - goal_.position).norm() <= config_.position_tolerance &&
                         control::rotation_error(goal_.orientation, held.orientation).norm() <=
                             config_.orientation_tolerance;
    if (is_good)
      end({});
    else
      try_again_or_fail("the object was not held where it should have been");
  }

  void try_again_or_fail(std::string_view failure) noexcept {
    if (is_stopped_ || attempts_ >= config_.attempts) {
      end(is_stopped_ ? kStopped : failure);
      return;
    }
    attempt_reports_.back().end = failure;
    handling_.begin_again(clock_.step());
    state_.phase = name_of(handling_.phase());
  }

  void follow_push() noexcept {
    const SkillState& pushed = push_->state();
    state_.phase = pushed.phase;
    state_.torque_share = pushed.torque_share;
    state_.object = pushed.object;
    state_.desired = pushed.desired;
    if (!pushed.has_ended) {
      if (clock_.in_phase() > config_.push_time) push_->stop();
      is_planning_ = is_planning_ || push_->wants_plan();
      return;
    }
    // A plan that is being made belongs to the push.
    if (is_planning_) return;
    is_pushing_ = false;
    if (is_stopped_)
      end(kStopped);
    else
      handling_.begin_again(clock_.step());
  }

  static constexpr Seconds kSettle{1.0};  // At the goal, before it counts.

  SkillContext context_;
  CarryConfig config_;
  Pose goal_;
  PhaseClock clock_;
  CarryPlanner planner_;
  Manipulation handling_;
  SkillState state_;
  TriFinger::Action action_{};
  bool is_stopped_{false};
  int attempts_{0};
  int pushes_{0};
  std::vector<AttemptReport> attempt_reports_;

  // Made by `plan`.
  std::optional<Plan> planned_;
  std::unique_ptr<Repose> next_push_;
  std::vector<control::Touches> tried_;  // The grasps of all plans.
  std::string_view change_;              // What the next attempt changes.

  std::unique_ptr<Repose> push_;  // It counts steps from `push_begin_`.
  bool is_pushing_{false};
  bool is_brought_{false};  // Since the last attempt.
  TimeIndex push_begin_{0};
  bool is_planning_{false};  // A plan of the push may be under way.

  PoseAverage held_;
};

std::vector<Figure> Carry::figures(const SkillTrace& trace, std::span<const SeenPose> poses) const {
  const double time = trace.steps.empty()
                          ? 0.0
                          : trace.period.count() * static_cast<double>(trace.steps.back().step + 1);
  std::vector<Figure> all{
      {"time", time, "s", "from the first step to the end"},
      {"attempts", static_cast<double>(attempts_), "", "how often it was grasped"},
      {"pushes", static_cast<double>(pushes_), "",
       "how often it was pushed to where a grasp reaches the goal"},
      torque_share_figure(trace)};
  // The last time that it was held.
  const auto is_hold = [](const SkillStep& step) { return step.phase == name_of(Phase::kHold); };
  std::size_t past = trace.steps.size();
  while (past > 0 && !is_hold(trace.steps[past - 1])) --past;
  if (past == 0) return all;
  std::size_t first = past - 1;
  while (first > 0 && is_hold(trace.steps[first - 1])) --first;
  const TimeIndex end = trace.steps[past - 1].step;
  const TimeIndex begin = trace.steps[first].step + static_cast<TimeIndex>(kSettle / trace.period);
  PoseAverage held;
  for (const SeenPose& seen : poses)
    if (seen.step > begin && seen.step <= end) held.add(seen.pose);
  if (held.count() == 0) return all;
  const Pose mean = held.mean();
  all.push_back({"position_error", (mean.position - goal_.position).norm(), "m",
                 "of the object from its goal while it was held"});
  all.push_back({"orientation_error",
                 control::rotation_error(goal_.orientation, mean.orientation).norm(), "rad",
                 "of the object from its goal while it was held"});
  return all;
}

Pose read_goal(const Node& section) {
  const auto place =
      section.required<std::array<double, 3>>("position", {.unit = "m", .min = -0.3, .max = 0.5});
  const auto q = section.required<std::array<double, 4>>("orientation", {.min = -1, .max = 1});
  const Eigen::Quaterniond orientation(q[0], q[1], q[2], q[3]);
  if (orientation.norm() < 0.5)
    throw config::ConfigError(section.at("orientation").location(),
                              "goal.orientation is no quaternion of unit length");
  return {{place[0], place[1], place[2]}, orientation.normalized()};
}

CarryConfig read_carry(const SkillContext& context, const Node& root) {
  const Range angle = above_zero("rad", 1.6);
  const Range length = above_zero("m", 0.3);
  const Node path = root.section("way");
  const Node hold = root.section("hold");
  const Node rests = root.section("rests");
  ReposeConfig pushing = read_repose(root);
  GraspingConfig grasp = load_grasping(context, root, pushing.object);
  grasp.look_time = pushing.look_time;
  grasp.max_duration = pushing.max_duration;
  return {.handling = {std::move(grasp),
                       CarryTask{.goal = read_goal(root.section("goal")),
                                 .speed = path.required<double>("speed", above_zero("m/s", 1)),
                                 .turn_speed =
                                     path.required<double>("turn_speed", above_zero("rad/s", 10)),
                                 .clearance = path.required<double>(
                                     "clearance", {.unit = "m", .min = 0, .max = 0.1}),
                                 .hold_time = read_time(hold, "time")},
                       {}},
          .rests = {.largest_tilt = rests.required<double>("largest_tilt", angle),
                    .turns = rests.required<std::vector<double>>(
                        "turns", {.unit = "rad", .min = -3.15, .max = 3.15}),
                    .places = rests.required<std::vector<double>>("places", {.min = 0, .max = 2}),
                    .farthest = rests.required<double>("farthest", length),
                    .spare_turn =
                        rests.required<double>("spare_turn", {.unit = "rad", .min = 0, .max = 1})},
          .pushing = std::move(pushing),
          .push_time = read_time(root, "push_time"),
          .attempts = root.required<int>("attempts", {.min = 1, .max = 100}),
          .position_tolerance = hold.required<double>("position_tolerance", length),
          .orientation_tolerance = hold.required<double>("orientation_tolerance", angle)};
}

}  // namespace

std::unique_ptr<Skill> make_carry(const SkillContext& context, const config::Node& root) {
  return std::make_unique<Carry>(context, read_carry(context, root));
}

CarryPlanner load_carry_planner(const SkillContext& context,
                                const std::vector<std::string>& overrides) {
  const config::File file = load_skill_file("carry", overrides);
  const CarryConfig config = read_carry(context, file.root());
  return {context.description, config.handling, config.rests};
}

}  // namespace trifinger::manipulation
