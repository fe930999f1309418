// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/joint/limits.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <utility>

#include "joint/limits_of_tests.hpp"
#include "trifinger/joint/safety.hpp"

namespace trifinger {
namespace {

using Limits = JointLimits<3>;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Returns the problem of limits that `change` has spoilt.
std::string problem_after(const std::function<void(Limits&)>& change) {
  Limits limits = test::some_limits<3>();
  change(limits);
  try {
    validate(limits);
  } catch (const InvalidArgument& error) {
    return error.what();
  }
  return "no error";
}

TEST(JointLimits, AreValidWhenTheyMakeSense) {
  EXPECT_EQ(problem_after([](Limits&) {}), "no error");
}

TEST(JointLimits, MayHaveSoftLimitsOnTheHardOnes) {
  EXPECT_EQ(problem_after([](Limits& limits) {
              for (JointLimit& limit : limits) {
                limit.soft_lower = limit.hard_lower;
                limit.soft_upper = limit.hard_upper;
              }
            }),
            "no error");
}

TEST(JointLimits, NameJointValueAndWhatIsAllowed) {
  EXPECT_EQ(problem_after([](Limits& limits) { limits[1].soft_lower = 1.6; }),
            "limits of joint 1: soft_lower is 1.6 rad, must be less than soft_upper (1.51 rad)");
  EXPECT_EQ(problem_after([](Limits& limits) { limits[2].soft_lower = -2.5; }),
            "limits of joint 2: soft_lower is -2.5 rad, must be at least hard_lower (-2.02 rad)");
  EXPECT_EQ(problem_after([](Limits& limits) { limits[0].soft_upper = 3.0; }),
            "limits of joint 0: soft_upper is 3 rad, must be at most hard_upper (2.5 rad)");
  EXPECT_EQ(problem_after([](Limits& limits) { limits[0].max_torque = 0.0; }),
            "limits of joint 0: max_torque is 0 Nm, must be more than 0");
  EXPECT_EQ(problem_after([](Limits& limits) { limits[2].safety_kd = -0.1; }),
            "limits of joint 2: safety_kd is -0.1 Nms/rad, must be at least 0");
  EXPECT_EQ(problem_after([](Limits& limits) { limits[0].default_kp = 60.0; }),
            "limits of joint 0: default_kp is 60 Nm/rad, must be at most max_kp (50 Nm/rad)");
  EXPECT_EQ(problem_after([](Limits& limits) { limits[0].default_kd = 1.0; }),
            "limits of joint 0: default_kd is 1 Nms/rad, must be at most max_kd (0.5 Nms/rad)");
}

TEST(JointLimits, RefuseWhatIsNoNumberInEveryField) {
  for (const JointLimitField& field : JointLimit::fields()) {
    for (const double bad : {kNotGiven, kInfinity, -kInfinity, 1e300}) {
      const std::string problem =
          problem_after([&](Limits& limits) { limits[1].*field.value = bad; });
      const bool may_be = bad == kInfinity && field.may_be_infinite();
      EXPECT_EQ(problem == "no error", may_be) << field.name << " " << bad;
    }
  }
  EXPECT_EQ(problem_after([](Limits& limits) { limits[1].hard_upper = kNotGiven; }),
            "limits of joint 1: hard_upper is nan rad, must be finite and at most 1e+06 rad");
}

TEST(JointLimits, HaveOneRowForEachField) {
  JointLimit limit;
  for (const JointLimitField& field : JointLimit::fields()) {
    EXPECT_TRUE(std::isnan(limit.*field.value))
        << field.name << " is the value of another row, too";
    limit.*field.value = 1.0;
  }
}

TEST(JointLimits, ThatMakeNoSenseMakeNoSafetyChain) {
  JointLimits<9> reversed = test::some_limits<9>();
  std::swap(reversed[4].soft_lower, reversed[4].soft_upper);
  EXPECT_THROW(SafetyChain<TriFinger>{reversed}, InvalidArgument);
}

}  // namespace
}  // namespace trifinger
