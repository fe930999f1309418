// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/manipulation/run_skill.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <thread>

#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/manipulation/skills.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::manipulation {
namespace {

// Holds its pose for some steps, and notes what it is told.
class Watcher final : public Skill {
 public:
  std::string object_name{"cube"};
  TimeIndex last_step{50};
  Seconds longest{10.0};
  TimeIndex plan_at{-2};  // Never.
  bool plan_throws{false};

  std::vector<SeenPose> seen;
  std::vector<TimeIndex> steps;
  std::thread::id planned_in;
  int begun{0};
  int stopped{0};

  Watcher() { state_.phase = "watch"; }

  [[nodiscard]] std::string_view object() const noexcept override { return object_name; }
  [[nodiscard]] Seconds max_duration() const noexcept override { return longest; }
  void see(TimeIndex captured, const Pose& pose) noexcept override {
    seen.push_back({captured, pose});
  }
  [[nodiscard]] const TriFinger::Action& update(
      TimeIndex step, const control::JointState& joints) noexcept override {
    steps.push_back(step);
    if (steps.size() == 1)
      JointValues::Map(action_.position.data(), joints.position.size()) = joints.position;
    wants_ = step == plan_at;
    state_.has_ended = state_.has_ended || step >= last_step;
    return action_;
  }
  void stop() noexcept override {
    ++stopped;
    state_.has_ended = true;
    state_.failure = "it was stopped";
  }
  [[nodiscard]] const SkillState& state() const noexcept override { return state_; }
  [[nodiscard]] bool wants_plan() const noexcept override { return wants_; }
  void plan() override {
    planned_in = std::this_thread::get_id();
    if (plan_throws) throw std::runtime_error("no plan today");
  }
  void begin() noexcept override {
    ++begun;
    wants_ = false;
    state_.phase = "begun";
  }
  [[nodiscard]] std::vector<Figure> figures(const SkillTrace& trace,
                                            std::span<const SeenPose> /*poses*/) const override {
    return {{"steps", static_cast<double>(trace.steps.size()), "", "that were done"}};
  }

 private:
  TriFinger::Action action_;
  SkillState state_;
  bool wants_{false};
};

SimulationOptions sim() { return load_robot_config("sim").simulation; }

TEST(RunSkill, TellsEveryStepAndEveryPoseOnceInTheirOrder) {
  Watcher skill;
  const Simulation simulation(sim());
  auto robot = simulation.connect();
  const SkillTrace trace = run_skill(robot, skill);
  ASSERT_FALSE(skill.seen.empty());
  for (std::size_t i = 1; i < skill.seen.size(); ++i)
    EXPECT_GT(skill.seen[i].step, skill.seen[i - 1].step);
  for (std::size_t i = 1; i < skill.steps.size(); ++i)
    EXPECT_EQ(skill.steps[i], skill.steps[i - 1] + 1);
  EXPECT_EQ(skill.steps.back(), skill.last_step);
  ASSERT_EQ(trace.steps.size(), skill.steps.size());
  EXPECT_EQ(trace.seen.size(), skill.seen.size());
  EXPECT_TRUE(trace.failure.empty());
}

TEST(RunSkill, NeedsNoObjectIfTheSkillNeedsNone) {
  Watcher skill;
  skill.object_name.clear();
  auto options = sim();
  options.description.objects.clear();
  const Simulation simulation(options);
  auto robot = simulation.connect();
  EXPECT_TRUE(run_skill(robot, skill).failure.empty());
  EXPECT_TRUE(skill.seen.empty());
}

TEST(RunSkill, RefusesARobotThatDoesNotKnowTheObject) {
  Watcher skill;
  skill.object_name = "pen";
  const Simulation simulation(sim());
  auto robot = simulation.connect();
  EXPECT_THROW((void)run_skill(robot, skill), IncompatibleSession);
}

TEST(RunSkill, PlansInAnotherThreadAndThenBegins) {
  Watcher skill;
  skill.plan_at = 10;
  const Simulation simulation(sim());
  auto robot = simulation.connect();
  std::vector<std::string> phases;
  (void)run_skill(robot, skill,
                  {.on_phase = [&](const Skill& at) { phases.emplace_back(at.state().phase); }});
  EXPECT_EQ(skill.begun, 1);
  EXPECT_NE(skill.planned_in, std::thread::id());
  EXPECT_NE(skill.planned_in, std::this_thread::get_id());
  EXPECT_EQ(phases, std::vector<std::string>{"begun"});
}

TEST(RunSkill, ThrowsWhatThePlanningThrows) {
  Watcher skill;
  skill.plan_at = 10;
  skill.plan_throws = true;
  const Simulation simulation(sim());
  auto robot = simulation.connect();
  EXPECT_THROW((void)run_skill(robot, skill), std::runtime_error);
}

TEST(RunSkill, StopsASkillWhoseTimeIsOver) {
  Watcher skill;
  skill.longest = Seconds(0.02);
  const Simulation simulation(sim());
  auto robot = simulation.connect();
  const SkillTrace trace = run_skill(robot, skill);
  EXPECT_EQ(trace.steps.size(), 20U);
  EXPECT_EQ(skill.stopped, 1);
  EXPECT_EQ(trace.failure, "it was stopped");
}

TEST(RunSkill, StopsWhenAskedTo) {
  Watcher skill;
  const std::atomic<bool> stop{true};
  const Simulation simulation(sim());
  auto robot = simulation.connect();
  EXPECT_EQ(run_skill(robot, skill, {.stop = &stop}).steps.size(), 1U);
}

TEST(Skills, AreRefusedByAnUnknownName) {
  EXPECT_THROW((void)make_skill("juggle", {}), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::manipulation
