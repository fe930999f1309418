// SPDX-License-Identifier: BSD-3-Clause
#include "boards/emulated_fault.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <map>
#include <span>
#include <sstream>
#include <string>

#include "rig.hpp"
#include "support/message_of.hpp"

namespace trifinger::boards::test {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using trifinger::test::message_of;
using Kind = EmulatedFault::Kind;
using State = DriverReport::State;

// ---- texts ----

TEST(ParseFault, ReadsKindNumbersAndTimes) {
  EXPECT_EQ(parse_fault("board 3 silent at 5 s for 0.2 s"),
            (EmulatedFault{.kind = Kind::kBoardSilent, .number = 3, .at = 5s, .duration = 200ms}));
  EXPECT_EQ(parse_fault("  bus 0 loses 1%  at 2s"),
            (EmulatedFault{.kind = Kind::kBusLoses, .amount = 0.01, .at = 2s}));
  EXPECT_EQ(parse_fault("joints 1 and 2 swapped"),
            (EmulatedFault{.kind = Kind::kJointsSwapped, .number = 1, .other = 2}));
  EXPECT_EQ(
      parse_fault("board 1 error encoder at 3 s"),
      (EmulatedFault{
          .kind = Kind::kBoardError, .number = 1, .error = can::BoardError::kEncoder, .at = 3s}));
  EXPECT_EQ(
      parse_fault("bus 2 delays 10 % by 0.003 s for 1 s"),
      (EmulatedFault{
          .kind = Kind::kBusDelays, .number = 2, .amount = 0.1, .time = 3ms, .duration = 1s}));
  EXPECT_EQ(parse_fault("emergency stop for 2 s"),
            (EmulatedFault{.kind = Kind::kPowerOff, .duration = 2s}));
}

// Each text of the help, with values in place of the capitals.
TEST(ParseFault, UnderstandsEveryTextThatTheHelpShows) {
  const std::map<std::string, std::string> values{{"N", "1"},    {"M", "2"},        {"P", "5"},
                                                  {"R", "1000"}, {"A", "1"},        {"F", "2"},
                                                  {"T", "0.5"},  {"ERROR", "other"}};
  std::istringstream lines(fault_texts());
  int count = 0;
  for (std::string line; std::getline(lines, line); ++count) {
    std::erase_if(line, [](char c) { return c == '[' || c == ']'; });
    std::istringstream words(line);
    std::string text;
    for (std::string word; words >> word;) {
      const auto value = values.find(word);
      text += (text.empty() ? "" : " ") + (value != values.end() ? value->second : word);
    }
    EXPECT_EQ(parse_fault(text).at, 500ms) << text;
  }
  EXPECT_GE(count, 20);
}

TEST(ParseFault, NamesTheWordThatItDoesNotUnderstand) {
  const auto error = [](const char* text) {
    return message_of<InvalidArgument>([text] { return parse_fault(text); });
  };
  EXPECT_EQ(error("board 3 slient"),
            "fault 'board 3 slient': 'slient' is not understood after '3'; did you mean 'silent'; "
            "expected is 'off', 'restarts', 'near', 'silent' or 'error'");
  EXPECT_EQ(error("board x silent"),
            "fault 'board x silent': 'x' is not understood after 'board'; expected is a whole "
            "number from 0 to 99");
  EXPECT_EQ(error("bus 1 loses 101 %"),
            "fault 'bus 1 loses 101 %': '101' is not understood after 'loses'; expected is a share "
            "from 0 to 100");
  EXPECT_EQ(error("board 3"),
            "fault 'board 3': something is missing at its end; expected is 'off', 'restarts', "
            "'near', 'silent' or 'error'");
  EXPECT_THAT(error(""), HasSubstr("something is missing at its end; expected is 'power'"));
  EXPECT_THAT(error("board 1 error fire"), HasSubstr("expected is 'encoder'"));
  EXPECT_THAT(error("board 1 restarts for 2 s"), HasSubstr("'for' is not understood"));
  EXPECT_THAT(error("joint 1 stuck for -1 s"), HasSubstr("a time in seconds"));
  EXPECT_THAT(error("joint 1 jumps by nan rad"), HasSubstr("an angle"));
  EXPECT_THAT(error("joint 1 stuck at 1 s at 2 s"), HasSubstr("expected is 'for'"));
}

TEST(EmulatedFaults, ABoardOrJointThatDoesNotExistIsRefused) {
  Rig<TwoJoints> rig;
  const auto error = [&](const char* text) {
    return message_of<InvalidArgument>(
        [&] { rig.emulator->add(parse_fault(text), rig.clock.now()); });
  };
  EXPECT_EQ(error("board 1 silent"), "there is no board 1, only 0 to 0");
  EXPECT_EQ(error("bus 6 down"), "there is no bus 6, only 0 to 0");
  EXPECT_EQ(error("joints 1 and 2 swapped"), "there is no joint 2, only 0 to 1");
}

// ---- what the driver says ----

struct Case {
  const char* fault;
  const char* sentence;  // empty: the robot goes on
  int within;            // [ms]
};

std::ostream& operator<<(std::ostream& out, const Case& tried) { return out << tried.fault; }

template <class R>
void expect_sentence(const Case& tried, Rig<R>& rig) {
  ASSERT_EQ(rig.prepare().state, State::kReady);
  JointVector<R::kJoints> pose{};
  pose.fill(0.3);
  auto action = R::Action::of_position(pose);
  for (int i = 0; i < 200; ++i) ASSERT_EQ(rig.step(action).state, State::kReady);
  rig.emulator->add(parse_fault(tried.fault), rig.clock.now());
  std::string text;
  for (int ms = 1; ms <= tried.within && text.empty(); ++ms) {
    // It moves, so that an encoder can be caught.
    action.position.fill(0.3 + 0.2 * std::sin(0.01 * ms));
    const DriverReport report = rig.step(action);
    if (report.state == State::kFault) text = rig.robot->fault_text(report.fault_code);
  }
  if (*tried.sentence == '\0') {
    EXPECT_EQ(text, "");
    return;
  }
  EXPECT_THAT(text, HasSubstr(tried.sentence));
  for (TimeIndex i = 0; rig.robot->stop(i).state == State::kBusy; ++i) rig.pass();
}

class FaultByText : public ::testing::TestWithParam<Case> {};

TEST_P(FaultByText, IsWhatTheRobotNoticesAndNothingElse) {
  Rig<TriFinger> rig;
  expect_sentence(GetParam(), rig);
}

INSTANTIATE_TEST_SUITE_P(
    OfBuses, FaultByText,
    ::testing::Values(Case{"bus 2 loses 5 %", "", 500}, Case{"bus 2 duplicates 50 %", "", 500},
                      Case{"bus 2 delays 20 % by 0.002 s", "", 500},
                      Case{"bus 2 corrupts 10 %", "joint", 2000},
                      Case{"bus 1 flooded with 3000 frames/s", "", 300},
                      Case{"board 3 silent", "board 3 (can3, joint 3): no measurements come", 10},
                      Case{"bus 4 down", "board 4 (can4, joints 7 and 8)", 10},
                      Case{"board 2 restarts", "board 2 (can2", 1500},
                      Case{"power off", "no measurements come", 10},
                      Case{"board 5 error temperature", "board 5 (can5", 1500}));

INSTANTIATE_TEST_SUITE_P(OfJoints, FaultByText,
                         ::testing::Values(Case{"joint 4 jumps by 0.3 rad", "joint 4", 50},

                                           Case{"joint 3 noisy by 0.2 rad", "joint 3", 500}));

TEST(EmulatedFaults, fault_45_AnEncoderThatStandsStillIsFoundUnderTorque) {
  auto options = options_of_tests<TwoJoints>();
  Rig<TwoJoints> rig(options);
  expect_sentence({"joint 1 stuck", "joint 1", 3000}, rig);
}

TEST(EmulatedFaults, fault_45_AJumpOrNoiseOfAnEncoderIsFound) {
  {
    Rig<TwoJoints> rig;
    expect_sentence({"joint 0 jumps by 0.5 rad", "joint 0", 50}, rig);
  }
  Rig<TwoJoints> rig;
  expect_sentence({"joint 1 noisy by 0.3 rad", "joint 1", 500}, rig);
}

TEST(EmulatedFaults, fault_46_PositionsGoOnAcrossTheRolloverOfABoard) {
  Rig<TwoJoints> rig;
  rig.emulator->add(parse_fault("board 0 near rollover"), rig.clock.now());
  ASSERT_EQ(rig.prepare().state, State::kReady);
  auto action = TwoJoints::Action::of_position({-0.9, 0.9});
  for (int i = 0; i < 1500; ++i) ASSERT_EQ(rig.step(action).state, State::kReady);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(rig.observation.position[i], rig.joints.position()[i], 0.005);
  }
}

