// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <Eigen/Geometry>
#include <cmath>
#include <string>
#include <vector>

#include "evaluation/lying_cube.hpp"
#include "evaluation/skill_rows.hpp"

namespace trifinger::evaluation {
namespace {

using Eigen::Vector3d;

constexpr double kAngle = 0.1;  // [rad]

Vector3d normal_of(std::size_t face) {
  return (face % 2 == 0 ? 1.0 : -1.0) * Vector3d::Unit(static_cast<Eigen::Index>(face / 2));
}

double angle_between(const Vector3d& one, const Vector3d& other) {
  return std::atan2(one.cross(other).norm(), one.dot(other));
}

// The face looks up, and the cube lies by itself, for the whole second after the end.
Judgement judge_flip(const SkillTrial& trial, const SkillTrialResult& result, double longest) {
  Judgement judgement;
  judgement.figure = duration_of(result);
  const Vector3d normal = normal_of(face_of(setting(trial, "face").value()));
  if (!result.trace.failure.empty()) judgement.why = std::string(result.trace.failure) + "; ";
  judgement.why += last_second(result, [&](const TrueStep& step) -> std::string {
    const double tilt = angle_between(step.object.orientation * normal, Vector3d::UnitZ());
    if (tilt > kAngle) return fmt::format("the face is {:.2f} rad from looking up", tilt);
    return std::string(wrong_with(step));
  });
  if (judgement.why.empty() && judgement.figure > longest) judgement.why = "it took too long";
  judgement.succeeds = judgement.why.empty();
  return judgement;
}

void vary_flip(SkillTrial& trial, std::uint64_t seed) {
  TrialRandom random(seed);
  vary_place(trial, random);
  vary_physics(trial, random);
  // A side face.
  const auto face = static_cast<std::size_t>(random.between(0, 4));
  trial.settings.push_back(fmt::format("face={}", kFaces.at(face)));
  trial.settings.push_back(fmt::format("plan.seed={}", seed));
}

}  // namespace

std::vector<SkillRow> flip_rows() {
  constexpr double kFlip = 30.0;
  return {{.name = "flip",
           .what = "flip: a cube so that a given side face looks up, within 30 s",
           .reach = "18 of 20",
           .needed = 0.9,
           .trial = make_skill_trial("pushing", "flip", {}, {"max_duration=28"}),
           .vary = vary_flip,
           .judge = [](const SkillTrial& trial,
                       const SkillTrialResult& result) { return judge_flip(trial, result, kFlip); },
           .figure = "time",
           .unit = "s"}};
}

}  // namespace trifinger::evaluation
