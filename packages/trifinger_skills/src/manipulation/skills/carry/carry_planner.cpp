// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/skills/carry/carry_planner.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <variant>

#include "manipulation/parts/object_of.hpp"
#include "model/rotation_between.hpp"

namespace trifinger::manipulation {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

// What pushing costs: a tenth of a metre as much as a turn by 1 rad. A turn by the same angle is
// harder if another face has to come up.
constexpr double kPerMetre = 10.0;
constexpr double kPerTurn = 1.0;
constexpr double kPerTilt = 3.0;
// What a turn in the air costs: the less there is, the less the tips roll.
constexpr double kPerTurnInAir = 0.7;
constexpr double kPerTiltInAir = 2.0;

Quaterniond about_vertical(double angle) {
  return Quaterniond(Eigen::AngleAxisd(angle, Vector3d::UnitZ()));
}

double angle_from_up(const Vector3d& direction) {
  return std::atan2(direction.head<2>().norm(), direction.z());
}

}  // namespace

CarryPlanner::CarryPlanner(const RobotDescription& description, const ManipulationConfig& config,
                           RestConfig rests)
    : goal_(std::get<CarryTask>(config.task).goal),
      half_size_(
          Vector3d::Map(object_of(description, config.object, ObjectShape::kBox).size.data()) / 2),
      rests_(std::move(rests)),
      planner_(description, config) {}

std::vector<Rest> CarryPlanner::rests(const Pose& now) const {
  std::vector<Rest> all;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {1.0, -1.0}) {
      // The face that looks up while the object rests.
      const Vector3d face = sign * Vector3d::Unit(axis);
      const Vector3d tilted = goal_.orientation * face;
      const double tilt = angle_from_up(tilted);
      if (tilt > rests_.largest_tilt) continue;
      const Quaterniond standing = rotation_between(tilted, Vector3d::UnitZ()) * goal_.orientation;
      const double flip = angle_from_up(now.orientation * face);
      for (const double share : rests_.places) {
        Vector3d place = share * goal_.position;
        const double distance = place.head<2>().norm();
        if (distance > rests_.farthest) place *= rests_.farthest / distance;
        place.z() = half_size_.dot(face.cwiseAbs());
        for (const double turn : rests_.turns) {
          const Pose pose{place, (about_vertical(-turn) * standing).normalized()};
          const double angle = control::rotation_error(pose.orientation, now.orientation).norm();
          all.push_back({pose, kPerMetre * (place - now.position).head<2>().norm() +
                                   kPerTurn * angle + kPerTilt * flip +
                                   kPerTurnInAir * std::abs(turn) + kPerTiltInAir * tilt});
        }
      }
    }
  }
  std::ranges::stable_sort(all, {}, &Rest::cost);
  return all;
}

std::optional<Rest> CarryPlanner::find_rest(const Pose& now,
                                            std::span<const control::Touches> tried) {
  std::optional<Rest> fallback;
  for (const Rest& rest : rests(now)) {
    if (!planner_.plan(rest.pose, tried)) continue;
    if (!fallback) fallback = rest;
    // It will not lie there exactly.
    const bool has_spare =
        std::ranges::all_of(std::array{-rests_.spare_turn, rests_.spare_turn}, [&](double turn) {
          return planner_
              .plan({rest.pose.position, about_vertical(turn) * rest.pose.orientation}, tried)
              .has_value();
        });
    if (has_spare) return rest;
  }
  return fallback;
}

}  // namespace trifinger::manipulation