TEST(EmulatedFaults, fault_47_AMotorThatGetsTooMuchCurrentIsTooHot) {
  auto options = options_of_tests<TwoJoints>();
  for (auto& limit : options.limits) limit.thermal_time = 1.3;
  Rig<TwoJoints> rig(options);
  ASSERT_EQ(rig.prepare().state, State::kReady);
  rig.emulator->add(parse_fault("joint 1 draws 2 times the current"), rig.clock.now());
  rig.joints.is_blocked = true;
  TwoJoints::Action action;
  action.torque = {0.0, 0.3};
  std::string text;
  double least = 1.0;
  for (int ms = 0; ms < 10'000 && text.empty(); ++ms) {
    const DriverReport report = rig.step(action);
    if (report.state == State::kFault) text = rig.robot->fault_text(report.fault_code);
    least = std::min(least, rig.applied.thermal_margin[1]);
  }
  EXPECT_THAT(text, HasSubstr("joint 1"));
  EXPECT_LT(least, 0.2);
}

TEST(EmulatedFaults, fault_49_AJointWhoseMotorIsLooseDoesNotFindItsEndStop) {
  auto options = options_of_tests<TwoJoints>();
  options.max_travel = 3.0;
  Rig<TwoJoints> rig(options);
  rig.emulator->add(parse_fault("joint 1 loose"), rig.clock.now());
  const DriverReport report = rig.prepare();
  ASSERT_EQ(report.state, State::kFault);
  EXPECT_THAT(std::string(rig.robot->fault_text(report.fault_code)),
              ::testing::AllOf(HasSubstr("joint 1"), HasSubstr("did not find its end stop")));
}

