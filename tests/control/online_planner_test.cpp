// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/online_planner.hpp"

#include <gtest/gtest.h>
#include <mujoco/mujoco.h>
#include <sched.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "support/allocation_counter.hpp"
#include "support/child_process.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/realtime/thread.hpp"

namespace trifinger::control {
namespace {

using trifinger::test::AllocationCounter;
using Joints = std::array<double, 3>;

constexpr Timeout kWatchdog = std::chrono::seconds(60);
constexpr Seconds kPeriod{0.04};

// One finger without objects: plans of it are made in a moment.
RobotDescription finger() { return {.arrangement = Arrangement::kSingleFinger, .objects = {}}; }

PlanningTask reach() {
  return {.terms = {{.kind = CostKind::kJointPosition, .joints = {0.2, 0.5, -1.2}},
                    {.kind = CostKind::kJointVelocity, .weight = 0.02}}};
}

PlannerOptions small_options() {
  return {.samples = 8, .horizon = Seconds(0.12), .num_threads = 1, .seed = 1};
}

PlanningState moved(PlanningState state, Seconds time) {
  state.time = time;
  state.velocity[0] = 0.5;
  return state;
}

TEST(OnlinePlanner, HasNoCommandsBeforeItsFirstPlan) {
  OnlinePlanner planner{PlanningModel(finger()), reach(), small_options()};
  Joints command{7, 7, 7};
  EXPECT_FALSE(planner.at(Seconds(0), command));
  EXPECT_EQ(command[0], 7);
  EXPECT_EQ(planner.status().num_plans, 0U);
}

TEST(OnlinePlanner, BeginsEachPlanWhereTheOldOneLeadsTo) {
  constexpr Seconds kLead{0.03};
  OnlinePlanner planner{
      PlanningModel(finger()), reach(), small_options(), {.period = kPeriod, .lead = kLead}};
  // The same with calls one after the other.
  PredictivePlanner reference(PlanningModel(finger()), reach(), small_options());
  PlanningState predicted = planner.model().initial_state();
  KnotSpline before;
  for (int i = 0; i < 5; ++i) {
    const PlanningState state =
        moved(planner.model().initial_state(), Seconds(3) + i * 1.5 * kPeriod);
    ASSERT_TRUE(planner.set_state(state));
    planner.wait_for_plan(static_cast<std::uint64_t>(i) + 1, kWatchdog);
    predicted = state;
    if (i > 0) (void)reference.simulate(state, before, kLead, predicted);
    const Plan& plan = reference.plan(predicted);
    const OnlinePlannerStatus& status = planner.status();
    EXPECT_EQ(status.begin, predicted.time);
    EXPECT_EQ(status.state_time, state.time);
    EXPECT_EQ(status.cost, plan.cost);
    EXPECT_EQ(status.lateness, Seconds(0));
    for (const double offset : {-0.029, -0.001, 0.0, 0.02, 0.5}) {
      const Seconds time = status.begin + Seconds(offset);
      Joints command{};
      Joints rate{};
      Joints expected{};
      Joints expected_rate{};
      ASSERT_TRUE(planner.at(time, command, rate));
      (offset < 0 && i > 0 ? before : plan.commands).at(time, expected, expected_rate);
      EXPECT_EQ(command, expected);
      EXPECT_EQ(rate, expected_rate);
    }
    before = plan.commands;
  }
}

TEST(OnlinePlanner, PlansAtMostOncePerPeriod) {
  OnlinePlanner planner{PlanningModel(finger()), reach(), small_options(), {.period = kPeriod}};
  const PlanningState start = planner.model().initial_state();
  ASSERT_TRUE(planner.set_state(moved(start, Seconds(0))));
  planner.wait_for_plan(1, kWatchdog);
  for (const double time : {0.001, 0.02, 0.0399}) planner.set_state(moved(start, Seconds(time)));
  planner.set_state(moved(start, kPeriod));
  planner.wait_for_plan(2, kWatchdog);
  EXPECT_EQ(planner.status().num_plans, 2U);
  EXPECT_EQ(planner.status().state_time, kPeriod);
}

TEST(OnlinePlanner, LetsEachPlanBeginBeforeItMakesTheNextOne) {
  constexpr Seconds kLead = 3 * kPeriod;
  OnlinePlanner planner{
      PlanningModel(finger()), reach(), small_options(), {.period = kPeriod, .lead = kLead}};
  const PlanningState start = planner.model().initial_state();
  const auto commands_at = [&](Seconds time) {
    Joints command{};
    EXPECT_TRUE(planner.at(time, command));
    return command;
  };
  planner.set_state(moved(start, Seconds(0)));
  planner.wait_for_plan(1, kWatchdog);
  Seconds begin{0};
  for (std::uint64_t plan = 2; plan < 5; ++plan) {
    const Seconds state_time = std::max(begin, kPeriod);
    // Until the next plan begins, all is as this one promises now.
    std::array<Joints, 12> promised{};
    for (std::size_t i = 0; i < promised.size(); ++i)
      promised[i] = commands_at(state_time + static_cast<double>(i) * kLead / 12);
    planner.set_state(moved(start, state_time));
    planner.wait_for_plan(plan, kWatchdog);
    begin = planner.status().begin;
    EXPECT_EQ(begin, state_time + kLead);
    for (std::size_t i = 0; i < promised.size(); ++i) {
      const Seconds time = state_time + static_cast<double>(i) * kLead / 12;
      EXPECT_EQ(commands_at(time), promised[i]);
      planner.set_state(moved(start, time));
      // None of these states is for a plan.
      EXPECT_THROW(planner.wait_for_plan(plan + 1, std::chrono::milliseconds(2)), TimedOut);
    }
  }
}

TEST(OnlinePlanner, TellsLateness) {
  std::atomic<bool> may_go_on{true};
  std::atomic<bool> has_begun{false};
  PlanningTask task = reach();
  task.batch_cost = [&](const RolloutBatch&, std::span<double>) {
    has_begun = true;
    has_begun.notify_all();
    may_go_on.wait(false);
  };
  OnlinePlanner planner{
      PlanningModel(finger()), task, small_options(), {.period = kPeriod, .lead = Seconds(0.01)}};
  const PlanningState start = planner.model().initial_state();
  planner.set_state(moved(start, Seconds(0)));
  planner.wait_for_plan(1, kWatchdog);
  may_go_on = false;
  has_begun = false;
  planner.set_state(moved(start, Seconds(1)));
  has_begun.wait(false);
  planner.set_state(moved(start, Seconds(1.025)));
  may_go_on = true;
  may_go_on.notify_all();
  planner.wait_for_plan(2, kWatchdog);
  EXPECT_DOUBLE_EQ(planner.status().begin.count(), 1.01);
  EXPECT_NEAR(planner.status().duration.count(), 0.025, 1e-12);
  EXPECT_NEAR(planner.status().lateness.count(), 0.015, 1e-12);
}

TEST(OnlinePlanner, BeginsPlansWhenTheyWillBeReady) {
  std::atomic<int> gate{1};  // Plans go on while it is 1.
  PlanningTask task = reach();
  task.batch_cost = [&](const RolloutBatch&, std::span<double>) { gate.wait(0); };
  OnlinePlanner planner{PlanningModel(finger()), task, small_options(), {.period = kPeriod}};
  const PlanningState start = planner.model().initial_state();
  planner.set_state(moved(start, Seconds(0)));
  planner.wait_for_plan(1, kWatchdog);
  // A plan that takes 30 ms.
  gate = 0;
  planner.set_state(moved(start, Seconds(1)));
  planner.set_state(moved(start, Seconds(1.03)));
  gate = 1;
  gate.notify_all();
  planner.wait_for_plan(2, kWatchdog);
  const double took = planner.status().duration.count();
  // The next plan is made for the instant at which it will be ready.
  planner.set_state(moved(start, Seconds(2)));
  planner.wait_for_plan(3, kWatchdog);
  EXPECT_NEAR(planner.status().begin.count(), 2 + took, 1e-12);
}

TEST(OnlinePlanner, RefusesStatesThatMakeNoSense) {
  OnlinePlanner planner{PlanningModel(finger()), reach(), small_options()};
  EXPECT_FALSE(planner.set_state({}));
  PlanningState state = planner.model().initial_state();
  state.position[0] = std::nan("");
  EXPECT_TRUE(planner.set_state(state));
  state = planner.model().initial_state();
  state.time = Seconds(std::nan(""));
  EXPECT_TRUE(planner.set_state(state));
  state.time = Seconds(1);
  EXPECT_TRUE(planner.set_state(state));
  planner.wait_for_plan(1, kWatchdog);
  EXPECT_EQ(planner.status().state_time, Seconds(1));
  EXPECT_LE(planner.status().num_refused_states, 2U);
}

TEST(OnlinePlanner, TakesOtherTermsBetweenPlans) {
  PlanningTask task = reach();
  task.terms[1] = {.kind = CostKind::kEffort, .weight = 0};
  OnlinePlanner planner{PlanningModel(finger()), task, small_options()};
  EXPECT_FALSE(planner.set_terms(std::span(task.terms).first(1)));
  std::vector<CostTerm> terms = task.terms;
  for (CostTerm& term : terms) term.weight = 0;
  EXPECT_TRUE(planner.set_terms(terms));
  planner.set_state(planner.model().initial_state());
  planner.wait_for_plan(1, kWatchdog);
  EXPECT_EQ(planner.status().cost, 0.0);
}

TEST(OnlinePlanner, GoesOnAfterTermsThatItRefuses) {
  const PlanningTask task = reach();
  OnlinePlanner planner{PlanningModel(finger()), task, small_options()};
  const PlanningState start = planner.model().initial_state();
  const double nan = std::nan("");
  const std::vector<CostTerm> refused{
      {.weight = nan},
      {.kind = CostKind::kEffort, .end_weight = nan},
      {.kind = CostKind::kTipPosition, .goal = {.position = {0, nan, 0}}},
      {.kind = CostKind::kJointPosition, .joints = {0, 0, nan}},
      {.kind = CostKind::kTipPosition, .index = 1},
      {.kind = CostKind::kTipPosition, .index = -1},
      {.kind = CostKind::kObjectVelocity}};
  for (std::size_t i = 0; i < refused.size(); ++i) {
    std::vector<CostTerm> terms = task.terms;
    terms[1] = refused[i];
    EXPECT_FALSE(planner.set_terms(terms)) << i;
    EXPECT_THROW(validate({.terms = terms}, planner.model()), InvalidArgument) << i;
    planner.set_state(moved(start, static_cast<double>(i) * Seconds(1)));
    planner.wait_for_plan(i + 1, kWatchdog);
    EXPECT_FALSE(planner.status().has_failed);
  }
}

TEST(OnlinePlanner, HandsOnTheExceptionOfACost) {
  PlanningTask task = reach();
  task.batch_cost = [](const RolloutBatch&, std::span<double>) {
    throw std::runtime_error("no cost today");
  };
  OnlinePlanner planner{PlanningModel(finger()), task, small_options()};
  EXPECT_FALSE(planner.status().has_failed);
  planner.set_state(planner.model().initial_state());
  EXPECT_THROW(planner.wait_for_plan(1, kWatchdog), std::runtime_error);
  EXPECT_TRUE(planner.status().has_failed);
  EXPECT_THROW(planner.wait_for_plan(1, kWatchdog), Error);
}

TEST(OnlinePlanner, ReportsWhatItRefusesToTheThreadThatMakesIt) {
  PlannerOptions options = small_options();
  options.samples = 0;
  EXPECT_THROW(OnlinePlanner(PlanningModel(finger()), reach(), options), InvalidArgument);
  EXPECT_THROW(
      OnlinePlanner(PlanningModel(finger()), reach(), small_options(), {.period = Seconds(-1)}),
      InvalidArgument);
  OnlinePlanner planner{PlanningModel(finger()), reach(), small_options()};
  EXPECT_THROW(planner.wait_for_plan(1, Timeout::zero()), TimedOut);
}

TEST(OnlinePlanner, AllocatesNothingInTheLoop) {
  OnlinePlanner planner{PlanningModel(finger()), reach(), small_options()};
  const PlanningState start = planner.model().initial_state();
  const std::vector<CostTerm> terms = reach().terms;
  Joints command{};
  Joints rate{};
  PlanningState state = start;
  const AllocationCounter counter;
  for (int i = 0; i < 200; ++i) {
    state.time = i * Seconds(0.01);
    planner.set_state(state);
    planner.set_terms(terms);
    static_cast<void>(planner.at(state.time, command, rate));
    static_cast<void>(planner.status());
  }
  EXPECT_EQ(counter.count(), 0U);
}

// The scheduling policies of all threads of this process but the calling one.
std::vector<int> policies_of_others(const std::vector<std::string>& known) {
  std::vector<int> policies;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
    const std::string name = task.path().filename();
    if (std::ranges::count(known, name) == 0)
      policies.push_back(::sched_getscheduler(std::stoi(name)));
  }
  return policies;
}

std::vector<std::string> threads() {
  std::vector<std::string> names;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task"))
    names.push_back(task.path().filename());
  return names;
}

TEST(OnlinePlanner, fault_64_StaysInTheParentOfAForkedChild) {
  auto planner = std::make_unique<OnlinePlanner>(PlanningModel(finger()), reach(), small_options());
  test::ChildProcess child([&] {
    try {
      planner->wait_for_plan(1, kWatchdog);
      return 2;
    } catch (const InheritedHandle&) {
    }
    planner.reset();  // waits for no thread
    OnlinePlanner own{PlanningModel(finger()), reach(), small_options()};
    own.set_state(own.model().initial_state());
    own.wait_for_plan(1, kWatchdog);
    return 0;
  });
  EXPECT_EQ(child.wait(), 0);
  planner->set_state(planner->model().initial_state());
  planner->wait_for_plan(1, kWatchdog);
}

TEST(PredictivePlanner, fault_64_RefusesToPlanInAForkedChild) {
  PlannerOptions options = small_options();
  options.num_threads = 2;
  auto planner = std::make_unique<PredictivePlanner>(PlanningModel(finger()), reach(), options);
  const PlanningState start = planner->model().initial_state();
  test::ChildProcess child([&] {
    try {
      (void)planner->plan(start);
      return 2;
    } catch (const InheritedHandle&) {
    }
    planner.reset();  // waits for no thread
    return std::isfinite(
               PredictivePlanner(PlanningModel(finger()), reach(), options).plan(start).cost)
               ? 0
               : 3;
  });
  EXPECT_EQ(child.wait(), 0);
  EXPECT_TRUE(std::isfinite(planner->plan(start).cost));
}

TEST(OnlinePlanner, HasOrdinaryThreadsWhoeverMakesIt) {
  std::vector<int> policies;
  std::vector<std::string> refused;
  std::thread([&] {
    refused =
        enter_realtime({.priority = 1, .lock_memory = false, .heap = 0, .keep_cpus_awake = false});
    const std::vector<std::string> known = threads();
    PlannerOptions options = small_options();
    options.num_threads = 3;
    OnlinePlanner planner{PlanningModel(finger()), reach(), options};
    planner.set_state(planner.model().initial_state());
    planner.wait_for_plan(1, kWatchdog);
    policies = policies_of_others(known);
  }).join();
  if (!refused.empty()) GTEST_SKIP() << refused[0];
  // Its own thread and two more for the rollouts.
  EXPECT_EQ(policies, std::vector<int>(3, SCHED_OTHER));
}

}  // namespace
}  // namespace trifinger::control
