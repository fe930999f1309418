// SPDX-License-Identifier: BSD-3-Clause
#include "blueprint.hpp"

#include <cmath>
#include <numbers>

namespace trifinger::detail {
namespace {

constexpr double kLinkLength = 0.16;
constexpr double kRightAngle = std::numbers::pi / 2;
constexpr double kThird = 2 * std::numbers::pi / 3;

constexpr Solid box(Triple centre, Triple half, Paint paint, Role role = Role::kLooks) {
  return {Form::kBox, centre, half, 0, paint, role};
}

// A cylinder around an axis parallel to a coordinate axis.
constexpr Solid disc(Triple centre, int axis, double radius, double half_length, Paint paint,
                     Role role = Role::kLooks) {
  Triple from = centre;
  Triple to = centre;
  from[static_cast<std::size_t>(axis)] -= half_length;
  to[static_cast<std::size_t>(axis)] += half_length;
  return {Form::kCylinder, from, to, radius, paint, role};
}

constexpr Solid capsule(Triple from, Triple to, double radius, Paint paint,
                        Role role = Role::kLooks) {
  return {Form::kCapsule, from, to, radius, paint, role};
}

constexpr int kX = 0;
constexpr int kY = 1;
constexpr int kZ = 2;

// The rotor housings stand out of the shells and carry the finger's colour, so that pictures show
// which finger is which. For collisions, each shell is one box from joint to joint; motors and
// bearings do not collide.

// ----------------------------------------------------------------------------------------------
// Edu

constexpr Solid kEduBase[] = {
    box({-0.192, 0, 0.024}, {0.012, 0.0185, 0.046}, Paint::kShell),
    box({0.0225, 0, 0.027}, {0.003, 0.020, 0.043}, Paint::kShell),
    box({-0.089, 0.0248, 0.055}, {0.114, 0.0062, 0.025}, Paint::kShell),
    box({-0.089, 0, 0.075}, {0.114, 0.020, 0.005}, Paint::kDark),
    disc({-0.176, 0, 0}, kX, 0.0140, 0.004, Paint::kMotor),
};

constexpr Solid kEduUpper[] = {
    box({-0.065, 0, 0}, {0.0675, 0.0103, 0.0185}, Paint::kShell),
    box({-0.155, 0, 0}, {0.025, 0.0103, 0.0122}, Paint::kShell),
    disc({-0.1133, 0.0175, 0}, kY, 0.0225, 0.0077, Paint::kMotor),
    disc({-0.1133, 0.0255, 0}, kY, 0.0150, 0.0008, Paint::kFinger),
    disc({0, -0.002, 0}, kY, 0.0195, 0.0122, Paint::kShell),
    box({-0.080, 0, 0}, {0.0995, 0.0103, 0.0185}, Paint::kShell, Role::kTouches),
};

constexpr Solid kEduMiddle[] = {
    box({0, -0.0234, -0.085}, {0.0187, 0.0102, 0.0775}, Paint::kShell),
    capsule({0, -0.0095, 0}, {0, -0.02, -0.02}, 0.0155, Paint::kShell),
    disc({0, -0.0255, -0.16}, kY, 0.0220, 0.012, Paint::kShell),
    disc({0, -0.0058, -0.0465}, kY, 0.0222, 0.0075, Paint::kMotor),
    disc({0, 0.0021, -0.0465}, kY, 0.0150, 0.0008, Paint::kFinger),
    box({0, -0.0250, -0.092}, {0.0190, 0.0120, 0.090}, Paint::kShell, Role::kTouches),
};

constexpr Solid kEduLower[] = {
    disc({0, -0.007, 0}, kY, 0.014, 0.007, Paint::kShell),
    box({0, -0.008, -0.03}, {0.0118, 0.0056, 0.03}, Paint::kShell),
    capsule({0, -0.008, -0.01}, {0, -0.008, -0.14}, 0.0075, Paint::kShell, Role::kBoth),
    capsule({0, -0.008, -0.148}, {0, -0.008, -0.151}, 0.0109, Paint::kDark, Role::kBoth),
};

constexpr Finger kEdu{
    .links = {{
        {.origin = {0, 0, 0},
         .axis = {-1, 0, 0},
         .inertia = {0.14854, {-0.079, 0, 0}, {3e-5, 4.1e-4, 4.1e-4, 5e-5, 0, 0}},
         .solids = kEduUpper},
        {.origin = {0, -0.014, 0},
         .axis = {0, 1, 0},
         .inertia = {0.14854, {0, -0.019, -0.079}, {4.1e-4, 4.1e-4, 3e-5, 0, 0, 5e-5}},
         .solids = kEduMiddle},
        {.origin = {0, -0.03745, -kLinkLength},
         .axis = {0, 1, 0},
         // The source says zz = 0, which no body has; this is what a rod of this mass and 11 mm
         // radius has.
         .inertia = {0.03070, {0, -0.009, -0.089}, {1.2e-4, 1.2e-4, 2e-6, 0, 0, 0}},
         .solids = kEduLower},
    }},
    .tip_origin = {0, -0.008, -kLinkLength},
    .tip = {0.010, {0, 0, 0}, {1.6667e-7, 1.6667e-7, 1.6667e-7, 0, 0, 0}},
    .base = kEduBase,
    .tip_solids = {},
};

// ----------------------------------------------------------------------------------------------
// Pro

constexpr Solid kProBase[] = {
    box({0, 0.262, 0.030}, {0.022, 0.010, 0.050}, Paint::kDark),
    box({0, 0.004, 0.030}, {0.022, 0.008, 0.050}, Paint::kDark),
    disc({0, 0.018, 0}, kY, 0.018, 0.008, Paint::kMotor),
    disc({0, 0.247, 0}, kY, 0.016, 0.006, Paint::kMotor),
};

constexpr Solid kProUpper[] = {
    box({0.0052, 0.13, 0}, {0.0112, 0.100, 0.0195}, Paint::kShell),
    disc({0.0038, 0.0505, 0}, kX, 0.0232, 0.0132, Paint::kShell),
    disc({0.0052, 0.103, 0}, kX, 0.0250, 0.0107, Paint::kShell),
    box({0, 0.228, 0}, {0.0219, 0.0125, 0.021}, Paint::kShell),
    disc({0.0237, 0.1643, 0}, kX, 0.0221, 0.008, Paint::kMotor),
    disc({0.0325, 0.1643, 0}, kX, 0.0150, 0.0008, Paint::kFinger),
    box({0.0032, 0.132, 0}, {0.0170, 0.109, 0.0215}, Paint::kShell, Role::kTouches),
};

constexpr Solid kProMiddle[] = {
    box({0.0388, 0, -0.08}, {0.0102, 0.0195, 0.085}, Paint::kShell),
    disc({0.022, 0, 0}, kX, 0.0220, 0.0222, Paint::kShell),
    disc({0.037, 0, -0.16}, kX, 0.0237, 0.0132, Paint::kShell),
    disc({0.0388, 0, -0.103}, kX, 0.0243, 0.0115, Paint::kShell),
    disc({0.0568, 0, -0.0462}, kX, 0.0221, 0.008, Paint::kMotor),
    disc({0.0656, 0, -0.0462}, kX, 0.0150, 0.0008, Paint::kFinger),
    box({0.0378, 0, -0.09}, {0.0125, 0.0215, 0.094}, Paint::kShell, Role::kTouches),
};

constexpr Solid kProLower[] = {
    disc({0.0128, 0, 0}, kX, 0.0220, 0.0128, Paint::kShell),
    box({0.0189, 0, -0.035}, {0.0084, 0.0142, 0.025}, Paint::kShell),
    capsule({0.019, 0, -0.01}, {0.019, 0, -0.14}, 0.0095, Paint::kShell, Role::kBoth),
};

constexpr Solid kProTip[] = {
    disc({0, 0, 0.012}, kZ, 0.0088, 0.0095, Paint::kTip),
};

constexpr Finger kPro{
    .links = {{
        {.origin = {0, 0, 0},
         .axis = {0, 1, 0},
         .inertia = {0.26689,
                     {0.006, 0.122, 0},
                     {1.02362e-3, 6.450e-5, 1.02225e-3, 8.89e-6, -1.9e-7, 1.06e-6}},
         .solids = kProUpper},
        {.origin = {0.01685, 0.0505, 0},
         .axis = {1, 0, 0},
         .inertia = {0.27163,
                     {0.03935008, -0.00012438, -0.08666705},
                     {9.4060e-4, 9.4824e-4, 7.573e-5, -4.6e-7, -3.479e-5, 1.64e-6}},
         .solids = kProMiddle},
        {.origin = {0.05015, 0, -kLinkLength},
         .axis = {1, 0, 0},
         .inertia = {0.05569,
                     {0.016327, -0.00001095, -0.04284052},
                     {1.3626e-4, 1.3372e-4, 6.67e-6, 0, -6.62e-6, 4e-8}},
         .solids = kProLower},
    }},
    .tip_origin = {0.019, 0, -kLinkLength},
    .tip = {0.0092, {-0.00001194, 0, 0.0156006}, {1.55e-6, 1.55e-6, 3.2e-7, 0, 0, 0}},
    .base = kProBase,
    .tip_solids = kProTip,
};

// ----------------------------------------------------------------------------------------------
// One

constexpr Solid kOneBase[] = {
    box({-0.025, 0.222, -0.003}, {0.060, 0.036, 0.025}, Paint::kDark),
    box({0, 0.215, 0.051}, {0.020, 0.020, 0.029}, Paint::kDark),
    box({0, -0.036, 0.028}, {0.012, 0.006, 0.052}, Paint::kDark),
};

constexpr Solid kOneUpper[] = {
    box({-0.004, 0.012, 0}, {0.018, 0.016, 0.0185}, Paint::kShell),
    capsule({-0.004, -0.008, 0}, {-0.004, 0, 0}, 0.0185, Paint::kShell),
    box({0, 0.09, 0}, {0.0105, 0.087, 0.0185}, Paint::kShell),
    disc({-0.0175, 0.1125, 0}, kX, 0.0222, 0.0075, Paint::kMotor),
    disc({-0.0254, 0.1125, 0}, kX, 0.0150, 0.0008, Paint::kFinger),
    box({-0.010, 0.155, 0}, {0.012, 0.022, 0.0185}, Paint::kShell),
    box({-0.002, 0.0755, 0}, {0.0140, 0.1015, 0.0185}, Paint::kShell, Role::kTouches),
};

constexpr Solid kOneMiddle[] = {
    box({0.0285, 0, -0.08}, {0.0105, 0.0185, 0.085}, Paint::kShell),
    disc({0.0327, 0, 0}, kX, 0.0185, 0.0179, Paint::kShell),
    disc({0.0325, 0, -0.16}, kX, 0.0220, 0.018, Paint::kShell),
    disc({0.046, 0, -0.0465}, kX, 0.0222, 0.0075, Paint::kMotor),
    disc({0.0539, 0, -0.0465}, kX, 0.0150, 0.0008, Paint::kFinger),
    box({0.0300, 0, -0.082}, {0.0150, 0.0190, 0.100}, Paint::kShell, Role::kTouches),
};

constexpr Solid kOneLower[] = {
    disc({0.0038, 0, 0}, kX, 0.0122, 0.0103, Paint::kShell),
    capsule({-0.0008, 0, -0.005}, {-0.0005, 0, -0.15}, 0.0075, Paint::kShell, Role::kBoth),
};

constexpr Finger one(double tip_mass, double tip_moment) {
  return {
      .links = {{
          {.origin = {0, 0, 0},
           .axis = {0, 1, 0},
           .inertia = {0.200, {0, 0.06, 0}, {3.53333e-4, 5.33333e-5, 3.53333e-4, 0, 0, 0}},
           .solids = kOneUpper},
          {.origin = {0, 0, 0},
           .axis = {-1, 0, 0},
           .inertia = {0.200, {0.028, 0, -0.08}, {3.53333e-4, 3.53333e-4, 5.33333e-5, 0, 0, 0}},
           .solids = kOneMiddle},
          {.origin = {0, 0, -kLinkLength},
           .axis = {1, 0, 0},
           .inertia = {0.010, {0, 0, -0.06}, {1.66667e-5, 1.66667e-5, 6.66667e-7, 0, 0, 0}},
           .solids = kOneLower},
      }},
      .tip_origin = {0, 0, -kLinkLength},
      .tip = {tip_mass, {0, 0, 0}, {tip_moment, tip_moment, tip_moment, 0, 0, 0}},
      .base = kOneBase,
      .tip_solids = {},
  };
}

constexpr Finger kOneTri = one(0.020, 3.3333e-7);
constexpr Finger kOneSingle = one(0.002, 3.3333e-8);

}  // namespace

Colour colour(Paint paint, Variant variant, int finger) noexcept {
  constexpr Colour kAccents[] = {
      {0.80F, 0.16F, 0.13F, 1}, {0.20F, 0.58F, 0.25F, 1}, {0.15F, 0.35F, 0.75F, 1}};
  switch (paint) {
    case Paint::kShell:
      if (variant == Variant::kPro) return {0.82F, 0.79F, 0.77F, 1};
      if (variant == Variant::kOne) return {0.34F, 0.35F, 0.37F, 1};
      return {0.90F, 0.90F, 0.88F, 1};
    case Paint::kDark:
      return {0.16F, 0.16F, 0.17F, 1};
    case Paint::kMotor:
      return {0.09F, 0.09F, 0.10F, 1};
    case Paint::kTip:
      return {0.20F, 0.21F, 0.22F, 1};
    case Paint::kFinger:
      return kAccents[finger];
    case Paint::kProfile:
      return {0.74F, 0.76F, 0.78F, 1};
    case Paint::kGroove:
      return {0.36F, 0.37F, 0.39F, 1};
    case Paint::kBracket:
      return {0.22F, 0.23F, 0.25F, 1};
    case Paint::kWall:
      break;
  }
  if (variant == Variant::kEdu) return {0.85F, 0.92F, 0.97F, 0.16F};
  return {0.56F, 0.55F, 0.58F, 0.45F};
}

const Finger& finger_blueprint(const RobotDescription& description) noexcept {
  switch (description.variant) {
    case Variant::kPro:
      return kPro;
    case Variant::kOne:
      return description.arrangement == Arrangement::kSingleFinger ? kOneSingle : kOneTri;
    case Variant::kEdu:
      break;
  }
  return kEdu;
}

double finger_azimuth(const RobotDescription& description, int index) noexcept {
  // A single Edu finger extends along -x; all other fingers do not.
  const bool single_edu =
      description.variant == Variant::kEdu && description.arrangement == Arrangement::kSingleFinger;
  return (single_edu ? 2 * kRightAngle : kRightAngle) - index * kThird;
}

Eigen::Isometry3d base_in_platform(const RobotDescription& description, int index) {
  const double azimuth = finger_azimuth(description, index);
  double radius = 0;
  if (description.arrangement == Arrangement::kTriFinger) {
    if (description.variant == Variant::kEdu) radius = 0.0455;
    if (description.variant == Variant::kOne) radius = 0.04;
  }
  // The finger extends along -x of its base frame on the Edu, and along +y on the others.
  const double forward = description.variant == Variant::kEdu ? 2 * kRightAngle : kRightAngle;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() << radius * std::cos(azimuth), radius * std::sin(azimuth),
      finger_height(description);
  pose.linear() = Eigen::AngleAxisd(azimuth - forward, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return pose;
}

Eigen::Isometry3d platform_in_world(const RobotDescription& description) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  if (description.flipped) {
    pose.linear() = Eigen::Vector3d(-1, 1, -1).asDiagonal();
    pose.translation().z() = flip_height(description);
  }
  return pose;
}

Inertia lower_with_tip(const Finger& finger) noexcept {
  const auto moment = [](const Inertia& part) {
    const auto& [xx, yy, zz, xy, xz, yz] = part.moment;
    return (Eigen::Matrix3d() << xx, xy, xz, xy, yy, yz, xz, yz, zz).finished();
  };
  // Moment of inertia of a point mass at `offset` about the origin.
  const auto steiner = [](double mass, const Eigen::Vector3d& offset) -> Eigen::Matrix3d {
    return mass *
           (offset.squaredNorm() * Eigen::Matrix3d::Identity() - offset * offset.transpose());
  };
  const Inertia& lower = finger.links[2].inertia;
  const Inertia& tip = finger.tip;
  const Eigen::Vector3d lower_centre = vector(lower.centre);
  const Eigen::Vector3d tip_centre = vector(finger.tip_origin) + vector(tip.centre);
  const double mass = lower.mass + tip.mass;
  const Eigen::Vector3d centre = (lower.mass * lower_centre + tip.mass * tip_centre) / mass;
  const Eigen::Matrix3d sum = moment(lower) + steiner(lower.mass, lower_centre - centre) +
                              moment(tip) + steiner(tip.mass, tip_centre - centre);
  return {mass,
          {centre.x(), centre.y(), centre.z()},
          {sum(0, 0), sum(1, 1), sum(2, 2), sum(0, 1), sum(0, 2), sum(1, 2)}};
}

const char* finger_suffix(const RobotDescription& description, int index) noexcept {
  constexpr const char* kSuffixes[] = {"_0", "_120", "_240"};
  return description.arrangement == Arrangement::kSingleFinger ? "" : kSuffixes[index];
}

std::vector<Profile> frame_profiles(const RobotDescription& description) {
  // The finger bases hang 80 mm below the underside of the radial profiles.
  const double beam_height = finger_height(description) + 0.08 + 0.02;
  constexpr double kPostRadius = 0.32;
  std::vector<Profile> profiles;
  profiles.reserve(2 * kMaxFingers + camera_figures().size());
  const auto on_post = [&](int index, double radius, double height) {
    const double azimuth = finger_azimuth(description, index);
    return Eigen::Vector3d(radius * std::cos(azimuth), radius * std::sin(azimuth), height);
  };
  const int posts = num_fingers(description);
  for (int i = 0; i < posts; ++i)
    profiles.push_back(
        {on_post(i, kPostRadius, 0.008), on_post(i, kPostRadius, flip_height(description))});
  for (int i = 0; i < posts; ++i)
    profiles.push_back(
        {on_post(i, 0.05, beam_height), on_post(i, kPostRadius - 0.02, beam_height)});
  if (description.arrangement == Arrangement::kTriFinger && description.cameras) {
    for (const CameraFigures& camera : camera_figures()) {
      // The profile ends behind the camera, out of its sight, and begins at the nearest post.
      const Eigen::Vector3d forward(camera.rotation[2], camera.rotation[5], camera.rotation[8]);
      const Eigen::Vector3d mount = vector(camera.position) - 0.085 * forward;
      Eigen::Vector3d nearest = on_post(0, kPostRadius, mount.z());
      for (int i = 1; i < posts; ++i) {
        const Eigen::Vector3d post = on_post(i, kPostRadius, mount.z());
        if ((post - mount).norm() < (nearest - mount).norm()) nearest = post;
      }
      const Eigen::Vector3d along = (mount - nearest).normalized();
      profiles.push_back({nearest + 0.02 * along, mount + 0.03 * along});
    }
  }
  return profiles;
}

std::vector<Ring> boundary_rings(const RobotDescription& description) {
  if (description.arrangement == Arrangement::kSingleFinger) return {{0.22, 0, 0.277, 0.065}};
  if (description.variant == Variant::kEdu) return {{0.242, 0, 0.242, 0.25}};
  return {{0.195, 0, 0.195, 0.030}, {0.195, 0.030, 0.278, 0.175}};
}

}  // namespace trifinger::detail
