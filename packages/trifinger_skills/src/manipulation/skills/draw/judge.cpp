// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <vector>

#include "evaluation/skill_rows.hpp"
#include "manipulation/skills/draw/drawing.hpp"
#include "model/rotation_between.hpp"

namespace trifinger::evaluation {
namespace {

using Eigen::Vector2d;
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

// Distance of a point from the nearest of the lines.
double distance_to(const manipulation::Drawing& lines, const Vector2d& point) {
  double least = std::numeric_limits<double>::infinity();
  for (const manipulation::PenStroke& line : lines) {
    for (std::size_t i = 1; i < line.size(); ++i) {
      const Vector2d along = line[i] - line[i - 1];
      const double share =
          std::clamp(along.dot(point - line[i - 1]) / along.squaredNorm(), 0.0, 1.0);
      least = std::min(least, (line[i - 1] + share * along - point).norm());
    }
  }
  return least;
}

// What the nib has left on table and paper.
struct Ink {
  std::vector<Vector2d> on_paper;
  int beside{0};  // Points beside the paper, apart from the holder.
};

Ink ink_of(const SkillTrial& trial, const SkillTrialResult& result,
           const manipulation::Paper& paper) {
  const ObjectDescription& pen = trial.simulation.description.objects.front();
  const double radius = pen.size[1] / 2;
  const Vector2d holder = middle_of_holder(trial).head<2>();
  const Eigen::Rotation2Dd turn(-paper.turn);
  Ink ink;
  for (const TrueStep& step : result.truth) {
    const Vector3d nib = step.object.position +
                         (pen.size[0] / 2 - radius) * (step.object.orientation * Vector3d::UnitX());
    if (nib.z() - radius > kInk) continue;
    const Vector2d point = nib.head<2>();
    const Vector2d on_paper = turn * (point - paper.centre);
    if ((2 * on_paper.cwiseAbs() - paper.size).maxCoeff() <= 0) {
      // Where the nib waits it makes one dot, not a thousand.
      constexpr double kApart = 1e-4;  // [m]
      if (ink.on_paper.empty() || (ink.on_paper.back() - point).norm() >= kApart)
        ink.on_paper.push_back(point);
    } else if ((point - holder).norm() > kHole) {
      ++ink.beside;
    }
  }
  return ink;
}

// Share of the wanted line with ink not more than so far away, and whether most of a line is
// missing.
struct Coverage {
  double share{0.0};
  bool misses_line{false};
};

Coverage coverage_of(const manipulation::Drawing& lines, const std::vector<Vector2d>& ink) {
  constexpr double kNear = 1e-3;  // [m]
  constexpr double kStep = 1e-3;  // [m]
  int covered = 0;
  int all = 0;
  Coverage coverage;
  for (const manipulation::PenStroke& line : lines) {
    const int before = covered;
    const int begin = all;
    for (std::size_t i = 1; i < line.size(); ++i) {
      const Vector2d along = line[i] - line[i - 1];
      const int steps = 1 + static_cast<int>(along.norm() / kStep);
      for (int k = 0; k < steps; ++k) {
        const Vector2d point = line[i - 1] + (k + 0.5) / steps * along;
        ++all;
        if (std::ranges::any_of(ink, [&](const Vector2d& dot) {
              return (dot - point).squaredNorm() < kNear * kNear;
            }))
          ++covered;
      }
    }
    coverage.misses_line |= 2 * (covered - before) < all - begin;
  }
  coverage.share = static_cast<double>(covered) / all;
  return coverage;
}

Judgement judge(const SkillTrial& trial, const SkillTrialResult& result) {
  constexpr double kMaxRms = 0.5e-3;    // [m]
  constexpr double kMaxError = 1.5e-3;  // [m]
  constexpr double kMinShare = 0.95;
  const manipulation::WantedDrawing wanted = manipulation::load_wanted_drawing({}, trial.settings);
  const Ink ink = ink_of(trial, result, wanted.paper);
  double squares = 0.0;
  double largest = 0.0;
  for (const Vector2d& dot : ink.on_paper) {
    const double distance = distance_to(wanted.lines, dot);
    squares += distance * distance;
    largest = std::max(largest, distance);
  }
  const double rms =
      std::sqrt(squares / std::max<double>(1.0, static_cast<double>(ink.on_paper.size())));
  const Coverage coverage = coverage_of(wanted.lines, ink.on_paper);
  Judgement judgement{.succeeds = false, .figure = rms, .why = {}};
  judgement.note =
      fmt::format("largest error {:.2f} mm, {:.0f} % of the line, {} dots beside the paper",
                  1e3 * largest, 100 * coverage.share, ink.beside);
  if (!result.trace.failure.empty()) {
    judgement.why = result.trace.failure;
  } else if (coverage.misses_line || coverage.share < kMinShare) {
    judgement.why = "parts of the line are missing";
  } else if (rms > kMaxRms || largest > kMaxError) {
    judgement.why =
        fmt::format("the line is {:.2f} mm rms off, {:.2f} mm at most", 1e3 * rms, 1e3 * largest);
  } else if (ink.beside > 0) {
    judgement.why = "it drew beside the paper";
  } else if (!stands_in_holder(trial, result.truth.back())) {
    judgement.why = "the pen does not stand in its holder";
  } else {
    judgement.succeeds = true;
  }
  return judgement;
}

}  // namespace

std::vector<SkillRow> draw_rows() {
  return {{.name = "draw",
           .what = "take a pen from its holder, write HELLO, put it back",
           .reach = "18 of 20: 0.5 mm rms, 1.5 mm at most, 95 % of the line, none beside the paper",
           .needed = 0.9,
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
