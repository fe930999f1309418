// SPDX-License-Identifier: BSD-3-Clause
#include "boards/self_test.hpp"

#include <algorithm>
#include <cmath>

#include "base/text_of.hpp"

namespace trifinger::boards {
namespace {

using trifinger::detail::text_of;

// A joint that is so far from its target where a sweep turns has not moved [rad]; the way is 0.035.
constexpr double kNoMovement = 0.028;
constexpr double kLargestFriction = 0.1;       // [Nm]; half of what the original robots home with
constexpr double kLargestFrictionPart = 0.25;  // of the largest torque, for stronger joints
constexpr double kIndexTolerance = 0.0175;     // of a distance in parts of it: 6 degrees of a motor
// A model knows the weight of a finger no better than this.
constexpr double kLoadTolerance = 0.03;          // [Nm]
constexpr double kLoadToleranceOfTorque = 0.08;  // of the largest torque, for stronger joints
constexpr double kLoadTolerancePart = 0.35;      // of the weight

double rounded(double value) { return std::round(value * 1000.0) / 1000.0; }

}  // namespace

std::string problem_of(const JointReport& report, double index_distance,
                       std::string_view gear_ratio_key) {
  if (!report.wiring || !report.sweep) return "was not tested to the end";
  const SweepResult& sweep = *report.sweep;
  if (sweep.error > kNoMovement) {
    return text_of("does not follow: it stays ", rounded(sweep.error),
                   " rad away from its target; check its belt and what is in its way");
  }
  if (report.weight) {
    const double tolerance = std::max(kLoadTolerance, kLoadToleranceOfTorque * report.max_torque) +
                             kLoadTolerancePart * std::abs(*report.weight);
    if (std::abs(sweep.load - *report.weight) > tolerance) {
      return text_of("is not where it seems, or is another joint: its load is ",
                     rounded(sweep.load), " Nm, its weight ", rounded(*report.weight),
                     " Nm; check home_position, polarity, and whether motor and encoder belong to "
                     "another joint");
    }
  }
  if (sweep.friction > std::max(kLargestFriction, kLargestFrictionPart * report.max_torque)) {
    return text_of("moves hard: its friction is ", rounded(sweep.friction),
                   " Nm; check bearings and belt");
  }
  if (report.index_distance > 0.0 &&
      std::abs(report.index_distance - index_distance) > kIndexTolerance * index_distance) {
    return text_of("has indexes ", rounded(report.index_distance), " rad apart instead of ",
                   rounded(index_distance), "; check how its encoder is fixed, and ",
                   gear_ratio_key);
  }
  return "";
}

}  // namespace trifinger::boards
