// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/types.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <set>
#include <string>

#include "trifinger/joint/reasons.hpp"
#include "trifinger/joint/safety.hpp"

namespace trifinger {
namespace {

using testing::Each;
using testing::IsNan;

TEST(JointTypes, DescribeThemselvesWithUnits) {
  EXPECT_EQ(describe<TriFinger::Action>().text(),
            "torque float64[9] Nm\nposition float64[9] rad\nposition_kp float64[9] Nm/rad\n"
            "position_kd float64[9] Nms/rad\n");
  EXPECT_EQ(describe<TriFinger::Observation>().text(),
            "position float64[9] rad\nvelocity float64[9] rad/s\ntorque float64[9] Nm\n"
            "tip_force float64[3] N\n");
  EXPECT_NE(describe<TriFinger::AppliedAction>().find("reasons"), nullptr);
  EXPECT_EQ(describe<Finger::Observation>().find("tip_force")->count(), 1U);
}

TEST(JointTypes, DescribeRobotsWithoutTips) {
  EXPECT_EQ((describe<JointObservation<2>>().find("tip_force")), nullptr);
}

TEST(JointAction, AsksForNothingByDefault) {
  const TriFinger::Action action;
  EXPECT_THAT(action.torque, Each(0.0));
  EXPECT_THAT(action.position, Each(IsNan()));
  EXPECT_THAT(action.position_kp, Each(IsNan()));
  EXPECT_THAT(action.position_kd, Each(IsNan()));
}

TEST(JointAction, IsTheDefaultActionOfItsRobot) {
  TriFinger::Action action;
  const auto& bytes = describe_robot<TriFinger>().default_action;
  ASSERT_EQ(bytes.size(), sizeof(action));
  EXPECT_EQ(std::memcmp(bytes.data(), &action, sizeof(action)), 0);
}

TEST(HoldPosition, AsksForTheMeasuredPoseWithTheRobotsOwnGains) {
  const Finger::Observation observation{.position = {0.1, 0.2, 0.3}, .velocity = {1.0, 2.0, 3.0}};
  const Finger::Action action = hold_position(observation);
  EXPECT_EQ(action.position, observation.position);
  EXPECT_THAT(action.torque, Each(0.0));
  EXPECT_THAT(action.position_kp, Each(IsNan()));
}

TEST(Reasons, HaveDistinctBitsNamesAndDescriptions) {
  std::uint64_t bits = 0;
  std::set<std::string_view> names;
  std::set<std::string_view> descriptions;
  for (const Reason reason : all_reasons()) {
    EXPECT_FALSE(has(bits, reason)) << name_of(reason);
    bits |= bit(reason);
    names.insert(name_of(reason));
    descriptions.insert(describe(reason));
  }
  EXPECT_EQ(names.size(), all_reasons().size());
  EXPECT_EQ(descriptions.size(), all_reasons().size());
  EXPECT_FALSE(names.contains("unknown"));
}

TEST(Reasons, AreListedByName) {
  EXPECT_EQ(names_of(0), "");
  EXPECT_EQ(names_of(bit(Reason::kDamped) | bit(Reason::kTorqueClipped)), "torque_clipped, damped");
}

}  // namespace
}  // namespace trifinger
