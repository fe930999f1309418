// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <vector>

#include "face_colours.hpp"
#include "file_objects.hpp"
#include "spec_builder.hpp"

namespace trifinger::detail {
namespace {

constexpr int kObjectMeets = kTableBit | kBoundaryBit | kObjectBit;

// Adds rolling friction. With sliding friction alone, round bodies would roll for ever.
void resist_rolling(mjsGeom* geom) {
  geom->condim = 6;
  geom->friction[2] = 5e-5;
}

}  // namespace

void SpecBuilder::add_objects() {
  std::size_t place = 0;
  for (const ObjectDescription& object : description_.objects) {
    mjsBody* body = mjs_addBody(world_, nullptr);
    name(body->element, object.name);
    copy(body->pos, object.position ? *object.position : resting_place(object, place++));
    std::ranges::copy(unit_quaternion(object), body->quat);
    mjsJoint* joint = mjs_addFreeJoint(body);
    name(joint->element, object.name);
    switch (object.shape) {
      case ObjectShape::kBox:
        add_box_object(body, object);
        break;
      case ObjectShape::kStick:
        add_stick(body, object);
        break;
      case ObjectShape::kBall:
        add_ball(body, object);
        break;
    }
  }
}

void SpecBuilder::add_box_object(mjsBody* body, const ObjectDescription& object) {
  const Eigen::Vector3d half = vector(object.size) / 2;
  mjsGeom* geom = object_geom(body, object, mjGEOM_BOX);
  copy(geom->size, half);
  set_colour(geom->rgba, {0.10F, 0.10F, 0.11F, 1});
  if (!pictures_) return;

  struct Face {
    int axis;
    int side;
  };
  constexpr std::array<Face, 6> kFaces{{{0, 1}, {1, 1}, {2, 1}, {2, -1}, {0, -1}, {1, -1}}};
  const double rim = box_rim(object);
  for (std::size_t i = 0; i < kFaces.size(); ++i) {
    const Face& face = kFaces[i];
    Eigen::Vector3d plate = half.array() - rim;
    plate[face.axis] = 0.0002;
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation()[face.axis] = face.side * half[face.axis];
    mjsGeom* tile = add_box(body, pose, plate);
    const auto [red, green, blue] = rgb_of(object.colours[i]).value();
    set_colour(tile->rgba, {red, green, blue, 1});
    mjs_setString(tile->material, "plastic");
  }
}

void SpecBuilder::add_stick(mjsBody* body, const ObjectDescription& object) {
  const double radius = object.size[1] / 2;
  const double half = object.size[0] / 2 - radius;
  mjsGeom* rod = object_geom(body, object, mjGEOM_CAPSULE);
  rod->fromto[0] = -half;
  rod->fromto[3] = half;
  std::fill(rod->fromto + 1, rod->fromto + 3, 0.0);
  std::fill(rod->fromto + 4, rod->fromto + 6, 0.0);
  rod->size[0] = radius;
  set_colour(rod->rgba, {0.13F, 0.30F, 0.58F, 1});
  resist_rolling(rod);
  if (!pictures_) return;
  const Solid grip{Form::kCylinder, {0.45 * half, 0, 0}, {0.95 * half, 0, 0},
                   1.06 * radius,   Paint::kMotor,       Role::kLooks};
  add_solid(body, grip, 0);
}

void SpecBuilder::add_ball(mjsBody* body, const ObjectDescription& object) {
  const double radius = object.size[0] / 2;
  mjsGeom* ball = object_geom(body, object, mjGEOM_SPHERE);
  ball->size[0] = radius;
  set_colour(ball->rgba, {0.93F, 0.46F, 0.10F, 1});
  resist_rolling(ball);
  if (!pictures_) return;
  // A band makes it visible that the ball rolls.
  const Solid band{Form::kCylinder, {0, 0, -0.12 * radius}, {0, 0, 0.12 * radius},
                   1.003 * radius,  Paint::kShell,          Role::kLooks};
  add_solid(body, band, 0);
}

mjsGeom* SpecBuilder::object_geom(mjsBody* body, const ObjectDescription& object, mjtGeom type) {
  mjsGeom* geom = add_geom(body, type);
  name(geom->element, object.name);
  geom->mass = object.mass;
  const auto index = &object - description_.objects.data();
  touch(geom, kObjectBit, kObjectMeets, kMaxFingers + static_cast<int>(index));
  if (pictures_) mjs_setString(geom->material, "plastic");
  return geom;
}

void SpecBuilder::add_initial_key() {
  std::vector<double> positions;
  for (int i = 0; i < num_fingers(description_); ++i)
    for (const double angle : figures(description_).initial_position) positions.push_back(angle);
  std::size_t place = 0;
  for (const ObjectDescription& object : description_.objects) {
    const Triple at = object.position ? *object.position : resting_place(object, place++);
    positions.insert(positions.end(), at.begin(), at.end());
    const std::array<double, 4> orientation = unit_quaternion(object);
    positions.insert(positions.end(), orientation.begin(), orientation.end());
  }
  mjsKey* key = mjs_addKey(spec_.get());
  name(key->element, "initial");
  mjs_setDouble(key->qpos, positions.data(), static_cast<int>(positions.size()));

  std::vector<double> velocities(static_cast<std::size_t>(num_joints(description_)), 0.0);
  for (const ObjectDescription& object : description_.objects) {
    // MuJoCo expresses the rotation of a free body in the body's frame.
    const auto [w, x, y, z] = unit_quaternion(object);
    const Eigen::Vector3d turning =
        Eigen::Quaterniond(w, x, y, z).conjugate() * vector(object.angular_velocity);
    velocities.insert(velocities.end(), object.velocity.begin(), object.velocity.end());
    velocities.insert(velocities.end(), turning.begin(), turning.end());
  }
  mjs_setDouble(key->qvel, velocities.data(), static_cast<int>(velocities.size()));
}

// Returns a place that is clear of the initial pose of every variant's fingers.
Triple SpecBuilder::resting_place(const ObjectDescription& object, std::size_t place) const {
  constexpr double kTri[4][2] = {{0, 0}, {-0.115, -0.035}, {0.027, 0.117}, {0.088, -0.082}};
  constexpr double kSingle[4][2] = {{0, 0.12}, {0.12, -0.06}, {-0.12, 0.06}, {-0.02, -0.15}};
  const auto& [x, y] =
      description_.arrangement == Arrangement::kTriFinger ? kTri[place] : kSingle[place];
  const std::size_t height = object.shape == ObjectShape::kBall    ? 0
                             : object.shape == ObjectShape::kStick ? 1
                                                                   : 2;
  return {x, y, object.size[height] / 2};
}

}  // namespace trifinger::detail
