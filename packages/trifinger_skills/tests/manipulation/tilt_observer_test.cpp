// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/skills/balance/tilt_observer.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>
#include <vector>

#include "support/allocation_counter.hpp"

namespace trifinger::manipulation {
namespace {

using Eigen::Vector2d;

constexpr control::Seconds kPeriod{1e-3};
constexpr TippingBox kBox{.half_height = 0.04, .gyration = 0.0238, .tip_radius = 0.0095};

// A box that falls on a tip which swings to and fro: the moments about the contact, integrated in
// steps of a hundredth of the period, by other code than the observer's.
class World {
 public:
  explicit World(double offset) : offset_(offset) {}

  void step() {
    constexpr int kSubsteps = 100;
    const double dt = kPeriod.count() / kSubsteps;
    for (int i = 0; i < kSubsteps; ++i) {
      for (int axis = 0; axis < 2; ++axis) {
        const double inertia = kBox.gyration * kBox.gyration + kBox.half_height * kBox.half_height;
        const double moment =
            9.81 * ((kBox.half_height - kBox.tip_radius) * tilt[axis] + roll()[axis] - offset_) -
            kBox.half_height * acceleration()[axis];
        rate[axis] += dt * moment / inertia;
        tilt[axis] += dt * rate[axis];
      }
      time_ += dt;
    }
  }
  [[nodiscard]] TipInput input() const { return {speed(), place(), roll()}; }
  [[nodiscard]] Vector2d centre() const {
    return place() + kBox.half_height * tilt - Vector2d::Constant(offset_);
  }

  Vector2d tilt{0.02, -0.03};
  Vector2d rate{0.0, 0.1};

 private:
  [[nodiscard]] Vector2d place() const {
    return {0.01 * std::sin(9 * time_), 0.02 * std::cos(4 * time_)};
  }
  [[nodiscard]] Vector2d speed() const {
    return {0.09 * std::cos(9 * time_), -0.08 * std::sin(4 * time_)};
  }
  [[nodiscard]] Vector2d acceleration() const {
    return {-0.81 * std::sin(9 * time_), -0.32 * std::cos(4 * time_)};
  }
  [[nodiscard]] Vector2d roll() const { return 0.06 * place(); }

