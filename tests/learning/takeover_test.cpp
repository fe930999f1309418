// SPDX-License-Identifier: BSD-3-Clause
#include "learning/takeover.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "learning/run_policy.hpp"
#include "support/allocation_counter.hpp"
#include "support/folder.hpp"
#include "support/session_folder.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/sim/simulation_options.hpp"

namespace trifinger::learning {
namespace {

constexpr Timeout kLong = std::chrono::seconds(120);
constexpr Nanoseconds kPeriod = std::chrono::milliseconds(1);

// Waits until `is_so`.
void wait_for(const std::function<bool()>& is_so) {
  const Deadline deadline(kLong);
  while (!is_so()) {
    ASSERT_FALSE(deadline.passed());
    std::this_thread::yield();
  }
}

// Its joints go to where they shall be, by 10 mrad per step.
class SlowJoints final : public Driver<Finger> {
 public:
  using Driver::apply_action;
  using Driver::get_latest_observation;
  using Driver::hold;

  [[nodiscard]] DriverReport get_latest_observation(Observation& observation) noexcept override {
    observation = state_;
    return DriverReport::ready();
  }
  [[nodiscard]] DriverReport apply_action(const Action& desired,
                                          AppliedAction& applied) noexcept override {
    applied.thermal_margin.fill(0.119);
    for (std::size_t i = 0; i < Finger::kJoints; ++i) {
      if (std::isnan(desired.position[i])) continue;
      state_.position[i] += std::clamp(desired.position[i] - state_.position[i], -0.01, 0.01);
    }
    return DriverReport::ready();
  }
  [[nodiscard]] DriverReport hold(const Observation& observation,
                                  Action& action) noexcept override {
    action = hold_position(observation);
    return DriverReport::ready();
  }

 private:
  Observation state_{.position = {0.0, 0.9, -1.7}};
};

RobotDescription finger() { return {.arrangement = Arrangement::kSingleFinger, .objects = {}}; }

JointLimits<3> limits() { return limits_of<3>(default_limits(finger())); }

// A robot that waits for actions, and a program that controls it.
class Takeovers : public ::testing::Test {
 protected:
  [[nodiscard]] static std::string session() { return Takeover<Finger>::name_for("r"); }
  [[nodiscard]] static Finger::Action to(double position) {
    return Finger::Action::of_position({position, 0.9, -1.7});
  }

  test::SessionFolder folder_;
  SlowJoints driver_;
  SessionHost host_ = SessionHost::named("r");
  Backend backend_{driver_, host_, {.period = kPeriod}};
  BackendThread thread_{backend_};
  Frontend<Finger> robot_{host_};
};

// ---- the session ----

TEST_F(Takeovers, HandOverWhatAPersonDoesUntilThatLetsGo) {
  Takeover<Finger> takeover(robot_.session(), limits());
  for (int i = 1; i <= 3; ++i) {
    auto person = connect<Finger>(session());
    EXPECT_EQ(person.latest_observation().position, robot_.latest_observation().position);
    EXPECT_EQ(takeover.newest(), nullptr);
    (void)person.append_desired_action(to(0.1 * i));
    wait_for([&] { return takeover.newest() != nullptr; });
    EXPECT_EQ(takeover.newest()->position[0], 0.1 * i);
    person.finish(kLong);
    wait_for([&] { return takeover.newest() == nullptr; });
  }
}

TEST_F(Takeovers, ShowWhatTheRobotMeasures) {
  Takeover<Finger> takeover(robot_.session(), limits());
  auto person = connect<Finger>(session());
  TimeIndex t = person.append_desired_action(to(0.2));
  (void)robot_.append_desired_action(to(0.3));
  wait_for([&] {
    t = person.append_desired_action(to(0.2));
    return person.get_observation(t).position[0] == 0.01;
  });
}

TEST_F(Takeovers, TakeNoActionThatTheRobotWouldReject) {
  Takeover<Finger> takeover(robot_.session(), limits());
  auto person = connect<Finger>(session());
  Finger::Action action = to(0.2);
  (void)person.append_desired_action(action);
  action.position_kp[1] = -1.0;
  const TimeIndex t = person.append_desired_action(action);
  EXPECT_EQ(person.get_status(t, kLong).rejected_actions, 1U);
  ASSERT_NE(takeover.newest(), nullptr);
  EXPECT_TRUE(std::isnan(takeover.newest()->position_kp[1]));
}

TEST_F(Takeovers, AreReadyForTheNextPersonAfterOneWhoHangs) {
  ManualClock clock;
  {
    Takeover<Finger> takeover(robot_.session(), limits(), {.demand = Demand::kOff}, clock);
    clock.tick(kPeriod);
    auto person = connect<Finger>(session());
    (void)person.append_desired_action(to(0.2));
    clock.tick(kPeriod, 500);
    EXPECT_NE(takeover.newest(), nullptr);
    clock.tick(kPeriod, 10);
    EXPECT_EQ(takeover.newest(), nullptr);
    ASSERT_TRUE(person.fault());
    EXPECT_EQ(person.fault()->code, Fault::Code::kActionLate);
    auto next = connect<Finger>(session());
    (void)next.append_desired_action(to(0.4));
    clock.tick(kPeriod, 2);
    ASSERT_NE(takeover.newest(), nullptr);
    EXPECT_EQ(takeover.newest()->position[0], 0.4);
    clock.run_free();
  }
}

TEST_F(Takeovers, AreOfferedByOneProcessOnly) {
  const Takeover<Finger> takeover(robot_.session(), limits());
  EXPECT_THROW(Takeover<Finger>(robot_.session(), limits()), RobotOwned);
}

// ---- a policy and a person ----

struct Case {
  ActionKind action{ActionKind::kPosition};
  Mapping mapping{Mapping::kApproximation};
};

class Runs : public Takeovers {
 protected:
  // Lets a policy act that asks for no action at all: the middle of its range, or no change.
  std::optional<NeedsCare> run(const PolicyRunOptions& options, Takeover<Finger>* takeover,
                               const Case& its = {}) {
    EnvironmentOptions chosen = default_options("finger_reach");
    chosen.action = its.action;
    chosen.mapping = its.mapping;
    chosen.steps_per_action = 10;
    chosen.duration = 0.2;
    const Environment environment("finger_reach", chosen, finger());
    const auto inputs = static_cast<Eigen::Index>(environment.observation_size());
    const std::filesystem::path path = files_.path() / "p.policy";
    Policy({.layers = {{.weights = Eigen::MatrixXf::Zero(3, inputs),
                        .bias = Eigen::VectorXf::Zero(3)}}})
        .save(path);
    PolicySource source(path, Precision::kSingle, [](const std::string&) {});
    return run_policy(robot_, environment, source, options, takeover);
  }

