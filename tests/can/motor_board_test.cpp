// SPDX-License-Identifier: BSD-3-Clause
#include "can/motor_board.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <set>
#include <string>

#include "can/position_unwrapper.hpp"

namespace trifinger::can::test {
namespace {

// The frame as candump shows it: "005#0100000000800000".
std::string text_of(const Frame& frame) {
  std::array<char, 8> hex{};
  std::snprintf(hex.data(), hex.size(), "%03X#", static_cast<unsigned>(frame.id));
  std::string text = hex.data();
  for (std::size_t i = 0; i < frame.dlc; ++i) {
    std::snprintf(hex.data(), hex.size(), "%02X", static_cast<unsigned>(frame.data[i]));
    text += hex.data();
  }
  return text;
}

// A frame from what candump shows.
Frame frame_of(const std::string& text) {
  Frame frame{.id = static_cast<std::uint32_t>(std::stoul(text.substr(0, 3), nullptr, 16))};
  for (std::size_t i = 4; i < text.size(); i += 2) {
    frame.data[frame.dlc++] = static_cast<std::uint8_t>(std::stoul(text.substr(i, 2), nullptr, 16));
  }
  return frame;
}

TEST(MotorBoardFrames, ToTheBoardAreTheseBytes) {
  EXPECT_EQ(text_of(encode(DesiredCurrents{})), "005#0000000000000000");
  EXPECT_EQ(text_of(encode(DesiredCurrents{{1.0, -0.5}})), "005#01000000FF800000");
  EXPECT_EQ(text_of(encode(BoardCommand{Command::kSetReceiveTimeout, 0})), "000#000000000000001E");
  EXPECT_EQ(text_of(encode(BoardCommand{Command::kSetReceiveTimeout, 10})), "000#0000000A0000001E");
  EXPECT_EQ(text_of(encode(BoardCommand{Command::kEnableSystem, 1})), "000#0000000100000001");
  EXPECT_EQ(text_of(encode(BoardCommand{Command::kSendAll, 1})), "000#0000000100000014");
  EXPECT_EQ(text_of(encode(BoardCommand{Command::kEnableMotor1, 1})), "000#0000000100000002");
  EXPECT_EQ(text_of(encode(BoardCommand{Command::kEnableMotor2, 1})), "000#0000000100000003");
}

TEST(MotorBoardFrames, FromTheBoardAreTheseBytes) {
  const BoardStatus running{
      .system_enabled = true,
      .motors{{{.enabled = true, .ready = true}, {.enabled = true, .ready = true}}}};
  EXPECT_EQ(text_of(encode(running)), "010#1F");
  const BoardStatus aligning{.system_enabled = true, .motors{{{.enabled = true}, {}}}};
  EXPECT_EQ(text_of(encode(aligning)), "010#03");
  EXPECT_EQ(text_of(encode(BoardStatus{.error = BoardError::kReceiveTimeout})), "010#40");
  EXPECT_EQ(text_of(encode(MotorCurrents{{0.25, -2.0}})), "020#00400000FE000000");
  EXPECT_EQ(text_of(encode(MotorPositions{{100.0, -100.0}})), "030#640000009C000000");
  EXPECT_EQ(text_of(encode(MotorVelocities{{1.5, 0.0}})), "040#0180000000000000");
  EXPECT_EQ(text_of(encode(AnalogInputs{{0.5, 1.0}})), "050#0080000001000000");
  EXPECT_EQ(text_of(encode(IndexPulse{.motor = 1, .revolutions = -3.0})), "060#FD00000001");
}

TEST(MotorBoardFrames, AreReadAsWhatTheyMean) {
  EXPECT_EQ(std::get<MotorPositions>(decode_from_board(frame_of("030#0180000000000001"))),
            (MotorPositions{{1.5, std::ldexp(1.0, -24)}}));
  const auto status = std::get<BoardStatus>(decode_from_board(frame_of("010#2D")));
  EXPECT_TRUE(status.system_enabled);
  EXPECT_FALSE(status.motors[0].enabled);
  EXPECT_TRUE(status.motors[0].ready);
  EXPECT_TRUE(status.motors[1].enabled);
  EXPECT_FALSE(status.motors[1].ready);
  EXPECT_EQ(status.error, BoardError::kEncoder);
  EXPECT_EQ(std::get<IndexPulse>(decode_from_board(frame_of("060#0200000001"))),
            (IndexPulse{.motor = 1, .revolutions = 2.0}));
  EXPECT_EQ(std::get<BoardCommand>(decode_from_host(frame_of("000#FFFFFFFF0000001E"))),
            (BoardCommand{Command::kSetReceiveTimeout, -1}));
}

TEST(MotorBoardFrames, AreKnownWhenCompiling) {
  static_assert(std::get<DesiredCurrents>(decode_from_host(encode(DesiredCurrents{{0.5, -0.5}}))) ==
                DesiredCurrents{{0.5, -0.5}});
  static_assert(encode(BoardStatus{.system_enabled = true}).data[0] == 1);
}

TEST(DesiredCurrents, AreRoundedToTheNearestStep) {
  const double step = std::ldexp(1.0, -24);
  const auto sent = [](double amperes) { return encode(DesiredCurrents{{amperes, 0.0}}); };
  EXPECT_EQ(text_of(sent(0.4 * step)), "005#0000000000000000");
  EXPECT_EQ(text_of(sent(0.6 * step)), "005#0000000100000000");
  EXPECT_EQ(text_of(sent(-0.6 * step)), "005#FFFFFFFF00000000");
  EXPECT_EQ(text_of(sent(-1.4 * step)), "005#FFFFFFFF00000000");
}

TEST(DesiredCurrents, AreSaturatedAndNeverLeaveIfTheyAreNotFinite) {
  const double infinity = std::numeric_limits<double>::infinity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(text_of(encode(DesiredCurrents{{1e9, -1e9}})), "005#7FFFFFFF80000000");
  EXPECT_EQ(text_of(encode(DesiredCurrents{{128.0, -128.0}})), "005#7FFFFFFF80000000");
  EXPECT_EQ(text_of(encode(DesiredCurrents{{nan, infinity}})), "005#0000000000000000");
  EXPECT_EQ(text_of(encode(DesiredCurrents{{-infinity, -nan}})), "005#0000000000000000");
}

Rejection rejection_of(const std::string& text) {
  return std::get<Rejection>(decode_from_board(frame_of(text)));
}

TEST(MotorBoardDecoder, fault_39_RejectsWhatIsNoMessageWithItsReason) {
  EXPECT_EQ(rejection_of("021#0000000000000000"), Rejection::kUnknownId);
  EXPECT_EQ(rejection_of("100#0000"), Rejection::kUnknownId);
  EXPECT_EQ(rejection_of("020#00000000000000"), Rejection::kWrongLength);
  EXPECT_EQ(rejection_of("010#"), Rejection::kWrongLength);
  EXPECT_EQ(rejection_of("010#0000"), Rejection::kWrongLength);
  EXPECT_EQ(rejection_of("060#00000000"), Rejection::kWrongLength);
  EXPECT_EQ(rejection_of("060#0000000002"), Rejection::kWrongValue);
  EXPECT_EQ(rejection_of("005#0000000000000000"), Rejection::kWrongDirection);
  EXPECT_EQ(std::get<Rejection>(decode_from_host(frame_of("010#00"))), Rejection::kWrongDirection);
  EXPECT_EQ(std::get<Rejection>(decode_from_host(frame_of("000#0000000000000006"))),
            Rejection::kWrongValue);
  EXPECT_EQ(std::get<Rejection>(decode_from_host(frame_of("005#00"))), Rejection::kWrongLength);
}

TEST(MotorBoardDecoder, fault_39_WhatItAcceptsIsSentAgainWithTheSameBytes) {
  EXPECT_TRUE(rc::check([] {
    Frame frame{.id = *rc::gen::weightedOneOf<std::uint32_t>(
                    {{8, rc::gen::element<std::uint32_t>(0, 5, 0x10, 0x20, 0x30, 0x40, 0x50, 0x60)},
                     {1, rc::gen::inRange<std::uint32_t>(0, 0x800)}}),
                .dlc = *rc::gen::weightedElement<std::uint8_t>({{6, 8}, {2, 5}, {2, 1}, {1, 0}})};
    for (std::size_t i = 0; i < frame.dlc; ++i) {
      // Small bytes make valid commands and motors more likely.
      frame.data[i] = *rc::gen::weightedOneOf<std::uint8_t>(
          {{1, rc::gen::arbitrary<std::uint8_t>()}, {2, rc::gen::inRange<std::uint8_t>(0, 2)}});
    }
    const auto require_same = [&frame](const auto& message) {
      if constexpr (!std::is_same_v<std::decay_t<decltype(message)>, Rejection>) {
        RC_ASSERT(is_same_on_wire(encode(message), frame));
      }
    };
    std::visit(require_same, decode_from_board(frame));
    std::visit(require_same, decode_from_host(frame));
  }));
}

TEST(MotorBoardDecoder, ReadsAllNumbersAsTheyWereSentToHalfAStep) {
  EXPECT_TRUE(rc::check([] {
    const auto number = [] { return 1e-6 * *rc::gen::inRange(-127'999'999, 128'000'000); };
    const MotorPair sent{number(), number()};
    const auto read = std::get<MotorPositions>(decode_from_board(encode(MotorPositions{sent})));
    for (std::size_t i = 0; i < 2; ++i) {
      RC_ASSERT(std::abs(read.revolutions[i] - sent[i]) <= std::ldexp(1.0, -25));
    }
  }));
}

TEST(BoardErrors, EachOfTheEightCodesHasANameASentenceAndARemedy) {
  std::set<std::string_view> names;
  for (unsigned code = 0; code < 8; ++code) {
    const Frame frame{.id = 0x10, .dlc = 1, .data = {static_cast<std::uint8_t>(code << 5U)}};
    const BoardError error = std::get<BoardStatus>(decode_from_board(frame)).error;
    EXPECT_EQ(static_cast<unsigned>(error), code);
    names.insert(text_of(error).name);
    EXPECT_FALSE(text_of(error).sentence.empty());
    EXPECT_FALSE(text_of(error).remedy.empty());
  }
  EXPECT_EQ(names.size(), 8U);
  EXPECT_EQ(text_of(BoardError::kReceiveTimeout).name, "receive_timeout");
}

// The position that a board would send [revolutions].
double rolled_over(double revolutions) {
  const double period = 2.0 * kRolloverRevolutions;
  return revolutions - period * std::floor((revolutions + kRolloverRevolutions) / period);
}

TEST(PositionUnwrapper, fault_46_FollowsAMotorAnywhere) {
  EXPECT_TRUE(rc::check([] {
    PositionUnwrapper unwrapper;
    double truth = unwrapper.unwrap(*rc::gen::inRange(-99, 100));
    for (const int step : *rc::gen::container<std::vector<int>>(rc::gen::inRange(-99, 100))) {
      truth += step;
      RC_ASSERT(unwrapper.unwrap(rolled_over(truth)) == truth);
    }
  }));
}

TEST(PositionUnwrapper, fault_46_IsExactAfter79DaysAtFullSpeed) {
  PositionUnwrapper unwrapper;
  double truth = unwrapper.unwrap(0.0);
  // 79 days at 4000 revolutions per minute
  while (truth < 79.0 * 24 * 60 * 4000) {
    truth += 98.0 + std::ldexp(1.0, -24);
    ASSERT_EQ(unwrapper.unwrap(rolled_over(truth)), truth);
  }
}

TEST(PositionUnwrapper, fault_39_AWrongPositionChangesNothingAfterIt) {
  EXPECT_TRUE(rc::check([] {
    PositionUnwrapper unwrapper;
    const double right = *rc::gen::inRange(-99, 100);
    unwrapper.unwrap(right);
    // One of exactly 100 revolutions has no nearer side, but goes back the way it came.
    unwrapper.unwrap(*rc::gen::inRange(-127, 128));
    RC_ASSERT(unwrapper.unwrap(right) == right);
  }));
}

TEST(PositionUnwrapper, BeginsAnewAfterAReset) {
  PositionUnwrapper unwrapper;
  unwrapper.unwrap(99.0);
  EXPECT_EQ(unwrapper.unwrap(-99.0), 101.0);
  unwrapper.reset();
  EXPECT_EQ(unwrapper.unwrap(-99.0), -99.0);
}

}  // namespace
}  // namespace trifinger::can::test
