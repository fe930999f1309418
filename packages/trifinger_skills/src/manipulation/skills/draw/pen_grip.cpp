// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/skills/draw/pen_grip.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>

#include "manipulation/parts/soft_limits.hpp"

namespace trifinger::manipulation {
namespace {

using Eigen::Vector3d;

constexpr double kMinLean = 0.16;      // Sine of the least angle of a link and the pen's surface.
constexpr double kLinksApart = 0.026;  // Distance of the middles of two lower links [m].
constexpr double kLinkFromPen = 0.018;
constexpr double kPartOfTip = 0.03;  // So much of a link may be near the pen [m].

struct Segment {
  Vector3d from;
  Vector3d to;
};

double distance(const Segment& one, const Segment& other) {
  constexpr int kPoints = 16;
  double least = std::numeric_limits<double>::infinity();
  const Vector3d displacement = other.to - other.from;
  for (int i = 0; i <= kPoints; ++i) {
    const Vector3d point = one.from + static_cast<double>(i) / kPoints * (one.to - one.from);
    const double share =
        std::clamp((point - other.from).dot(displacement) / displacement.squaredNorm(), 0.0, 1.0);
    least = std::min(least, (point - other.from - share * displacement).norm());
  }
  return least;
}

// Looks at one grip with the pen in one place.
class GripCheck {
 public:
  GripCheck(Kinematics& kinematics, const control::SafetyLimits& limits, double length,
            const PenGripConfig& config, double radii)
      : kinematics_(kinematics),
        limits_(limits),
        length_(length),
        config_(config),
        radii_(radii),
        joints_(JointValues::Zero(kMaxJoints)) {}

  // Share of the torque that it takes; nothing if it is impossible.
  [[nodiscard]] std::optional<double> share(const PenGrip& grip, const PenAxis& pen) {
    const auto tips = tips_of(grip, pen, config_, radii_, 0.0);
    for (std::size_t i = 0; i < 3; ++i)
      if (!place(grip.fingers[i], tips[i])) return std::nullopt;
    kinematics_.update(joints_);
    const JointValues gravity = kinematics_.gravity_torques();
    const Segment whole{pen.nib, pen.nib + length_ * pen.up};
    std::array<Segment, 3> links;
    double most = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      const int finger = grip.fingers[i];
      const int first = kJointsPerFinger * finger;
      const Eigen::Matrix3d jacobian = kinematics_.tip_jacobian(finger).block<3, 3>(0, first);
      // The last joint turns the lower link: velocity = axis x arm.
      const Vector3d axis = kinematics_.tip_rotation_jacobian(finger).col(first + 2);
      const Vector3d arm = jacobian.col(2).cross(axis);
      links[i] = {tips[i], tips[i] - arm};
      const Vector3d inward = i == 0 ? grip.inward : Vector3d(-grip.inward);
      if (arm.normalized().dot(inward) < kMinLean) return std::nullopt;
      const Vector3d begin = tips[i] - kPartOfTip * arm.normalized();
      if (distance({begin, links[i].to}, whole) < kLinkFromPen) return std::nullopt;
      const Vector3d torque =
          jacobian.transpose() * ((i == 0 ? 1.0 : 0.5) * config_.force * inward) +
          gravity.segment<3>(first);
      for (int j = 0; j < kJointsPerFinger; ++j) {
        const int index = first + j;
        const auto joint = static_cast<std::size_t>(index);
        most = std::max(most, std::abs(torque[j]) / limits_.max_torque[joint]);
      }
    }
    for (std::size_t i = 0; i < 3; ++i)
      if (distance(links[i], links[(i + 1) % 3]) < kLinksApart) return std::nullopt;
    return most;
  }

  [[nodiscard]] bool place(int finger, const Vector3d& point) {
    const FingerPose pose = kinematics_.inverse_kinematics(finger, point);
    if (!pose || !is_within_soft_limits(pose, finger, limits_, kLimitMargin)) return false;
    joints_.segment<kJointsPerFinger>(kJointsPerFinger * finger) = pose.position;
    return true;
  }

 private:
  Kinematics& kinematics_;
  const control::SafetyLimits& limits_;
  double length_;
  const PenGripConfig& config_;
  double radii_;
  JointValues joints_;
};

}  // namespace

std::array<Vector3d, 3> tips_of(const PenGrip& grip, const PenAxis& pen,
                                const PenGripConfig& config, double radii,
                                double distance) noexcept {
  const Vector3d middle = pen.nib + config.height * pen.up;
  const Vector3d beside = (radii + distance) * grip.inward;
  return {middle - beside, middle + config.spread * pen.up + beside,
          middle - config.spread * pen.up + beside};
}

std::optional<PenGrip> choose_pen_grip(Kinematics& kinematics, const control::SafetyLimits& limits,
                                       const std::array<Vector3d, 3>& tips, const PenAxis& rest,
                                       double length, const std::vector<Vector3d>& nibs,
                                       const PenGripConfig& config, double radii) {
  GripCheck check(kinematics, limits, length, config, radii);
  std::optional<PenGrip> best;
  double least = 0.9;
  constexpr int kDirections = 48;
  std::array<int, 3> fingers{0, 1, 2};
  do {
    for (int i = 0; i < kDirections; ++i) {
      const double azimuth = 2 * std::numbers::pi * i / kDirections;
      const Vector3d flat(std::cos(azimuth), std::sin(azimuth), 0.0);
      PenGrip grip{.fingers = fingers, .inward = flat};
      std::optional<double> most = 0.0;
      for (const Vector3d& nib : nibs) {
        const auto share = check.share(grip, {.nib = nib, .up = Vector3d::UnitZ()});
        most = share ? std::optional(std::max(*most, *share)) : std::nullopt;
        if (!most || *most >= least) break;
      }
      if (!most || *most >= least) continue;
      grip.inward = (flat - flat.dot(rest.up) * rest.up).normalized();
      const auto share = check.share(grip, rest);
      if (!share) continue;
      bool is_free = true;
      for (const double distance : {config.clearance, config.detour - radii}) {
        const auto around = tips_of(grip, rest, config, radii, distance);
        for (std::size_t k = 0; k < 3; ++k) {
          const auto finger = static_cast<std::size_t>(fingers[k]);
          // Tips pass beside the pen, not through it.
          const Vector3d now = tips[finger] - rest.nib;
          const Vector3d then = around[k] - rest.nib;
          const bool is_behind = now.head<2>().dot(then.head<2>()) <
                                 -0.35 * now.head<2>().norm() * then.head<2>().norm();
          is_free = is_free && !is_behind && check.place(fingers[k], around[k]);
        }
      }
      if (!is_free) continue;
      least = std::max(*most, *share);
      best = grip;
    }
  } while (std::ranges::next_permutation(fingers).found);
  return best;
}

}  // namespace trifinger::manipulation