  double offset_;
  double time_{0.0};
};

constexpr TiltObserverConfig kNoise{
    .position_noise = 1e-3, .tilt_noise = 0.01, .disturbance = 1.0, .drift = 2e-3};
// To tell where the box stands from errors of joints, the filter must trust how it falls.
constexpr TiltObserverConfig kUndisturbed{
    .position_noise = 1e-3, .tilt_noise = 0.01, .disturbance = 0.05, .drift = 5e-4};

struct Seen {
  TimeIndex step;
  Vector2d tilt;
  Vector2d centre;
};

// What the observer believes after `steps`, when poses come every ten steps and `delay` steps late.
TiltEstimate watched(World& world, TimeIndex steps, TimeIndex delay, double turn = 0.0,
                     const Vector2d& error_of_joints = Vector2d::Zero(),
                     const TiltObserverConfig& config = kNoise) {
  TiltObserver observer(kBox, config, kPeriod);
  const Eigen::Rotation2Dd rotation(turn);
  std::vector<Seen> on_the_way;
  for (TimeIndex t = 0; t <= steps; ++t) {
    if (t > 0) world.step();
    TipInput input = world.input();
    input = {rotation * input.rate, rotation * (input.place + error_of_joints),
             rotation * input.roll};
    observer.move(t, input);
    if (t % 10 == 0) on_the_way.push_back({t, rotation * world.tilt, rotation * world.centre()});
    for (const Seen& seen : on_the_way) {
      if (seen.step + delay == t) {
        EXPECT_TRUE(observer.see(seen.step, seen.tilt, seen.centre));
      }
    }
  }
  return observer.estimate();
}

TEST(TiltObserver, KnowsThePresentFromLatePoses) {
  for (const TimeIndex delay : {0, 10, 30, 100}) {
    World world(0.001);
    const TiltEstimate estimate = watched(world, 400, delay);
    EXPECT_NEAR((estimate.tilt - world.tilt).norm(), 0.0, 0.02 * world.tilt.norm()) << delay;
    EXPECT_NEAR((estimate.rate - world.rate).norm(), 0.0, 0.02 * world.rate.norm()) << delay;
  }
}

TEST(TiltObserver, FindsTheTiltAtWhichTheBoxWouldNotFall) {
  constexpr double kOffset = 0.002;
  World world(kOffset);
  const TiltEstimate estimate = watched(world, 400, 10, 0.0, Vector2d::Zero(), kUndisturbed);
  const Vector2d truth =
      (Vector2d::Constant(kOffset) - world.input().roll) / (kBox.half_height - kBox.tip_radius);
  EXPECT_NEAR((estimate.balance - truth).norm(), 0.0, 0.02 * truth.norm());
}

TEST(TiltObserver, JointsThatWereHomedBadlyDoNotMatter) {
  constexpr double kOffset = 0.002;
  World world(kOffset);
  const TiltEstimate estimate = watched(world, 400, 10, 0.0, Vector2d(0.002, -0.001), kUndisturbed);
  const Vector2d truth =
      (Vector2d::Constant(kOffset) - world.input().roll) / (kBox.half_height - kBox.tip_radius);
  EXPECT_NEAR((estimate.balance - truth).norm(), 0.0, 0.02 * truth.norm());
  EXPECT_NEAR((estimate.tilt - world.tilt).norm(), 0.0, 0.02 * world.tilt.norm());
}

TEST(TiltObserver, TurnsWithTheWorld) {
  World world(0.001);
  World same(0.001);
  const Eigen::Rotation2Dd rotation(2.1);
  const TiltEstimate estimate = watched(world, 300, 20);
  const TiltEstimate turned = watched(same, 300, 20, 2.1);
  EXPECT_LT((turned.tilt - rotation * estimate.tilt).norm(), 1e-9);
  EXPECT_LT((turned.rate - rotation * estimate.rate).norm(), 1e-9);
  EXPECT_LT((turned.balance - rotation * estimate.balance).norm(), 1e-9);
}

TEST(TiltObserver, AveragesNoiseOverPoses) {
  // On a tip that rests, a box that stands in its balance does not move: only noise is seen.
  TiltObserverConfig still = kNoise;
  still.disturbance = 0.0;
  TiltObserver observer(kBox, still, kPeriod);
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  double squares = 0.0;
  int count = 0;
  for (TimeIndex t = 0; t < 3000; ++t) {
    observer.move(t, {});
    if (t % 10 != 0) continue;
    const Vector2d tilt = 0.01 * Vector2d(normal(random), normal(random));
    const Vector2d centre = 1e-3 * Vector2d(normal(random), normal(random));
    ASSERT_TRUE(observer.see(t, tilt, centre));
    if (t < 1000) continue;
    squares += observer.estimate().tilt.squaredNorm() / 2;
    ++count;
  }
  EXPECT_LT(std::sqrt(squares / count), 0.5 * 0.01);
}

TEST(TiltObserver, IgnoresPosesThatItCannotPlace) {
  TiltObserver observer(kBox, kNoise, kPeriod);
  observer.reset(100);
  for (TimeIndex t = 100; t <= 500; ++t) observer.move(t, {});
  EXPECT_FALSE(observer.see(501, Vector2d::Zero(), Vector2d::Zero())) << "from the future";
  EXPECT_FALSE(observer.see(50, Vector2d::Zero(), Vector2d::Zero())) << "before the beginning";
  EXPECT_FALSE(observer.see(200, Vector2d::Zero(), Vector2d::Zero())) << "older than its memory";
  EXPECT_FALSE(observer.see(490, Vector2d(NAN, 0), Vector2d::Zero()));
  EXPECT_FALSE(observer.has_seen());
  EXPECT_TRUE(observer.see(490, Vector2d::Zero(), Vector2d::Zero()));
  EXPECT_FALSE(observer.see(490, Vector2d::Zero(), Vector2d::Zero())) << "seen before";
  EXPECT_FALSE(observer.see(480, Vector2d::Zero(), Vector2d::Zero())) << "older than the newest";
}

TEST(TiltObserver, GoesOnAfterStepsThatWereLeftOut) {
  TiltObserver all(kBox, kNoise, kPeriod);
  TiltObserver some(kBox, kNoise, kPeriod);
  const TipInput input{.rate = {0.01, 0.02}, .place = {}, .roll = {}};
  for (TiltObserver* observer : {&all, &some}) {
    observer->move(0, input);
    ASSERT_TRUE(observer->see(0, Vector2d(0.01, 0.02), Vector2d::Zero()));
  }
  for (TimeIndex t = 1; t <= 60; ++t) {
    all.move(t, input);
    if (t % 7 == 4) some.move(t, input);
  }
  EXPECT_LT((all.estimate().tilt - some.estimate().tilt).norm(), 1e-12);
  some.move(100000, input);
  EXPECT_TRUE(some.estimate().rate.array().isFinite().all());
}

TEST(TiltObserver, DoesNotAllocate) {
  TiltObserver observer(kBox, kNoise, kPeriod);
  const test::AllocationCounter counter;
  for (TimeIndex t = 0; t < 300; ++t) {
    observer.move(t, {});
    if (t % 10 == 0 && t >= 30) (void)observer.see(t - 30, Vector2d(0.01, 0), Vector2d::Zero());
  }
  EXPECT_GT(observer.estimate().tilt.norm(), 0.0);
  EXPECT_EQ(counter.count(), 0U);
}

}  // namespace
}  // namespace trifinger::manipulation
