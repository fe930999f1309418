// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "evaluation/skill_rows.hpp"
#include "manipulation/skills/draw/drawing.hpp"
#include "model/rotation_between.hpp"

namespace trifinger::evaluation {
namespace {

using Eigen::Vector3d;

constexpr double kInk = 1e-4;  // A nib so near to the paper draws [m].

constexpr double kHole = 0.014;   // Width of the hole of the holder [m].
constexpr double kHeight = 0.03;  // Height of the holder [m].

// Where the pen stands: the middle between the blocks of the holder, at half its height.
Vector3d middle_of_holder(const SkillTrial& trial) {
  Vector3d sum = Vector3d::Zero();
  const auto& objects = trial.simulation.description.objects;
  for (std::size_t i = 1; i < objects.size(); ++i)
    sum += Vector3d::Map(objects[i].position.value().data());
  return sum / static_cast<double>(objects.size() - 1);
}

// Moves the holder within a circle, turns it, and lets the pen lean in it in any direction.
void vary_start(SkillTrial& trial, TrialRandom& random) {
  constexpr double kRadius = 0.01;  // [m]
  constexpr double kMaxLean = 0.1;  // Largest lean that the hole lets it have [rad].
  auto& objects = trial.simulation.description.objects;
  const double distance = kRadius * std::sqrt(random.between(0, 1));
  const double azimuth = random.between(-std::numbers::pi, std::numbers::pi);
  const Vector3d before = middle_of_holder(trial);
  const Vector3d place = before + distance * Vector3d(std::cos(azimuth), std::sin(azimuth), 0.0);
  const double yaw = random.between(-std::numbers::pi, std::numbers::pi);
  const Eigen::AngleAxisd turn(yaw, Vector3d::UnitZ());
  for (std::size_t i = 1; i < objects.size(); ++i) {
    const Vector3d block = Vector3d::Map(objects[i].position.value().data()) - before;
    const Vector3d there = place + turn * block;
    objects[i].position = {there.x(), there.y(), there.z()};
    objects[i].orientation = {std::cos(yaw / 2), 0, 0, std::sin(yaw / 2)};
  }
  ObjectDescription& pen = objects.front();
  // The pen leans about the middle of the hole.
  const double lean = random.between(0, kMaxLean);
  const double side = random.between(-std::numbers::pi, std::numbers::pi);
  const Vector3d up(std::sin(lean) * std::cos(side), std::sin(lean) * std::sin(side),
                    std::cos(lean));
  const Eigen::Quaterniond turned =
      Eigen::AngleAxisd(random.between(-std::numbers::pi, std::numbers::pi), up) *
      rotation_between(Vector3d::UnitX(), -up);
  const double radius = pen.size[1] / 2;
  const Vector3d nib = place - (place.z() - radius) / up.z() * up;
  const Vector3d centre = nib + (pen.size[0] / 2 - radius) * up;
  pen.position = {centre.x(), centre.y(), centre.z() + 2e-4};
  pen.orientation = {turned.w(), turned.x(), turned.y(), turned.z()};
}

bool stands_in_holder(const SkillTrial& trial, const TrueStep& step) {
  const ObjectDescription& pen = trial.simulation.description.objects.front();
  const Vector3d along = step.object.orientation * Vector3d::UnitX();
  const Vector3d nib = step.object.position + (pen.size[0] / 2 - pen.size[1] / 2) * along;
  return along.z() < -0.9 && (nib - middle_of_holder(trial)).head<2>().norm() < kHole &&
         nib.z() < kHeight / 2;
}

Judgement judge(const SkillTrial& trial, const SkillTrialResult& result) {
  constexpr double kMaxError = 1e-3;  // [m]
  constexpr double kMinShare = 0.95;
  const manipulation::WantedDrawing wanted = manipulation::load_wanted_drawing({}, trial.settings);
  std::vector<manipulation::SeenPose> poses;
  poses.reserve(result.truth.size());
  for (const TrueStep& step : result.truth) poses.push_back({step.step, step.object});
  const manipulation::Drawing drawn = manipulation::drawn_by(
      trial.simulation.description.objects.front(), poses, wanted.paper, kInk);
  const manipulation::DrawingError error = manipulation::compare(wanted.lines, drawn);
  Judgement judgement{.succeeds = false, .figure = error.rms, .why = {}};
  if (!result.trace.failure.empty()) {
    judgement.why = result.trace.failure;
  } else if (error.share < kMinShare) {
    judgement.why = "parts of the line are missing";
  } else if (error.rms > kMaxError) {
    judgement.why = "the line is not where it should be";
  } else if (!stands_in_holder(trial, result.truth.back())) {
    judgement.why = "the pen does not stand in its holder";
  } else {
    judgement.succeeds = true;
  }
  return judgement;
}

}  // namespace

std::vector<SkillRow> draw_rows() {
  return {{.what = "take a pen from its holder, write HELLO, put it back",
           .reach = "16 of 20: line within 1 mm rms, 95 % of it on the paper",
           .needed = 0.8,
           .trial = make_skill_trial("sim_pen", "draw"),
           .vary =
               [](SkillTrial& trial, std::uint64_t seed) {
                 TrialRandom random(seed);
                 vary_start(trial, random);
                 vary_physics(trial, random);
               },
           .judge = judge,
           .figure = "rms",
           .unit = "mm",
           .scale = 1e3}};
}

}  // namespace trifinger::evaluation
