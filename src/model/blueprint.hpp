// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <span>
#include <vector>

#include "trifinger/model/robot_description.hpp"

// The parts that the MuJoCo model and the URDF file are both made of.
namespace trifinger::detail {

enum class Paint { kShell, kDark, kMotor, kTip, kFinger, kProfile, kGroove, kBracket, kWall };

struct Colour {
  float red, green, blue, opacity;
};

// Returns the colour of a paint. `finger` selects the accent of `Paint::kFinger`.
[[nodiscard]] Colour colour(Paint paint, Variant variant, int finger) noexcept;

enum class Form { kBox, kCylinder, kCapsule, kSphere };

// Purpose of a solid. Looks: it is drawn. Touches: it collides; such solids are few and simple,
// because they determine the speed.
enum class Role { kLooks, kTouches, kBoth };

// A primitive in the frame of its link.
struct Solid {
  Form form;
  Triple from;    // Box and sphere: the centre. Other forms: one end of the axis.
  Triple to;      // Box: half sizes. Sphere: unused. Other forms: the other end.
  double radius;  // Box: unused.
  Paint paint;
  Role role;
};

struct Inertia {
  double mass;
  Triple centre;                 // Centre of mass, in the link frame.
  std::array<double, 6> moment;  // Inertia about the centre: xx yy zz xy xz yz.
};

struct Link {
  Triple origin;  // Origin of its joint, in the parent's frame.
  Triple axis;    // Axis of its joint.
  Inertia inertia;
  std::span<const Solid> solids;
};

struct Finger {
  std::array<Link, kJointsPerFinger> links;
  Triple tip_origin;  // Origin of the tip, in the lower link's frame.
  Inertia tip;
  std::span<const Solid> base;        // Solids that carry the finger, in the finger base frame.
  std::span<const Solid> tip_solids;  // Solids of the tip besides the sphere, in the tip frame.
};

[[nodiscard]] const Finger& finger_blueprint(const RobotDescription& description) noexcept;

// Pose of a finger's base in the platform frame. Fingers 0, 1 and 2 are those named 0, 120 and 240.
[[nodiscard]] Eigen::Isometry3d base_in_platform(const RobotDescription& description, int index);

// Direction from the centre along which a finger extends, about the platform's z axis [rad].
[[nodiscard]] double finger_azimuth(const RobotDescription& description, int index) noexcept;

// Pose of the platform in the world: identity unless flipped.
[[nodiscard]] Eigen::Isometry3d platform_in_world(const RobotDescription& description);

// Inertia of the lower link and the tip, as one rigid body.
[[nodiscard]] Inertia lower_with_tip(const Finger& finger) noexcept;

[[nodiscard]] inline Eigen::Vector3d vector(const Triple& triple) noexcept {
  return {triple[0], triple[1], triple[2]};
}

// Suffix of a finger's names: "", "_0", "_120" or "_240".
[[nodiscard]] const char* finger_suffix(const RobotDescription& description, int index) noexcept;

// A straight aluminium profile of 40 x 40 mm.
struct Profile {
  Eigen::Vector3d from, to;
};

// Profiles of the frame, in the platform frame. The posts come first, one per finger.
[[nodiscard]] std::vector<Profile> frame_profiles(const RobotDescription& description);

// A closed wall of flat panels around the z axis, in the platform frame.
struct Ring {
  double lower_radius, lower_height;  // Inner face.
  double upper_radius, upper_height;
};
[[nodiscard]] std::vector<Ring> boundary_rings(const RobotDescription& description);

}  // namespace trifinger::detail
