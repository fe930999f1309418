// SPDX-License-Identifier: BSD-3-Clause
// A robot on six CAN interfaces of a kernel, as users start it. ./run check runs this in a virtual
// machine (tools/can_machine.py). It takes interfaces down, so it runs only where
// TRIFINGER_TEST_MACHINE is set.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "boards/board_robot.hpp"
#include "boards/rig.hpp"
#include "machine/candump.hpp"
#include "machine/robot.hpp"
#include "support/message_of.hpp"

namespace trifinger::test {
namespace {

using ::testing::AnyOf;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Joints = JointVector<9>;

constexpr std::size_t kBoards = 6;
constexpr Joints kStart{0.0, 0.9, -1.7, 0.0, 0.9, -1.7, 0.0, 0.9, -1.7};  // [rad]
constexpr Joints kGoal{0.2, 0.7, -1.5, 0.2, 0.7, -1.5, 0.2, 0.7, -1.5};   // [rad]
constexpr double kReached = 0.05;                                         // [rad]

bool is_this_the_machine() { return std::getenv("TRIFINGER_TEST_MACHINE") != nullptr; }

std::string bus(std::size_t board) { return "vcan" + std::to_string(board); }

// Half a second from one pose to another, and some time to arrive.
std::vector<TriFinger::Action> motion(const Joints& from, const Joints& to) {
  constexpr int kSteps = 700;
  std::vector<TriFinger::Action> actions;
  for (int step = 1; step <= kSteps; ++step) {
    const double done = std::min(step / (0.7 * kSteps), 1.0);
    Joints target{};
    for (std::size_t i = 0; i < target.size(); ++i) target[i] = from[i] + done * (to[i] - from[i]);
    actions.push_back(TriFinger::Action::of_position(target));
  }
  return actions;
}

std::vector<TriFinger::Action> hold(const Joints& pose, std::size_t steps) {
  return std::vector(steps, TriFinger::Action::of_position(pose));
}

double distance(const Joints& one, const Joints& other) {
  double largest = 0.0;
  for (std::size_t i = 0; i < one.size(); ++i) {
    largest = std::max(largest, std::abs(one[i] - other[i]));
  }
  return largest;
}

// A robot homes, moves, and is stopped. The tests ask what its user and candump have seen.
class MotionOverSocketCan : public ::testing::Test {
 protected:
  struct Story {
    RobotOnBoards robot;
    Candump commands{"any,0:7F8"};  // from the beginning to the end
    std::optional<Candump> motion;  // of all frames while the robot moves
    std::vector<TriFinger::Observation> observations;
    std::vector<TriFinger::AppliedAction> applied;
    Status last;
    int exit_code{-1};
  };

  static void SetUpTestSuite() {
    if (!is_this_the_machine()) return;
    Story& story = story_.emplace();
    story.robot.start_boards();
    story.robot.start_driver();
    story.motion.emplace("any");
    {
      auto user = RobotOnBoards::connect();
      const TimeIndex end = user.append_desired_actions(motion(kStart, kGoal));
      user.finish();
      story.observations.resize(static_cast<std::size_t>(end) + 1);
      user.get_observations(0, story.observations);
      story.applied.resize(story.observations.size());
      user.get_applied_actions(0, story.applied);
      story.last = user.get_status(end);
    }
    story.motion->dismiss();
    story.exit_code = story.robot.stop_driver();
    story.commands.dismiss();
  }
  static void TearDownTestSuite() { story_.reset(); }

  void SetUp() override {
    if (!is_this_the_machine()) GTEST_SKIP() << "needs a machine of its own";
    ASSERT_TRUE(story_ && story_->exit_code >= 0) << "the robot did not get so far";
  }

  // What the host has sent to a board from the beginning to the end.
  static std::vector<std::string> commands(std::size_t board) {
    return story_->commands.frames(bus(board));
  }
  // The frames with an identifier, in three digits, on the bus of a board while the robot moved.
  static std::vector<std::string> frames(std::size_t board, const std::string& id) {
    std::vector<std::string> found = story_->motion->frames(bus(board));
    std::erase_if(found, [&id](const std::string& frame) { return !frame.starts_with(id + '#'); });
    return found;
  }

