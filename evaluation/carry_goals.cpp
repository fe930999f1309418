// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/carry_goals.hpp"

#include <fmt/core.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>

#include "manipulation/skills/carry/carry_planner.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::evaluation {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;
constexpr double kMaxDistance = 0.138708;  // From the axis [m].
constexpr double kLowest = 0.056292;       // Half the diagonal of the cube [m].
constexpr double kHighest = 0.1;           // [m]
constexpr std::string_view kPosition = "goal.position=";
constexpr std::string_view kOrientation = "goal.orientation=";

// Any rotation is as likely as any other (K. Shoemake: Uniform random rotations, 1992).
Quaterniond any_rotation(TrialRandom& random) {
  const double share = random.between(0, 1);
  const double first = random.between(-kPi, kPi);
  const double second = random.between(-kPi, kPi);
  const double a = std::sqrt(1 - share);
  const double b = std::sqrt(share);
  return {b * std::cos(second), a * std::sin(first), a * std::cos(first), b * std::sin(second)};
}

}  // namespace

Vector3d in_disc(TrialRandom& random, double z) {
  const double distance = kMaxDistance * std::sqrt(random.between(0, 1));
  const double azimuth = random.between(-kPi, kPi);
  return {distance * std::cos(azimuth), distance * std::sin(azimuth), z};
}

void vary_start(SkillTrial& trial, TrialRandom& random) {
  ObjectDescription& object = trial.simulation.description.objects.front();
  const Vector3d place = in_disc(random, object.size[2] / 2);
  object.position = Triple{place.x(), place.y(), place.z()};
  const auto face = static_cast<int>(random.between(0, 6));
  const Vector3d axis =
      face < 4 ? Vector3d(face % 2 == 0 ? 1 : 0, face % 2 == 0 ? 0 : 1, 0) : Vector3d::UnitX();
  const double turn = face < 4 ? (face < 2 ? kPi / 2 : -kPi / 2) : (face == 4 ? 0 : kPi);
  const Quaterniond lying = Eigen::AngleAxisd(random.between(-kPi, kPi), Vector3d::UnitZ()) *
                            Quaterniond(Eigen::AngleAxisd(turn, axis));
  object.orientation = {lying.w(), lying.x(), lying.y(), lying.z()};
}

control::Pose draw_goal(TrialRandom& random) {
  const Vector3d place = in_disc(random, 0.0);
  const double height = random.between(kLowest, kHighest);
  return {{place.x(), place.y(), height}, any_rotation(random)};
}

void set_goal(SkillTrial& trial, const control::Pose& goal) {
  const Vector3d& p = goal.position;
  const Quaterniond& q = goal.orientation;
  trial.settings.push_back(
      fmt::format("{}[{:.9f}, {:.9f}, {:.9f}]", kPosition, p.x(), p.y(), p.z()));
  trial.settings.push_back(
      fmt::format("{}[{:.9f}, {:.9f}, {:.9f}, {:.9f}]", kOrientation, q.w(), q.x(), q.y(), q.z()));
}

control::Pose goal_of(const SkillTrial& trial) {
  const auto numbers = [&](std::string_view key, auto& values) {
    const auto found = std::ranges::find_if(
        trial.settings, [&](const std::string& text) { return text.starts_with(key); });
    if (found == trial.settings.end()) throw InvalidArgument("the trial has no goal");
    std::string text = found->substr(key.size());
    std::ranges::replace_if(text, [](char c) { return c == '[' || c == ']' || c == ','; }, ' ');
    std::istringstream words(text);
    for (double& value : values)
      if (!(words >> value)) throw InvalidArgument("a goal that no trial has written: " + *found);
  };
  std::array<double, 3> p{};
  std::array<double, 4> q{};
  numbers(kPosition, p);
  numbers(kOrientation, q);
  return {{p[0], p[1], p[2]}, Quaterniond(q[0], q[1], q[2], q[3]).normalized()};
}

std::optional<control::Pose> rest_for_goal(const SkillTrial& trial) {
  const ObjectDescription& object = trial.believed.objects.front();
  manipulation::CarryPlanner planner =
      manipulation::load_carry_planner({.description = trial.believed,
                                        .limits = manipulation::safety_limits_of(trial.simulation),
                                        .period = trial.simulation.period},
                                       trial.settings);
  const auto rest = planner.find_rest(
      {.position = {0, 0, object.size[2] / 2}, .orientation = Quaterniond::Identity()});
  if (!rest) return std::nullopt;
  return rest->pose;
}

}  // namespace trifinger::evaluation
