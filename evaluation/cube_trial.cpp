// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/cube_trial.hpp"

#include <fmt/core.h>

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "evaluation/contact.hpp"
#include "evaluation/resting.hpp"

namespace trifinger::evaluation {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;
constexpr double kInAir = 0.003;    // Height of the cube's lowest point [m].
constexpr double kOnTable = 0.001;  // [m]

// Velocity of the cube at step `i`, from where it was 20 steps before.
Vector3d velocity_at(const SkillTrial& trial, const SkillTrialResult& result, std::size_t i) {
  constexpr std::size_t kSteps = 20;
  const std::size_t before = i - std::min(i, kSteps);
  const control::Seconds elapsed = trial.simulation.period * static_cast<double>(i - before);
  if (i == before) return Vector3d::Zero();
  return (result.truth[i].object.position - result.truth[before].object.position) / elapsed.count();
}

// How the cube lies in the end. Where boards drive the robot, nobody looks after it.
std::string wrong_at_end(const SkillTrial& trial, const SkillTrialResult& result) {
  const ObjectDescription& cube = trial.simulation.description.objects.front();
  if (lowest_point(cube, result.truth.back().object) > kOnTable) return "it was not put down";
  return trial.boards ? std::string() : std::string(what_moves(trial, result));
}

// What is wrong by the figures of the skill, from the true poses.
std::string beyond(const Report& report, const Limits& limits) {
  if (report.at("position_rms") > limits.position_rms)
    return fmt::format("{:.2f} mm rms from its way", report.at("position_rms") / kMillimetre);
  if (report.at("orientation_rms") > limits.orientation_rms)
    return fmt::format("{:.2f}° rms from its orientation", report.at("orientation_rms") / kDegree);
  return {};
}

Judgement judgement_of(const SkillTrialResult& result, const Limits& limits, std::string seen) {
  const Report report{.judgement = {}, .figures = result.figures};
  Judgement judgement{.figure = report.at("position_rms"),
                      .why = std::string(result.trace.failure)};
  if (judgement.why.empty()) judgement.why = std::move(seen);
  if (judgement.why.empty()) judgement.why = beyond(report, limits);
  judgement.succeeds = judgement.why.empty();
  return judgement;
}

// The mean place of the cube in so many steps.
Vector3d mean_of(const SkillTrialResult& result, std::size_t begin, std::size_t steps) {
  Vector3d sum = Vector3d::Zero();
  for (std::size_t i = begin; i < begin + steps; ++i) sum += result.truth[i].object.position;
  return sum / static_cast<double>(steps);
}

std::string wrong_with_lift(const SkillTrial& trial, const SkillTrialResult& result,
                            const Lift& lift, const Limits& limits) {
  constexpr double kNear = 0.004;  // To the height [m].
  constexpr double kFalls = 0.25;  // After 30 ms [m/s]; it is lowered half as fast.
  const ObjectDescription& cube = trial.simulation.description.objects.front();
  const double start = result.truth.front().object.position.z();
  const auto steps = static_cast<std::size_t>(lift.hold / trial.simulation.period);
  std::size_t held = 0;
  std::size_t longest = 0;
  std::size_t last = 0;  // Index of the longest hold's end.
  bool is_in_air = false;
  int lifts = 0;
  for (std::size_t i = 0; i < result.end; ++i) {
    const TrueStep& now = result.truth[i];
    const bool was_in_air = is_in_air;
    is_in_air = lowest_point(cube, now.object) > (was_in_air ? kOnTable : kInAir);
    if (is_in_air && !was_in_air) ++lifts;
    if (is_in_air && velocity_at(trial, result, i).z() < -kFalls) return "it was dropped";
    const bool is_at_height = std::abs(now.object.position.z() - start - lift.height) < kNear;
    held = is_at_height ? held + 1 : 0;
    if (held > longest) {
      longest = held;
      last = i;
    }
  }
  if (lifts > 1) return "it was lifted again";
  if (longest < steps)
    return fmt::format("it was at its height for {:.2f} s", 1e-3 * static_cast<double>(longest));
  // From the first second to the last one, in the stillest part of that length: before it the cube
  // still rises, and after it it goes down.
  const std::size_t second = std::min<std::size_t>(steps / 3, 1000);
  double drift = std::numeric_limits<double>::infinity();
  constexpr std::size_t kStride = 10;
  for (std::size_t begin = last + 1 - longest; begin + steps <= last + 1; begin += kStride) {
    const Vector3d moved =
        mean_of(result, begin + steps - second, second) - mean_of(result, begin, second);
    drift = std::min(drift, moved.norm());
  }
  if (drift > limits.hold_drift) return fmt::format("it drifted {:.2f} mm", drift / kMillimetre);
  return wrong_at_end(trial, result);
}

// A circle through points: the least squares of I. Kasa, A circle fitting procedure and its error
// analysis, 1976.
struct Circle {
  Vector2d centre;
  double radius;
};

Circle circle_through(const std::vector<Vector2d>& points) {
  Eigen::MatrixX3d equations(points.size(), 3);
  Eigen::VectorXd squares(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    equations.row(row) << points[i].transpose(), 1.0;
    squares[row] = points[i].squaredNorm();
  }
  const Vector3d solution = equations.colPivHouseholderQr().solve(squares);
  const Vector2d centre = solution.head<2>() / 2;
  return {.centre = centre, .radius = std::sqrt(solution.z() + centre.squaredNorm())};
}

std::string wrong_with_slide(const SkillTrial& trial, const SkillTrialResult& result,
                             const Slide& slide, const Limits& limits) {
  constexpr double kMoves = 0.005;  // [m/s]; on the circle it is 16 times as fast.
  const ObjectDescription& cube = trial.simulation.description.objects.front();
  std::vector<Vector2d> points;  // Of the longest motion without a rest.
  std::vector<Vector2d> motion;
  for (std::size_t i = 0; i < result.end; ++i) {
    const TrueStep& now = result.truth[i];
    if (lowest_point(cube, now.object) > kInAir) return "it left the table";
    if (velocity_at(trial, result, i).norm() > kMoves) {
      motion.emplace_back(now.object.position.head<2>());
    } else {
      motion.clear();
    }
    if (motion.size() > points.size()) points = motion;
  }
  constexpr std::size_t kFew = 100;
  if (points.size() < kFew) return "it was not moved";
  const Circle circle = circle_through(points);
  double squares = 0.0;
  double swept = 0.0;
  std::optional<Vector2d> before;
  for (const Vector2d& point : points) {
    const Vector2d arm = point - circle.centre;
    squares += (arm.norm() - circle.radius) * (arm.norm() - circle.radius);
    if (before)
      swept += std::atan2(before->x() * arm.y() - before->y() * arm.x(), before->dot(arm));
    before = arm;
  }
  constexpr double kNearlyAll = 0.97;
  const double rms = std::sqrt(squares / static_cast<double>(points.size()));
  if (std::abs(swept) < kNearlyAll * slide.turns * 2 * kPi)
    return fmt::format("it went round {:.2f} times", std::abs(swept) / (2 * kPi));
  if (std::abs(circle.radius - slide.radius) > limits.position_rms || rms > limits.position_rms)
    return fmt::format("a circle of {:.1f} mm, {:.2f} mm rms off", circle.radius / kMillimetre,
                       rms / kMillimetre);
  return wrong_at_end(trial, result);
}

SkillRow cube_row(std::string name, std::string what, std::string reach, double needed,
                  SkillTrial trial, Judge judge) {
  return {.name = std::move(name),
          .what = std::move(what),
          .reach = std::move(reach),
          .needed = needed,
          .trial = std::move(trial),
          .vary = [](SkillTrial& made, std::uint64_t seed) { made = varied(made, seed); },
          .judge = std::move(judge),
          .figure = "position rms",
          .unit = "mm",
          .scale = 1 / kMillimetre};
}

}  // namespace