  static std::optional<Story> story_;  // NOLINT(readability-identifier-naming)
};

std::optional<MotionOverSocketCan::Story> MotionOverSocketCan::story_;

TEST_F(MotionOverSocketCan, BeginsWhereHomingEndsAndFollowsTheActions) {
  EXPECT_LT(distance(story_->observations.front().position, kStart), kReached);
  EXPECT_LT(distance(story_->observations.back().position, kGoal), kReached);
  EXPECT_EQ(story_->exit_code, 0);
}

TEST_F(MotionOverSocketCan, StartsEachBoardAsTheOriginalHostDoes) {
  for (std::size_t board = 0; board < kBoards; ++board) {
    std::vector<std::string> first = commands(board);
    ASSERT_GE(first.size(), 6U);
    first.resize(6);
    EXPECT_THAT(first, ElementsAre("005#0000000000000000",    // no current
                                   "000#0000000A0000001E",    // without currents 10 ms at most
                                   "000#0000000100000001",    // enable the system
                                   "000#0000000100000014",    // send everything
                                   "000#0000000100000002",    // enable motor 1
                                   "000#0000000100000003"));  // enable motor 2
  }
}

TEST_F(MotionOverSocketCan, SwitchesEachBoardOffInTheEnd) {
  for (std::size_t board = 0; board < kBoards; ++board) {
    std::vector<std::string> last = commands(board);
    ASSERT_GE(last.size(), 2U);
    last.erase(last.begin(), last.end() - 2);
    EXPECT_THAT(last, ElementsAre("005#0000000000000000", "000#0000000000000001"));
  }
}

// What candump writes for the currents of these torques. This computes it anew, without our code.
std::string currents_frame(const Joints& torque, std::size_t board) {
  constexpr boards::BoardMotor kMotor;
  std::array<unsigned, 2> words{};
  for (std::size_t joint = 0; joint < torque.size(); ++joint) {
    const boards::Terminal motor = boards::test::trifinger_motor(joint);
    if (motor.board != board) continue;
    const double amperes = torque[joint] / kMotor.torque_per_ampere();
    words[motor.number] = static_cast<unsigned>(std::lround(amperes * (1 << 24)));
  }
  std::array<char, 24> text{};
  std::snprintf(text.data(), text.size(), "005#%08X%08X", words[0], words[1]);
  return text.data();
}

TEST_F(MotionOverSocketCan, PutsTheTorquesOfEveryStepOnTheBusOnceAndInOrder) {
  for (std::size_t board = 0; board < kBoards; ++board) {
    std::string expected;
    for (const auto& applied : story_->applied) expected += currents_frame(applied.torque, board);
    std::string seen;
    for (const std::string& frame : frames(board, "005")) seen += frame;
    EXPECT_NE(seen.find(expected), std::string::npos) << "board " << board;
  }
}

// The velocity of a joint, which candump has seen as "040#...".
double velocity(const std::string& frame, std::size_t motor) {
  constexpr boards::BoardMotor kMotor;
  const auto word = static_cast<std::uint32_t>(std::stoul(frame.substr(4 + 8 * motor, 8), {}, 16));
  const double kilo_rpm = static_cast<std::int32_t>(word) / double{1 << 24};
  return kilo_rpm * 1000.0 / 60.0 * 2.0 * std::numbers::pi / kMotor.gear_ratio;
}

TEST_F(MotionOverSocketCan, MeasuresWhatWasOnTheBusInOrder) {
  for (std::size_t joint = 0; joint < 9; ++joint) {
    const boards::Terminal motor = boards::test::trifinger_motor(joint);
    const auto seen = frames(motor.board, "040");
    auto next = seen.begin();
    for (const auto& observation : story_->observations) {
      next = std::find_if(next, seen.end(), [&](const std::string& frame) {
        return std::abs(velocity(frame, motor.number) - observation.velocity[joint]) < 1e-9;
      });
    }
    EXPECT_NE(next, seen.end()) << "joint " << joint;
  }
}

TEST_F(MotionOverSocketCan, fault_37_LosesNoFrame) {
  EXPECT_EQ(story_->last.lost_frames, 0U);
  for (std::size_t board = 0; board < kBoards; ++board) {
    const std::array counts{frames(board, "020").size(), frames(board, "030").size(),
                            frames(board, "040").size(), frames(board, "050").size()};
    EXPECT_GE(counts[0], story_->observations.size());
    // A candump may have been started or ended between two frames.
    EXPECT_THAT(counts, Each(AnyOf(counts[0] - 1, counts[0], counts[0] + 1)));
  }
}

// A robot that runs; each test begins with a robot that holds its pose.
class FaultsOfSocketCan : public ::testing::Test {
 protected:
  static void TearDownTestSuite() { robot_.reset(); }

