// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/skills/draw/drawing.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "manipulation/skills/draw/letters.hpp"
#include "manipulation/skills/draw/line_part.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::manipulation {
namespace {

using control::Seconds;
using Eigen::Vector2d;
using testing::HasSubstr;

constexpr double kHeight = 0.02;

std::string refusal(const std::function<void()>& what) {
  try {
    what();
  } catch (const InvalidArgument& error) {
    return error.what();
  }
  return "nothing was refused";
}

TEST(Letters, HaveStrokesOfTheirHeightAndWidth) {
  for (const Letter& letter : all_letters()) {
    SCOPED_TRACE(letter.sign);
    if (letter.path.empty()) continue;
    for (const PenStroke& stroke : written(std::string(1, letter.sign), 1.0)) {
      EXPECT_GE(stroke.size(), 2U);
      for (const Vector2d& point : stroke) {
        EXPECT_GE(point.x(), -1e-9);
        EXPECT_LE(point.x(), letter.width + 1e-9);
        EXPECT_GE(point.y(), -0.2);
        EXPECT_LE(point.y(), 1.0 + 1e-9);
      }
    }
  }
}

TEST(Letters, ThatDoNotExistAreNamedWithThoseThatDo) {
  EXPECT_THAT(refusal([] { static_cast<void>(written("HELLo", kHeight)); }),
              testing::AllOf(HasSubstr("'o'"), HasSubstr("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789")));
}

TEST(Drawing, LiesInTheMiddleOfAPaperThatIsTurned) {
  const Paper paper{.centre = {0.03, -0.02}, .size = {0.1, 0.05}, .turn = 0.7};
  const Drawing flat = written("HELLO", kHeight);
  const Drawing there = placed(flat, paper);
  EXPECT_NEAR((there[0][0] - there[0][1]).norm(), (flat[0][0] - flat[0][1]).norm(), 1e-12);
  for (const PenStroke& stroke : there)
    for (const Vector2d& point : stroke) EXPECT_TRUE(paper.contains(point));
}

TEST(Drawing, ThatIsTooLargeIsRefused) {
  EXPECT_THAT(refusal([] {
                static_cast<void>(placed(written("HELLO", kHeight),
                                         {.centre = {0, 0}, .size = {0.05, 0.05}, .turn = 0}));
              }),
              HasSubstr("does not fit on the paper of 50 x 50 mm"));
}

TEST(Drawing, IsReadFromAFileOfStrokes) {
  const std::string path = testing::TempDir() + "/strokes.csv";
  std::ofstream(path) << "stroke,x,y\n0,0,0\n0,0.01,0\n1,0,0.01\n1,0.01,0.02\n";
  const Drawing drawing = load_strokes(path);
  ASSERT_EQ(drawing.size(), 2U);
  EXPECT_EQ(drawing[1][1], Vector2d(0.01, 0.02));
  std::ofstream(path) << "stroke,x,y\n0,0,0\n0,0.01\n";
  EXPECT_THAT(refusal([&] { static_cast<void>(load_strokes(path)); }),
              HasSubstr(":3 has 2 numbers"));
}

TEST(Drawing, IsComparedByDistanceAndByWhatIsMissing) {
  const Drawing wanted{{{0.0, 0.0}, {0.1, 0.0}}};
  Drawing drawn(1);
  // The first half, half a millimetre off.
  for (int i = 0; i <= 500; ++i) drawn[0].emplace_back(1e-4 * i, 5e-4);
  const DrawingError error = compare(wanted, drawn);
  EXPECT_NEAR(error.rms, 5e-4, 1e-9);
  EXPECT_NEAR(error.largest, 5e-4, 1e-9);
  EXPECT_NEAR(error.share, 0.5, 0.02);
  EXPECT_EQ(compare(wanted, {}).share, 0.0);
}

TEST(Drawing, IsDrawnOnlyWhereTheNibTouchesThePaper) {
  const ObjectDescription pen = stick();
  const Eigen::Quaterniond upright =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitX(), -Eigen::Vector3d::UnitZ());
  std::vector<SeenPose> poses;
  for (int i = 0; i < 100; ++i) {
    const double lift = i >= 40 && i < 60 ? 1e-3 : 0.0;
    poses.push_back(
        {.step = i,
         .pose = {.position = {1e-3 * i - 0.05, 0.0, 0.07 + lift}, .orientation = upright}});
  }
  const Drawing drawn =
      drawn_by(pen, poses, {.centre = {0, 0}, .size = {0.06, 0.05}, .turn = 0}, 1e-4);
  ASSERT_EQ(drawn.size(), 2U);
  EXPECT_NEAR(drawn[0].front().x(), -0.03, 1.1e-3);  // The edge of the paper.
  EXPECT_NEAR(drawn[0].back().x(), -0.011, 1e-9);
  EXPECT_NEAR(drawn[1].front().x(), 0.01, 1e-9);
}

// Rests at both ends, is never faster than it may be, and its velocity is that of its positions.
TEST(LineWay, IsSmoothAndAsFastAsItMayBe) {
  constexpr double kSpeed = 0.02;
  constexpr Seconds kRamp{0.2};
  constexpr double kStep = 1e-4;
  for (const Letter& letter : all_letters()) {
    if (letter.path.empty()) continue;
    SCOPED_TRACE(letter.sign);
    for (const PenStroke& stroke : written(std::string(1, letter.sign), kHeight)) {
      Vector2d end = stroke.front();
      for (const LinePart& part : parts_of(stroke, kSpeed, kRamp)) {
        EXPECT_LT((part.at(Seconds(0)).position - end).norm(), 1e-9);
        EXPECT_LT(part.at(Seconds(0)).velocity.norm(), 1e-9);
        EXPECT_LT(part.at(part.duration()).velocity.norm(), 1e-9);
        end = part.at(part.duration()).position;
        for (Seconds t(0.01); t < part.duration(); t += Seconds(0.01)) {
          const NibMotion motion = part.at(t);
          EXPECT_LE(motion.velocity.norm(), kSpeed + 1e-9);
          const Vector2d displacement = part.at(t + Seconds(kStep)).position - motion.position;
          EXPECT_NEAR(displacement.norm(), kStep * motion.velocity.norm(), 5e-8);
        }
      }
      EXPECT_LT((end - stroke.back()).norm(), 1e-9);
    }
  }
}

}  // namespace
}  // namespace trifinger::manipulation