// What a self-test has to find: the current of one joint moves another one, or the wrong way.
TEST(EmulatedFaults, fault_50_SwappedReversedAndLooseMotorsMoveWhatTheyShouldNot) {
  const auto turned = [](const char* fault) {
    auto options = options_of_tests<TwoJoints>();
    set_method(options, HomingMethod::kHere);
    set_home_position(options, 0.0);
    options.initial_position.assign(2, 0.0);
    Rig<TwoJoints> rig(options);
    rig.joints.weight = 0.0;
    if (*fault != '\0') rig.emulator->add(parse_fault(fault), rig.clock.now());
    EXPECT_EQ(rig.prepare().state, State::kReady);
    const std::array before{rig.joints.position()[0], rig.joints.position()[1]};
    TwoJoints::Action action;
    action.torque = {0.02, 0.0};
    for (int i = 0; i < 60; ++i) static_cast<void>(rig.step(action));
    const std::span<const double> after = rig.joints.position();
    return JointVector<2>{after[0] - before[0], after[1] - before[1]};
  };
  EXPECT_GT(turned("")[0], 0.005);
  EXPECT_NEAR(turned("")[1], 0.0, 1e-6);
  EXPECT_LT(turned("joint 0 reversed")[0], -0.005);
  EXPECT_NEAR(turned("joints 0 and 1 swapped")[0], 0.0, 1e-6);
  EXPECT_GT(turned("joints 0 and 1 swapped")[1], 0.005);
  EXPECT_NEAR(turned("joint 0 loose")[0], 0.0, 1e-6);
}

TEST(EmulatedFaults, BeginAndEndAtTheirTimes) {
  Rig<TwoJoints> rig;
  rig.emulator->add(parse_fault("joint 0 jumps by 1 rad at 0.005 s for 0.003 s"), rig.clock.now());
  rig.emulator->add(parse_fault("power off at 0.004 s for 0.1 s"), rig.clock.now());
  using Phase = ScheduledFault::Phase;
  std::vector<Phase> phases;
  for (int ms = 1; ms <= 9; ++ms) {
    rig.pass();
    phases.push_back(rig.emulator->faults()[0].phase);
    EXPECT_EQ(rig.emulator->board(0).is_on(), ms < 4) << ms;
  }
  EXPECT_EQ(phases,
            (std::vector{Phase::kWaits, Phase::kWaits, Phase::kWaits, Phase::kWaits, Phase::kLasts,
                         Phase::kLasts, Phase::kLasts, Phase::kIsOver, Phase::kIsOver}));
  for (int ms = 10; ms <= 104; ++ms) rig.pass();
  EXPECT_TRUE(rig.emulator->board(0).is_on());
}

}  // namespace
}  // namespace trifinger::boards::test