  void SetUp() override {
    if (!is_this_the_machine()) GTEST_SKIP() << "needs a machine of its own";
    if (robot_) return;
    robot_.emplace();
    robot_->start_boards();
    robot_->start_driver();
  }
  void TearDown() override {
    if (HasFailure()) robot_.reset();
  }

  static void set(std::size_t board, const std::string& state) {
    ASSERT_EQ(run({"ip", "link", "set", bus(board), state}), 0);
  }

  // Moves, lets `disturb` happen in the middle, and returns what the session ended with.
  template <class Function>
  static std::string fault_after(const Function& disturb) {
    auto user = RobotOnBoards::connect();
    user.append_desired_actions(motion(user.latest_observation().position, kGoal));
    user.append_desired_actions(hold(kGoal, 3000));
    user.wait_until_time_index(100);
    disturb();
    return message_of<RobotStopped>([&user] {
      user.finish();
      return 0;
    });
  }

  static void expect_motion() {
    auto user = RobotOnBoards::connect();
    const Joints start = user.latest_observation().position;
    const TimeIndex end = user.append_desired_actions(motion(start, kGoal));
    user.finish();
    EXPECT_LT(distance(user.get_observation(end).position, kGoal), kReached);
  }

  static std::optional<RobotOnBoards> robot_;  // NOLINT(readability-identifier-naming)
};

std::optional<RobotOnBoards> FaultsOfSocketCan::robot_;

TEST_F(FaultsOfSocketCan, fault_40_AnInterfaceThatIsDownIsNamedAndTheRobotRecovers) {
  EXPECT_THAT(fault_after([] { set(3, "down"); }),
              HasSubstr("board 3 (vcan3, joint 3): its CAN interface is down; bring it up"));
  set(3, "up");
  ASSERT_EQ(RobotOnBoards::recover(), 0);
  expect_motion();
}

TEST_F(FaultsOfSocketCan, fault_42_BoardsThatAreSilentAreNamedAndTheRobotRecovers) {
  EXPECT_THAT(fault_after([] { robot_->kill_boards(); }),
              HasSubstr("board 0 (vcan0, joints 1 and 2): no measurements come; check its supply"));
  robot_->start_boards();
  ASSERT_EQ(RobotOnBoards::recover(), 0);
  expect_motion();
}

TEST_F(FaultsOfSocketCan, ASecondHostIsNamedAndTheRobotRecovers) {
  const auto command = [] {
    for (int i = 0; i < 10; ++i) EXPECT_EQ(run({"cansend", bus(2), "005#0000000000000000"}), 0);
  };
  EXPECT_THAT(fault_after(command), HasSubstr("board 2 (vcan2, joints 4 and 5): somebody else "
                                              "sends commands on its bus; end the other program"));
  ASSERT_EQ(RobotOnBoards::recover(), 0);
  expect_motion();
}

TEST_F(FaultsOfSocketCan, fault_41_AFloodDoesNotDisturbTheRobot) {
  Folder folder;
  Program flood({"cangen", bus(1), "-I", "7FF", "-L", "8", "-g", "0", "-i"}, folder / "flood");
  const auto frames = [] { return run({"candump", "-n", "1000", "vcan1,7FF:7FF"}); };
  EXPECT_EQ(frames(), 0);  // it has begun
  expect_motion();
  EXPECT_EQ(frames(), 0);  // and goes on
}

// An interface goes down before it is removed, so only the next try tells the rest.
TEST_F(FaultsOfSocketCan, fault_40_AnInterfaceThatIsRemovedIsNamedAndTheRobotStartsAgain) {
  const auto unplug = [] { EXPECT_EQ(run({"ip", "link", "del", bus(5)}), 0); };
  EXPECT_THAT(fault_after(unplug), HasSubstr("board 5 (vcan5, joint 6): its CAN interface "));
  EXPECT_THAT(message_of<RobotStopped>([] {
                trifinger::recover(RobotOnBoards::kName, std::chrono::minutes(2));
                return RobotOnBoards::connect();
              }),
              HasSubstr("board 5 (vcan5, joint 6): its CAN interface was removed; plug it in, then "
                        "start the robot again"));
  EXPECT_EQ(robot_->stop_driver(), 0);
  robot_->kill_boards();
  ASSERT_EQ(run({"ip", "link", "add", "dev", bus(5), "type", "vcan"}), 0);
  set(5, "up");
  robot_->start_boards();
  robot_->start_driver();
  expect_motion();
}

}  // namespace
}  // namespace trifinger::test
