// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/closing.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace trifinger::manipulation {
namespace {

constexpr control::Seconds kPeriod{1e-3};
constexpr control::TipGains kGains{.stiffness = 300, .damping = 3};
constexpr double kSpeed = 0.07;
constexpr double kForce = 0.7;
constexpr double kWidth = 0.084;  // The distance of the tips that have closed [m].

// Two tips of a mass and with dry friction, and something that they cannot press together.
struct Tips {
  double friction;         // [N]
  double rattle{0.0};      // What play adds to the measured distance, up to this [m].
  double distance{0.154};  // [m]
  double rate{0.0};
  double pressed{0.0};  // The largest force on what they have met [N].

  void step(double pull) {
    const double wanted = pull + kGains.damping * rate / 2;
    if (distance <= kWidth) {
      distance = kWidth;
      rate = 0.0;
      pressed = std::max(pressed, wanted - friction);
      return;
    }
    constexpr double kMass = 0.2;  // [kg]
    const double slowing = rate == 0.0 ? std::min(friction, wanted) : friction;
    rate = std::min(0.0, rate - 2 * (wanted - slowing) / kMass * kPeriod.count());
    distance += rate * kPeriod.count();
  }
  [[nodiscard]] double measured(double time) const {
    return distance + rattle * std::sin(900 * time);
  }
};

// The time after which the tips have closed, if they have in 5 s.
std::optional<double> closing_time(Tips& tips) {
  Closing closing(kSpeed, kForce, kGains);
  closing.begin(tips.distance);
  for (double time = 0.0; time < 5.0; time += kPeriod.count()) {
    const double distance = tips.measured(time);
    closing.follow(distance, std::abs(distance - kWidth) < 8e-3, kPeriod);
    if (closing.has_closed()) return time;
    tips.step(closing.pull());
  }
  return std::nullopt;
}

TEST(Closing, ClosesWhateverTheFrictionOfTheJointsIs) {
  constexpr double kWay = (0.154 - kWidth) / kSpeed;  // [s]
  for (const double friction : {0.0, 0.1, 0.3, 0.6}) {
    Tips tips{.friction = friction};
    const std::optional<double> time = closing_time(tips);
    ASSERT_TRUE(time) << friction;
    EXPECT_DOUBLE_EQ(tips.distance, kWidth) << friction;
    // They are as fast as they were told, apart from what the friction delays at the beginning.
    EXPECT_GT(*time, kWay);
    EXPECT_LT(*time, kWay + 0.3);
  }
}

TEST(Closing, PressesWithNoMoreThanItsForce) {
  Tips tips{.friction = 0.1};
  ASSERT_TRUE(closing_time(tips));
  EXPECT_GT(tips.pressed, 0.5 * kForce);
  EXPECT_LE(tips.pressed, kForce);
}

TEST(Closing, IsNoticedThoughMotorsRattleInTheirPlay) {
  Tips tips{.friction = 0.1, .rattle = 8e-4};
  EXPECT_TRUE(closing_time(tips));
}

TEST(Closing, TipsThatWereStoppedElsewhereHaveNotClosed) {
  Closing closing(kSpeed, kForce, kGains);
  closing.begin(0.154);
  for (int i = 0; i < 3000; ++i) closing.follow(0.12, false, kPeriod);
  EXPECT_FALSE(closing.has_closed());
  EXPECT_NEAR(closing.pull(), kForce, 1e-9);
}

}  // namespace
}  // namespace trifinger::manipulation