SkillTrial varied(const SkillTrial& trial, std::uint64_t seed) {
  SkillTrial made = trial;
  vary_place_and_physics(made, seed);
  if (made.vision) {
    Random light{.seed = seed};
    made.vision->rendering = rendering::RenderingVariation{}.draw(made.vision->rendering, light);
  }
  return made;
}

void push_from_any_side(SkillTrial& trial, std::uint64_t seed, double force,
                        control::Seconds after) {
  TrialRandom random(seed + 1000);
  const double height = random.between(-1, 1);
  const double azimuth = random.between(-kPi, kPi);
  const double width = std::sqrt(1 - height * height);
  const std::array<double, 3> wanted{force * (width * std::cos(azimuth)),
                                     force * (width * std::sin(azimuth)), force * height};
  const control::Seconds period = trial.simulation.period;
  trial.interfere = [=, hold_begin = std::optional<TimeIndex>()](
                        SimulatedRobot& robot, TimeIndex t,
                        const manipulation::SkillState& state) mutable {
    constexpr control::Seconds kDuration{0.05};
    if (state.phase == "hold" && !hold_begin) hold_begin = t - 1;
    if (!hold_begin) return;
    const control::Seconds since = period * static_cast<double>(t - *hold_begin);
    const bool pushes = since >= after && since < after + kDuration;
    robot.push_object("cube", pushes ? wanted : std::array<double, 3>{});
  };
}

Judgement judge_lift(const SkillTrial& trial, const SkillTrialResult& result, const Lift& lift,
                     const Limits& limits) {
  return judgement_of(result, limits, wrong_with_lift(trial, result, lift, limits));
}

Judgement judge_slide(const SkillTrial& trial, const SkillTrialResult& result, const Slide& slide,
                      const Limits& limits) {
  return judgement_of(result, limits, wrong_with_slide(trial, result, slide, limits));
}

SkillRow lift_row(std::string name, std::string what, std::string reach, double needed,
                  SkillTrial trial, const Limits& limits, const Lift& lift) {
  return cube_row(std::move(name), std::move(what), std::move(reach), needed, std::move(trial),
                  [=](const SkillTrial& made, const SkillTrialResult& result) {
                    return judge_lift(made, result, lift, limits);
                  });
}

SkillRow slide_row(std::string name, std::string what, std::string reach, double needed,
                   SkillTrial trial, const Limits& limits, const Slide& slide) {
  return cube_row(std::move(name), std::move(what), std::move(reach), needed, std::move(trial),
                  [=](const SkillTrial& made, const SkillTrialResult& result) {
                    return judge_slide(made, result, slide, limits);
                  });
}

}  // namespace trifinger::evaluation
