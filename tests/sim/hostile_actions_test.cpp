// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <iterator>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "sim/bare_driver.hpp"
#include "sim/robots.hpp"
#include "support/soak.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger::test {
namespace {

// Number of steps of all cases together. In a debug build each step takes ten times as long.
std::int64_t total_steps() {
#ifdef NDEBUG
  return repetitions(1'000'000, 10'000'000);
#else
  return 100'000;
#endif
}

// ---- users ----

// A hostile user, in one of several ways.
template <class R>
class Enemy {
 public:
  using Action = typename R::Action;
  using Observation = typename R::Observation;

  Enemy(const SimulationOptions& options, std::uint32_t seed)
      : random_(seed), kinematics_(options.description) {}
  virtual ~Enemy() = default;
  Enemy(const Enemy&) = delete;
  Enemy& operator=(const Enemy&) = delete;

  virtual Action next(const Observation& y) = 0;

 protected:
  static constexpr double kHuge = 1e9;

  bool one_in(std::uint32_t count) { return random_() % count == 0; }
  double between(double min, double max) {
    return std::uniform_real_distribution(min, max)(random_);
  }
  double sign() { return one_in(2) ? 1.0 : -1.0; }

  // Returns how torques at each joint accelerate each joint, in this pose.
  Eigen::MatrixXd mobility(const Observation& y) {
    kinematics_.update(
        Eigen::Map<const Eigen::VectorXd>(y.position.data(), static_cast<int>(R::kJoints)));
    return Eigen::MatrixXd(kinematics_.mass_matrix()).inverse();
  }

 private:
  std::mt19937 random_;
  Kinematics kinematics_;
};

// Sends all possible values: numbers of every size, NaN, infinities, and sometimes something
// sensible.
template <class R>
class AtRandom final : public Enemy<R> {
 public:
  using Enemy<R>::Enemy;

  typename R::Action next(const typename R::Observation&) override {
    typename R::Action action;
    for (auto* const values :
         {&action.torque, &action.position, &action.position_kp, &action.position_kd}) {
      for (double& value : *values) value = number();
    }
    return action;
  }

 private:
  double number() {
    if (this->one_in(10)) return kNotGiven;
    if (this->one_in(10)) return std::numeric_limits<double>::infinity();
    if (this->one_in(10)) return -1e300;
    if (this->one_in(10)) return std::pow(10.0, this->between(-300.0, 300.0));
    return this->between(-3.0, 3.0);
  }
};

// Uses all the torque of the motors in either direction. Each joint changes direction at random.
template <class R>
class BangBang final : public Enemy<R> {
 public:
  using Enemy<R>::Enemy;

  typename R::Action next(const typename R::Observation&) override {
    for (double& torque : torque_) {
      if (torque == 0.0 || this->one_in(200)) torque = this->sign() * this->kHuge;
    }
    return R::Action::of_torque(torque_);
  }

 private:
  JointVector<R::kJoints> torque_{};
};

// Swings up: the torque goes along the velocity. A joint without velocity gets a push.
template <class R>
class Resonant final : public Enemy<R> {
 public:
  using Enemy<R>::Enemy;

  typename R::Action next(const typename R::Observation& y) override {
    typename R::Action action;
    for (std::size_t i = 0; i < R::kJoints; ++i) {
      const bool is_pushed = y.velocity[i] == 0.0 || this->one_in(1000);
      action.torque[i] = this->kHuge * (is_pushed ? this->sign() : y.velocity[i]);
    }
    return action;
  }
};

// Picks one joint after the other as its victim and throws it at one of its bounds, with the
// torques of all joints that accelerate it most.
template <class R>
class Greedy final : public Enemy<R> {
 public:
  using Enemy<R>::Enemy;

  typename R::Action next(const typename R::Observation& y) override {
    constexpr int kStepsPerVictim = 400;
    constexpr int kStepsPerPose = 20;
    if (step_ % kStepsPerPose == 0) {
      const Eigen::MatrixXd mobility = this->mobility(y);
      const auto finger = (step_ / kStepsPerVictim) % 3;
      if (step_ % kStepsPerVictim == 0) side_ = this->sign();
      for (std::size_t i = 0; i < R::kJoints; ++i) {
        // The corresponding joint of each finger.
        const auto joint = static_cast<Eigen::Index>(i);
        const auto victim = static_cast<Eigen::Index>(i / 3 * 3) + finger;
        torque_[i] = side_ * std::copysign(this->kHuge, mobility(victim, joint));
      }
    }
    ++step_;
    return R::Action::of_torque(torque_);
  }

