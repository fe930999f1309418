// SPDX-License-Identifier: BSD-3-Clause
#include "endurance/motion.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "joints.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::apps {
namespace {

const std::vector<double> kHome{0.0, 0.9, -0.9};

std::vector<double> positions(RandomMotion& motion, int steps, std::uint64_t session) {
  motion.begin(kHome, kHome, session);
  std::vector<double> all;
  for (int i = 0; i < steps; ++i) {
    (void)motion.next();
    all.insert(all.end(), motion.position().begin(), motion.position().end());
  }
  return all;
}

TEST(RandomMotion, NeitherJumpsNorLeavesTheSoftLimitsWhateverGivesWay) {
  RandomMotion motion(test::limits_of_joints(3),
                      {.seed = 3, .speed = 1.0, .pass_every = Seconds(20)});
  motion.begin(kHome, kHome, 0);
  std::vector<double> before = kHome;
  Random random{.seed = 4};
  for (int i = 0; i < 200'000; ++i) {
    if (random.uniform(0.0, 1.0) < 0.002) motion.give_way(kHome);
    (void)motion.next();
    for (std::size_t joint = 0; joint < 3; ++joint) {
      const double position = motion.position()[joint];
      ASSERT_GE(position, motion.limits()[joint].soft_lower);
      ASSERT_LE(position, motion.limits()[joint].soft_upper);
      // The speed of a shake may be its window's and its swing's at once.
      ASSERT_LE(std::abs(position - before[joint]), 2.0 * 5.0 * 1e-3) << "step " << i;
      ASSERT_LE(std::abs(motion.torque()[joint]), 0.5 * 0.36);
      before[joint] = position;
    }
  }
}

TEST(RandomMotion, IsTheSameForTheSameSeedAndSessionAndDiffersOtherwise) {
  RandomMotion one(test::limits_of_joints(3), {.seed = 1});
  RandomMotion same(test::limits_of_joints(3), {.seed = 1});
  RandomMotion other(test::limits_of_joints(3), {.seed = 2});
  (void)positions(same, 777, 5);  // what was before does not count
  const auto expected = positions(one, 30'000, 0);
  EXPECT_EQ(positions(same, 30'000, 0), expected);
  EXPECT_NE(positions(other, 30'000, 0), expected);
  EXPECT_NE(positions(one, 30'000, 1), expected);
}

TEST(RandomMotion, MeasuresTheSamePlacesForthAndBackAtTheSameSpeed) {
  RandomMotion motion(test::limits_of_joints(3), {});
  motion.begin(kHome, kHome, 0);
  std::vector<double> forth;
  std::vector<double> back;
  for (int i = 0; i < 20'000; ++i) {
    const MotionStep step = motion.next();
    if (step.part == PassPart::kForth) forth.push_back(motion.position()[1]);
    if (step.part == PassPart::kBack) back.push_back(motion.position()[1]);
    if (step.ends) break;
  }
  ASSERT_GT(forth.size(), 100U);
  std::ranges::reverse(back);
  ASSERT_NEAR(static_cast<double>(back.size()), static_cast<double>(forth.size()), 2.0);
  const std::size_t both = std::min(forth.size(), back.size());
  for (std::size_t i = 0; i < both; ++i) EXPECT_NEAR(forth[i], back[i], 1e-3);
  for (std::size_t i = 1; i < forth.size(); ++i) {
    EXPECT_NEAR(forth[i] - forth[i - 1], motion.pass_speed(1) * 1e-3, 1e-9);
  }
}

TEST(RandomMotion, RetreatsToWhereTheMoveBegan) {
  RandomMotion motion(test::limits_of_joints(3), {.seed = 5});
  motion.begin(kHome, kHome, 0);
  std::vector<double> begin;
  int in_reach = 0;
  for (int i = 0; in_reach < 50; ++i) {
    ASSERT_LT(i, 100'000);
    const std::vector<double> before(motion.position().begin(), motion.position().end());
    const MotionStep step = motion.next();
    if (step.begins) begin = before;
    in_reach = step.move == Move::kReach ? in_reach + 1 : 0;
    if (step.begins && step.move == Move::kReach) in_reach = 1;
  }
  motion.give_way(kHome);
  MotionStep step = motion.next();
  EXPECT_EQ(step.move, Move::kRetreat);
  while (!step.ends) step = motion.next();
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(motion.position()[i], begin[i], 1e-9);
}

// The places at which the joints arrive one after the other before the slow pass begins.
std::vector<std::vector<double>> arrivals(RandomMotion& motion) {
  std::vector<std::vector<double>> all;
  for (int i = 0; i < 100'000; ++i) {
    const MotionStep step = motion.next();
    if (step.move != Move::kRetreat) break;
    if (step.ends) all.emplace_back(motion.position().begin(), motion.position().end());
    motion.remember(motion.position());  // This is no new part of the path.
  }
  return all;
}

TEST(RandomMotion, GoesBackTheWayItCameToFreeItself) {
  RandomMotion motion(test::limits_of_joints(3), {.seed = 6});
  motion.begin(kHome, kHome, 0);
  std::vector<std::vector<double>> path;
  for (int i = 1; i <= 8; ++i) {
    path.push_back({0.1 * i, 0.9 - 0.1 * i, -0.9 + 0.05 * i});
    motion.remember(path.back());
    motion.remember(path.back());  // rests there
  }
  // What is at home is no way back.
  std::erase_if(path, [](const auto& place) { return place[0] < 0.25; });
  std::ranges::reverse(path);
  motion.begin(path.front(), kHome, 1, Seconds(3));
  const auto gone = arrivals(motion);
  ASSERT_GE(gone.size(), path.size());
  for (std::size_t i = 0; i < path.size(); ++i) {
    for (std::size_t joint = 0; joint < 3; ++joint)
      EXPECT_NEAR(gone[i][joint], path[i][joint], 1e-9);
  }
}

TEST(RandomMotion, ForgetsTheWayWhenItComesHome) {
  RandomMotion motion(test::limits_of_joints(3), {.seed = 6});
  motion.begin(kHome, kHome, 0);
  motion.remember(std::vector{0.5, 0.4, -0.9});
  motion.remember(kHome);
  motion.remember(std::vector{0.4, 0.8, -0.9});
  motion.begin(std::vector{0.4, 0.8, -0.9}, kHome, 1, Seconds(3));
  const auto gone = arrivals(motion);
  ASSERT_EQ(gone.size(), 2U);
  for (std::size_t joint = 0; joint < 3; ++joint) EXPECT_NEAR(gone[1][joint], kHome[joint], 1e-9);
}

TEST(RandomMotion, GoesBackNoWayIfItBeginsAtHome) {
  RandomMotion motion(test::limits_of_joints(3), {.seed = 6});
  motion.begin(kHome, kHome, 0);
  motion.remember(std::vector{0.5, 0.4, -0.9});
  motion.begin(kHome, kHome, 1, Seconds(3));  // It was homed meanwhile.
  EXPECT_TRUE(arrivals(motion).empty());
}

TEST(RandomMotion, GoesOnBackFromWhereItsReturnWasCutOff) {
  RandomMotion motion(test::limits_of_joints(3), {.seed = 6});
  motion.begin(kHome, kHome, 0);
  const auto place = [](int i) { return std::vector{0.3 + 0.1 * i, 0.4, -0.9}; };
  for (int i = 0; i < 5; ++i) motion.remember(place(i));
  motion.begin(place(4), kHome, 1, Seconds(3));
  for (int i = 4; i >= 3; --i) {
    while (!motion.next().ends) motion.remember(motion.position());
  }
  motion.begin(place(3), kHome, 2, Seconds(3));
  const auto gone = arrivals(motion);
  ASSERT_EQ(gone.size(), 3U);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(gone[static_cast<std::size_t>(i)][0], place(2 - i)[0], 1e-9);
  }
}

TEST(RandomMotion, KeepsTheEndOfAWayThatIsTooLong) {
  RandomMotion motion(test::limits_of_joints(3), {.seed = 6});
  motion.begin(kHome, kHome, 0);
  const auto place = [](std::size_t i) {
    return std::vector{0.5 + 0.1 * static_cast<double>(i % 5), 0.4, -0.9};
  };
  constexpr std::size_t kPlaces = RandomMotion::kMaxPlaces + 12;
  for (std::size_t i = 0; i < kPlaces; ++i) motion.remember(place(i));
  motion.begin(place(kPlaces - 1), kHome, 1, Seconds(3));
  for (std::size_t i = kPlaces; i-- > 12;) {
    MotionStep step = motion.next();
    ASSERT_EQ(step.move, Move::kRetreat);
    while (!step.ends) step = motion.next();
    ASSERT_NEAR(motion.position()[0], place(i)[0], 1e-9) << i;
  }
}

TEST(RandomMotion, TakesNoMemoryAfterItsConstruction) {
  RandomMotion motion(test::limits_of_joints(9), {.pass_every = Seconds(10)});
  const std::vector<double> home(9, 0.1);
  const trifinger::test::AllocationCounter allocations;
  motion.begin(home, home, 0);
  for (int i = 0; i < 60'000; ++i) {
    if (i % 5000 == 0) motion.give_way(home);
    if (i % 20 == 0) motion.remember(motion.position());
    if (i % 20'000 == 0) motion.begin(motion.position(), home, 1, Seconds(3));
    (void)motion.next();
  }
  EXPECT_EQ(allocations.count(), 0);
}

TEST(RandomMotion, RefusesWhatMakesNoSense) {
  EXPECT_THROW(RandomMotion(test::limits_of_joints(3), {.speed = 0.0}), InvalidArgument);
  EXPECT_THROW(RandomMotion(test::limits_of_joints(3), {.speed = 1.1}), InvalidArgument);
  EXPECT_THROW(RandomMotion({}, {}), InvalidArgument);
  auto limits = test::limits_of_joints(1);
  limits[0].default_kp = 0.0;
  EXPECT_THROW(RandomMotion(limits, {}), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::apps