  test::Folder files_;
};

TEST_F(Runs, LetAPersonActInPlaceOfThePolicyWithoutAllocation) {
  for (const Case& its : {Case{ActionKind::kPosition, Mapping::kApproximation},
                          Case{ActionKind::kPosition, Mapping::kStateAugmentation},
                          Case{ActionKind::kPositionChange, Mapping::kApproximation},
                          Case{ActionKind::kRelativePosition, Mapping::kApproximation},
                          Case{ActionKind::kTorque, Mapping::kStateAugmentation}}) {
    Takeover<Finger> takeover(robot_.session(), limits());
    std::atomic<bool> stop{false};
    std::optional<test::AllocationCounter> allocations;
    std::atomic<int> with_person{0};  // episodes
    std::atomic<int> alone{0};
    std::jthread person([&] {
      for (int turn = 1; turn <= 2; ++turn) {
        auto control = connect<Finger>(session());
        wait_for([&] {
          const TimeIndex t = control.append_desired_action(to(0.5));
          return control.get_observation(t).position[0] == 0.5 && with_person >= turn;
        });
        control.finish(kLong);
        const int before = alone;
        wait_for([&] { return alone > before; });
      }
      stop.store(true);
    });
    std::size_t allocated = 0;
    (void)run({.episodes = 1'000'000,
               .stop = &stop,
               .on_episode =
                   [&](const EpisodeReport& report) {
                     if (allocations) allocated += allocations->count();
                     EXPECT_EQ(report.actions, 20);
                     EXPECT_EQ(report.repeated_steps, 0);
                     ++(report.interventions > 0 ? with_person : alone);
                     allocations.emplace();
                   },
               .approach_every = 3},
              &takeover, its);
    EXPECT_EQ(allocated, 0U);
    robot_ = Frontend<Finger>(host_);
  }
}

TEST_F(Runs, EndNoEpisodeByAVerdictThatCameBefore) {
  std::atomic<Verdict> verdict{Verdict::kSuccess};  // of no episode
  std::vector<EpisodeReport> reports;
  (void)run({.episodes = 3,
             .on_episode = [&](const EpisodeReport& report) { reports.push_back(report); },
             .verdict = &verdict},
            nullptr);
  ASSERT_EQ(reports.size(), 3U);
  for (const EpisodeReport& report : reports) {
    EXPECT_EQ(report.actions, 20);
    EXPECT_TRUE(report.outcome.truncated);
    EXPECT_FALSE(report.outcome.success);
    EXPECT_EQ(report.total_reward, 0.0);
  }
}

TEST_F(Runs, EndAnEpisodeInSuccessIfSomebodySaysSo) {
  std::atomic<Verdict> verdict{Verdict::kNone};
  std::atomic<bool> stop{false};
  EpisodeReport last;
  const std::jthread judge([&] {
    wait_for([&] {
      verdict.store(Verdict::kSuccess);
      return stop.load();
    });
  });
  (void)run({.episodes = 1'000'000,
             .stop = &stop,
             .on_episode =
                 [&](const EpisodeReport& report) {
                   last = report;
                   if (report.outcome.success) stop.store(true);
                 },
             .verdict = &verdict},
            nullptr);
  EXPECT_TRUE(last.outcome.success);
  EXPECT_TRUE(last.outcome.terminated);
  EXPECT_FALSE(last.outcome.truncated);
  EXPECT_EQ(last.total_reward, 1.0);
}

TEST_F(Runs, EndWhenTheMotorsAreWarm) {
  std::vector<EpisodeReport> reports;
  const auto care =
      run({.episodes = 3,
           .on_episode = [&](const EpisodeReport& report) { reports.push_back(report); },
           .rest_below = 0.2},
          nullptr);
  EXPECT_EQ(reports.size(), 1U);
  ASSERT_TRUE(care);
  EXPECT_EQ(care->kind, NeedsCare::Kind::kWarmMotors);
  EXPECT_EQ(care->text, "the motors are warm: thermal margin 0.12");
}

TEST_F(Runs, GoOnWhileTheMotorsAreColdEnough) {
  EXPECT_FALSE(run({.episodes = 3, .rest_below = 0.1}, nullptr));
}

}  // namespace
}  // namespace trifinger::learning