 private:
  Eigen::Index step_{0};
  double side_{1.0};
  JointVector<R::kJoints> torque_{};
};

// ---- places ----

struct Scene {
  const char* name;
  Variant variant;
  bool is_flipped{false};
  double raised_by{0.0};  // [m]
};
// Further down, the table is in the way of the fingers.
constexpr double kLow = -0.05;
constexpr Scene kScenes[] = {
    {"Edu", Variant::kEdu},
    {"EduFlipped", Variant::kEdu, true},
    {"EduLow", Variant::kEdu, false, kLow},
    {"Pro", Variant::kPro},
    {"ProFlipped", Variant::kPro, true},
    {"ProLow", Variant::kPro, false, kLow},
    {"One", Variant::kOne},
    {"OneFlipped", Variant::kOne, true},
    {"OneLow", Variant::kOne, false, kLow},
};
constexpr const char* kKinds[] = {"AtRandom", "BangBang", "Resonant", "Greedy"};

template <class R>
std::unique_ptr<Enemy<R>> enemy_of(std::string_view kind, const SimulationOptions& options,
                                   std::uint32_t seed) {
  if (kind == "AtRandom") return std::make_unique<AtRandom<R>>(options, seed);
  if (kind == "BangBang") return std::make_unique<BangBang<R>>(options, seed);
  if (kind == "Resonant") return std::make_unique<Resonant<R>>(options, seed);
  return std::make_unique<Greedy<R>>(options, seed);
}

template <class R>
SimulationOptions options_in(const Scene& scene) {
  SimulationOptions options = test::options_of<R>(scene.variant);
  options.description.flipped = scene.is_flipped;
  options.description.objects.clear();
  options.description.finger_height = figures(options.description).finger_height + scene.raised_by;
  // The finger is bent, like on the platform: a finger that hangs straight down would begin in the
  // table.
  const auto bent =
      figures(test::options_of<TriFinger>(scene.variant).description).initial_position;
  options.initial_position.emplace();
  for (std::size_t i = 0; i < R::kJoints; ++i) options.initial_position->push_back(bent[i % 3]);
  return options;
}

// ---- what must hold ----

// The speed that no joint reaches, whatever hits it: see docs/safety.md [rad/s].
constexpr double kSpeedBound = 30.0;

struct Figures {
  double beyond_soft{0.0};  // [rad]
  double torque{0.0};       // share of the maximum
  double speed{0.0};        // [rad/s]
  double margin{1.0};       // smallest thermal margin
  int hard_limits{0};       // stops
};

using SceneAndKind = std::tuple<std::uint32_t, std::uint32_t>;

class HostileActions : public testing::TestWithParam<SceneAndKind> {
 protected:
  template <class R>
  static void expect_limits_hold(const char* robot) {
    const auto [scene_index, kind_index] = GetParam();
    const Scene& scene = kScenes[scene_index];
    const SimulationOptions options = options_in<R>(scene);
    const std::vector<JointLimit> limits = default_limits(options.description);
    BareDriver<R> driver(options);
    const auto enemy = enemy_of<R>(kKinds[kind_index], options, 10 * scene_index + kind_index);

    constexpr auto kCases = 2 * std::size(kScenes) * std::size(kKinds);
    const auto steps = static_cast<int>(total_steps() / static_cast<std::int64_t>(kCases)) + 1;
    Figures seen;
    ProgressLine progress(steps);
    for (int step = 0; step < steps; ++step) {
      progress.update(step);
      const typename R::Observation before = driver.observation;
      const DriverReport report = driver.step(enemy->next(before));
      bool is_beyond_hard = false;
      for (std::size_t i = 0; i < R::kJoints; ++i) {
        // Written so that NaN fails.
        const double torque = std::abs(driver.applied.torque[i]) / limits[i].max_torque;
        ASSERT_LE(torque, 1.0);
        ASSERT_LE(std::abs(driver.observation.torque[i]), limits[i].max_torque);
        const double speed = std::abs(driver.observation.velocity[i]);
        ASSERT_LE(speed, kSpeedBound) << "joint " << i << ", step " << step;
        ASSERT_GE(driver.applied.thermal_margin[i], 0.0);
        const double position = before.position[i];
        const double beyond =
            std::max(position - limits[i].soft_upper, limits[i].soft_lower - position);
        const double beyond_hard =
            std::max(position - limits[i].hard_upper, limits[i].hard_lower - position);
        is_beyond_hard = is_beyond_hard || beyond_hard > 0.0;
        // A joint is never further beyond its bound than one step can carry it.
        ASSERT_LE(beyond_hard, 1e-3 * kSpeedBound) << "joint " << i << ", step " << step;
        seen.torque = std::max(seen.torque, torque);
        seen.speed = std::max(seen.speed, speed);
        seen.beyond_soft = std::max(seen.beyond_soft, beyond);
        seen.margin = std::min(seen.margin, driver.applied.thermal_margin[i]);
      }
      // Only hard limits stop the robot, and each of them does so at once.
      const bool has_stopped = report.state == DriverReport::State::kFault;
      ASSERT_EQ(has_stopped, is_beyond_hard) << driver.robot.fault_text(report.fault_code);
      if (!has_stopped) continue;
      ASSERT_EQ(report.fault_code & 0xFF, static_cast<std::int32_t>(SafetyFault::kHardLimit));
      ++seen.hard_limits;
      driver.reset();
    }
    std::printf(
        "  %-9s %-10s %-8s %7d steps: %.3f rad beyond a soft limit, torque %.2f of the maximum, "
        "%5.2f rad/s, thermal margin %.2f, %d hard limits\n",
        robot, scene.name, kKinds[kind_index], steps, seen.beyond_soft, seen.torque, seen.speed,
        seen.margin, seen.hard_limits);
    // Something stronger than its motor may push a joint: the table, another finger, or the weight
    // of a Pro on its head. Such cases must remain exceptions.
    EXPECT_LT(seen.hard_limits, 1 + steps / 500);
  }
};

TEST_P(HostileActions, fault_11_LeadNoTriFingerBeyondItsBounds) {
  expect_limits_hold<TriFinger>("TriFinger");
}
TEST_P(HostileActions, fault_13_LeadNoFingerBeyondItsBoundsOrItsSpeed) {
  expect_limits_hold<Finger>("Finger");
}

std::string name_of(const testing::TestParamInfo<SceneAndKind>& info) {
  const auto [scene, kind] = info.param;
  return std::string(kScenes[scene].name) + kKinds[kind];
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, HostileActions,
    testing::Combine(testing::Range(0U, static_cast<std::uint32_t>(std::size(kScenes))),
                     testing::Range(0U, static_cast<std::uint32_t>(std::size(kKinds)))),
    name_of);

}  // namespace
}  // namespace trifinger::test
