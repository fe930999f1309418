// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <numbers>
#include <string_view>

#include "evaluation/resting.hpp"
#include "evaluation/skill_rows.hpp"
#include "trifinger/control/motion.hpp"

namespace trifinger::evaluation {
namespace {

constexpr double kQuarter = std::numbers::pi / 2;

Eigen::Vector3d turn_between(const TrueStep& from, const TrueStep& to) {
  return control::rotation_error(to.object.orientation, from.object.orientation);
}

// The two others hold the cube and stay where they are, while one turns it. Looks at the part of
// the turn from a tenth to nine tenths, as the cube has truly turned.
std::string_view hands_of(const SkillTrialResult& result) {
  std::array<std::size_t, 3> touches{};
  std::array<Eigen::AlignedBox3d, 3> boxes;
  std::size_t steps = 0;
  for (std::size_t i = 0; i < result.end; ++i) {
    const TrueStep& now = result.truth[i];
    const double angle = turn_between(result.truth.front(), now).norm();
    if (angle < 0.1 * kQuarter || angle > 0.9 * kQuarter) continue;
    ++steps;
    for (std::size_t finger = 0; finger < 3; ++finger) {
      if (now.is_touched_by(finger)) ++touches[finger];
      boxes[finger].extend(now.tips[finger]);
    }
  }
  if (steps == 0) return "it was not turned";
  const auto travel = [&](std::size_t finger) { return boxes[finger].diagonal().norm(); };
  std::size_t pusher = 0;
  for (std::size_t finger = 1; finger < 3; ++finger)
    if (travel(finger) > travel(pusher)) pusher = finger;
  for (std::size_t finger = 0; finger < 3; ++finger) {
    if (finger == pusher) continue;
    if (touches[finger] < steps) return "a finger that should hold did not touch";
    constexpr double kStill = 0.01;  // [m]
    if (travel(finger) > kStill) return "a finger that should hold moved";
  }
  if (10 * touches[pusher] < 9 * steps) return "it was not the finger that turned it";
  return {};
}

Judgement judge(const SkillTrial& trial, const SkillTrialResult& result) {
  constexpr double kTolerance = 0.1;  // [rad]
  constexpr double kLongest = 20.0;   // [s]
  const double time =
      (control::Seconds(trial.simulation.period) * static_cast<double>(result.end)).count();
  Judgement judgement{.succeeds = false, .figure = time, .why = {}};
  const TrueStep& last = result.truth.back();
  // What would be a turn by exactly 90 degrees about a horizontal axis.
  const Eigen::Vector3d turn = turn_between(result.truth.front(), last);
  const Eigen::Vector3d axis = Eigen::Vector3d(turn.x(), turn.y(), 0.0).normalized();
  if (!result.trace.failure.empty()) {
    judgement.why = result.trace.failure;
  } else if ((turn - kQuarter * axis).norm() > kTolerance) {
    judgement.why = "it was turned by something else than 90 degrees";
  } else if (const std::string_view unrest = what_moves(trial, result); !unrest.empty()) {
    judgement.why = unrest;
  } else if (const std::string_view hands = hands_of(result); !hands.empty()) {
    judgement.why = hands;
  } else if (time > kLongest) {
    judgement.why = "it took too long";
  } else {
    judgement.succeeds = true;
  }
  return judgement;
}

}  // namespace

std::vector<SkillRow> turn_rows() {
  return {{.name = "turn",
           .what = "turn a cube by 90° with one finger while the others hold it",
           .reach = "18 of 20, within 20 s",
           .needed = 0.9,
           .trial = make_skill_trial("sim", "turn"),
           .vary = vary_place_and_physics,
           .judge = judge,
           .figure = "time",
           .unit = "s"}};
}

}  // namespace trifinger::evaluation
