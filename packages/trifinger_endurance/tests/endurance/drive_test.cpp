// SPDX-License-Identifier: BSD-3-Clause
// Robots that are driven in simulated time, with and without faults.
#include "endurance/drive.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "boards/emulated_fault.hpp"
#include "endurance/simulated.hpp"
#include "support/soak.hpp"

namespace trifinger::apps {
namespace {

constexpr const char* kBoards = TRIFINGER_CONFIG_DIR "/trifinger_edu_emulated.yml";

struct Result {
  Outcome outcome;
  Tally tally;
  std::vector<Event> events;
  std::uint64_t injected{0};
};

Result drive(const SimulatedOptions& simulated, const DriveOptions& options) {
  const std::atomic<bool> stop{false};
  SimulatedPlace place(simulated, stop);
  Drive drive(place, place.session(), options, stop);
  Result result{
      .outcome = drive.run(), .tally = Tally(), .events = {}, .injected = place.num_injected()};
  result.tally = Tally(JointLayout(place.session().description()).joints());
  drive.take(result.tally, result.events);
  return result;
}

TEST(Drive, MovesCollidesAndMeasuresAndIsTheSameForTheSameSeed) {
  const SimulatedOptions robot{.robot = TRIFINGER_CONFIG_DIR "/sim.yml"};
  const DriveOptions options{.motion = {.seed = 1}, .most_steps = 60'000};
  const Result one = drive(robot, options);
  EXPECT_FALSE(one.outcome.needs_operator) << one.outcome.why;
  EXPECT_GE(one.tally.steps, 60'000U);
  EXPECT_GT(one.tally.collisions, 0U);
  EXPECT_EQ(one.tally.lateness.count(), one.tally.steps);
  for (const JointTally& joint : one.tally.joints) EXPECT_GT(joint.travel, 1.0);
  for (const JointTally& joint : one.tally.joints) EXPECT_GE(joint.passes, 1U);
  EXPECT_EQ(drive(robot, options).tally, one.tally);
}

TEST(Drive, GoesOnAfterEveryFaultThatAnEmulatedRobotCanHave) {
  const std::uint64_t kinds = num_faults_to_inject(true);
  const std::int64_t rounds = trifinger::test::repetitions(1, 20);
  const std::uint64_t every = 12'000;
  const Result result =
      drive({.robot = kBoards, .faults_every = every, .seed = 7},
            {.motion = {.seed = 7},
             .recovery = {.most_per_hour = 1e6},
             .most_steps = every * (kinds * static_cast<std::uint64_t>(rounds) + 1)});
  std::string told;
  for (const Event& event : result.events) told += event.text + "\n";
  EXPECT_FALSE(result.outcome.needs_operator) << result.outcome.why << "\n" << told;
  EXPECT_GE(result.injected, kinds);
  EXPECT_GT(result.tally.all_failures(), kinds / 3) << told;
  EXPECT_GT(result.tally.recoveries, 0U);
  EXPECT_GE(result.tally.sessions, result.tally.recoveries);
}

TEST(Drive, AsksForAHandIfAnInterfaceWasRemoved) {
  class Gone final : public Place {
   public:
    explicit Gone(const std::atomic<bool>& stop) : inner({.robot = kBoards}, stop) {}
    [[nodiscard]] UntypedFrontend connect() override { return inner.connect(); }
    void recover() override { inner.recover(); }
    void pause(Nanoseconds time) override { inner.pause(time); }
    [[nodiscard]] Nanoseconds now() const noexcept override { return inner.now(); }
    bool expect(std::uint64_t more) override {
      steps += more;
      if (steps > 9000 && !std::exchange(is_gone, true)) inner.add("bus 2 gone");
      return inner.expect(more);
    }
    SimulatedPlace inner;
    std::uint64_t steps{0};
    bool is_gone{false};
  };
  const std::atomic<bool> stop{false};
  Gone place(stop);
  Drive drive(place, place.inner.session(), {.recovery = {.attempts = 3}}, stop);
  const Outcome outcome = drive.run();
  EXPECT_TRUE(outcome.needs_operator);
  EXPECT_NE(outcome.why.find("3 attempts"), std::string::npos) << outcome.why;
}

TEST(InjectedFaults, AreUnderstoodOfAllKindsAndOverByThemselves) {
  std::set<boards::EmulatedFault::Kind> kinds;
  for (std::uint64_t number = 0; number < 20 * num_faults_to_inject(true); ++number) {
    const InjectedFault fault = fault_to_inject(number, 3, 6, 9);
    if (fault.kind != InjectedFault::Kind::kBoards) continue;
    const boards::EmulatedFault parsed = boards::parse_fault(fault.text);
    kinds.insert(parsed.kind);
    EXPECT_LT(parsed.number, 9U) << fault.text;
    using Kind = boards::EmulatedFault::Kind;
    const bool is_instant = parsed.kind == Kind::kBoardRestart ||
                            parsed.kind == Kind::kBoardRollover || parsed.kind == Kind::kBoardError;
    EXPECT_TRUE(is_instant || parsed.duration.has_value()) << fault.text;
  }
  // All but the return of the power, which ends one of them, and the interface that is gone for
  // ever. Errors of boards are those that go away by themselves.
  EXPECT_EQ(kinds.size(),
            static_cast<std::size_t>(boards::EmulatedFault::Kind::kJointsSwapped) - 1);
}

TEST(Drive, StopsWhenItIsTold) {
  std::atomic<bool> stop{false};
  SimulatedPlace place({.robot = TRIFINGER_CONFIG_DIR "/sim.yml"}, stop);
  Drive drive(place, place.session(), {}, stop);
  stop = true;
  EXPECT_FALSE(drive.run().needs_operator);
}

}  // namespace
}  // namespace trifinger::apps
