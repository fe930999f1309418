// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/rendering/options.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <tuple>
#include <type_traits>
#include <vector>

#include "trifinger/base/error.hpp"

namespace trifinger::rendering {
namespace {

// Points in the space above the table that objects reach.
std::vector<Eigen::Vector3d> points_of_arena() {
  std::vector<Eigen::Vector3d> points;
  for (const double height : {0.0, 0.05, 0.1}) {
    points.emplace_back(0, 0, height);
    for (const double radius : {0.08, 0.16}) {
      for (int i = 0; i < 12; ++i) {
        const double angle = 2 * std::numbers::pi * i / 12;
        points.emplace_back(radius * std::cos(angle), radius * std::sin(angle), height);
      }
    }
  }
  return points;
}

// Root mean square of how far two cameras see the points of the arena apart [pixel]; 0 if they see
// none.
double distance(const camera::Camera& one, const camera::Camera& other) {
  double sum = 0;
  int count = 0;
  for (const Eigen::Vector3d& point : points_of_arena()) {
    const auto first = one.project(point);
    const auto second = other.project(point);
    if (!first || !second) continue;
    sum += (*first - *second).squaredNorm();
    ++count;
  }
  return count == 0 ? 0 : std::sqrt(sum / count);
}

// Moves numbers that left the range that is allowed to its end.
void limit(RenderingOptions& options) {
  const auto limit_row = [&options]<class T>(const RenderingField<T>& row) {
    if (row.low == row.high) return;
    T& value = options.*row.value;
    if constexpr (std::is_same_v<T, double>) value = std::clamp(value, row.low, row.high);
    if constexpr (std::is_same_v<T, std::array<double, 3>>) {
      for (double& number : value) number = std::clamp(number, row.low, row.high);
    }
  };
  std::apply([&](const auto&... row) { (limit_row(row), ...); }, RenderingOptions::fields());
}

}  // namespace

RenderingOptions RenderingVariation::draw(const RenderingOptions& nominal, Random& random) const {
  const auto factor = [&random](double share) { return 1 + random.uniform(-share, share); };
  RenderingOptions drawn = nominal;
  Eigen::Vector3d direction = Eigen::Vector3d(nominal.lamp.data()).normalized();
  const Eigen::Vector3d aside = direction.unitOrthogonal();
  direction = Eigen::AngleAxisd(lamp_angle * random.normal(), aside) *
              Eigen::AngleAxisd(lamp_angle * random.normal(), direction.cross(aside)) * direction;
  // A lamp is not below the table.
  direction.z() = std::copysign(std::max(0.1, std::abs(direction.z())), nominal.lamp[2]);
  for (std::size_t i = 0; i < 3; ++i) drawn.lamp[i] = direction[static_cast<Eigen::Index>(i)];
  drawn.lamp_power *= factor(power);
  drawn.ambient_power *= factor(power);
  for (double& colour : drawn.light_colour) colour *= factor(light_colour);
  drawn.gain *= factor(gain);
  drawn.colour_spread = colour_spread;
  drawn.gloss = random.uniform(0.0, gloss);
  drawn.dust = random.uniform(0.0, dust);
  drawn.vignetting = random.uniform(0.0, vignetting);
  drawn.read_noise *= random.uniform(1.0, std::max(1.0, noise));
  drawn.shot_noise *= random.uniform(1.0, std::max(1.0, noise));
  drawn.calibration_error = calibration_error;
  drawn.seed = static_cast<std::uint64_t>(random.integer(0, std::int64_t{1} << 62));
  drawn.calibration_seed = drawn.seed;
  limit(drawn);
  return drawn;
}

RenderingOptions varied(const RenderingOptions& nominal, Random& random) {
  RenderingOptions drawn = RenderingVariation{}.draw(nominal, random);
  drawn.calibration_error = nominal.calibration_error;
  drawn.calibration_seed = nominal.calibration_seed;
  return drawn;
}

camera::Camera misaligned(const camera::Camera& camera, double error, Random& random) {
  trifinger::detail::require_not_negative("the error of a calibration", error);
  const auto some = [&random] { return random.normal(); };
  // Errors as a calibration makes them, each of about a pixel where the objects are, half a metre
  // away.
  const double focal = (camera.lens.fx + camera.lens.fy) / 2;
  const double range = std::max(0.1, camera.pose.translation().norm());
  const Eigen::Vector3d shift = Eigen::Vector3d(some(), some(), 2 * some()) * range / focal;
  const Eigen::Vector3d turn = Eigen::Vector3d(some(), some(), 3 * some()) / focal;
  const Eigen::Vector2d centre(some(), some());
  const double stretch = 3 * some() / focal;
  const double unequal = some() / focal;
  const double bend = 0.01 * some();
  const auto moved = [&](double amount) {
    camera::Camera other = camera;
    const double angle = amount * turn.norm();
    if (angle > 0) {
      other.pose.linear() =
          camera.pose.linear() * Eigen::AngleAxisd(angle, turn.normalized()).toRotationMatrix();
    }
    other.pose.translation() += camera.pose.linear() * shift * amount;
    other.lens.cx += amount * centre.x();
    other.lens.cy += amount * centre.y();
    other.lens.fx *= 1 + amount * (stretch + unequal);
    other.lens.fy *= 1 + amount * (stretch - unequal);
    other.lens.distortion[0] += amount * bend;
    return other;
  };
  if (error == 0) return camera;
  // The distance grows almost in proportion, so a few steps of the secant method find it.
  double amount = error;
  for (int i = 0; i < 20; ++i) {
    const double found = distance(camera, moved(amount));
    if (!(found > 0) || std::abs(found - error) < 1e-6 * error) break;
    amount *= error / found;
  }
  return moved(amount);
}

}  // namespace trifinger::rendering
