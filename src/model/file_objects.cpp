// SPDX-License-Identifier: BSD-3-Clause
#include "file_objects.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "face_colours.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::detail {
std::array<double, 4> unit_quaternion(const ObjectDescription& object) {
  std::array<double, 4> unit = object.orientation;
  double norm = 0;
  for (const double number : unit) norm = std::hypot(norm, number);
  for (double& number : unit) number /= norm;
  return unit;
}

namespace {

mjsGeom* add_shape(mjsBody* body, mjtGeom type, const std::array<double, 3>& size,
                   const std::array<float, 3>& colour) {
  mjsGeom* const geom = mjs_addGeom(body, nullptr);
  geom->type = type;
  std::ranges::copy(size, geom->size);
  std::ranges::copy(colour, geom->rgba);
  geom->rgba[3] = 1.0F;
  geom->group = 0;
  return geom;
}

// Makes a shape that is only seen.
void only_look(mjsGeom* geom) {
  geom->contype = 0;
  geom->conaffinity = 0;
  geom->density = 0;
}

// Makes the shape that touches and weighs, whatever the file's defaults are.
void touch(mjsGeom* geom, const ObjectDescription& object) {
  constexpr std::array kFriction{1.0, 0.005, 5e-5};
  geom->contype = 1;
  geom->conaffinity = 1;
  geom->mass = object.mass;
  std::ranges::copy(kFriction, geom->friction);
  // With sliding friction alone, round bodies would roll for ever.
  geom->condim = object.shape == ObjectShape::kBox ? 4 : 6;
}

void add_box(mjsBody* body, const ObjectDescription& object) {
  const std::array<double, 3> half{object.size[0] / 2, object.size[1] / 2, object.size[2] / 2};
  constexpr std::array kDark{0.10F, 0.10F, 0.11F};
  touch(add_shape(body, mjGEOM_BOX, half, kDark), object);
  only_look(add_shape(body, mjGEOM_BOX, half, kDark));
  struct Face {
    std::size_t axis;
    int side;
  };
  constexpr std::array<Face, 6> kFaces{{{0, 1}, {1, 1}, {2, 1}, {2, -1}, {0, -1}, {1, -1}}};
  const double rim = box_rim(object);
  for (std::size_t i = 0; i < kFaces.size(); ++i) {
    const auto& [axis, side] = kFaces[i];
    std::array<double, 3> plate{half[0] - rim, half[1] - rim, half[2] - rim};
    plate[axis] = 0.0002;
    mjsGeom* const tile = add_shape(body, mjGEOM_BOX, plate, rgb_of(object.colours[i]).value());
    tile->pos[axis] = side * half[axis];
    only_look(tile);
  }
}

void add_stick(mjsBody* body, const ObjectDescription& object) {
  const double radius = object.size[1] / 2;
  const double half = object.size[0] / 2 - radius;
  mjsGeom* const rod = add_shape(body, mjGEOM_CAPSULE, {radius, 0, 0}, {0.13F, 0.30F, 0.58F});
  const std::array<double, 6> ends{-half, 0, 0, half, 0, 0};
  std::ranges::copy(ends, rod->fromto);
  touch(rod, object);
}

// The poses of the objects follow all others, because their bodies are the last ones.
void add_to_key_frames(mjSpec* spec, std::span<const ObjectDescription> objects) {
  for (mjsElement* element = mjs_firstElement(spec, mjOBJ_KEY); element != nullptr;
       element = mjs_nextElement(spec, element)) {
    mjsKey* const key = mjs_asKey(element);
    int size = 0;
    const double* const given = mjs_getDouble(key->qpos, &size);
    if (size == 0) continue;  // MuJoCo takes the initial pose.
    std::vector<double> qpos(given, given + size);
    for (const ObjectDescription& object : objects) {
      qpos.insert(qpos.end(), object.position->begin(), object.position->end());
      const std::array<double, 4> unit = unit_quaternion(object);
      qpos.insert(qpos.end(), unit.begin(), unit.end());
    }
    mjs_setDouble(key->qpos, qpos.data(), static_cast<int>(qpos.size()));
    const double* const velocity = mjs_getDouble(key->qvel, &size);
    if (size == 0) continue;
    std::vector<double> qvel;
    qvel.reserve(static_cast<std::size_t>(size) + 6 * objects.size());
    qvel.insert(qvel.end(), velocity, velocity + size);
    qvel.insert(qvel.end(), 6 * objects.size(), 0.0);
    mjs_setDouble(key->qvel, qvel.data(), static_cast<int>(qvel.size()));
  }
}

}  // namespace

void add_objects(mjSpec* spec, std::span<const ObjectDescription> objects) {
  for (const ObjectDescription& object : objects) {
    validate_object(object);
    require(object.position.has_value(), "object '" + object.name +
                                             "' needs a position: only the table of a TriFinger "
                                             "has places for objects");
    mjsBody* const body = mjs_addBody(mjs_findBody(spec, "world"), nullptr);
    mjs_setName(body->element, object.name.c_str());
    std::ranges::copy(*object.position, body->pos);
    std::ranges::copy(unit_quaternion(object), body->quat);
    mjs_setName(mjs_addFreeJoint(body)->element, object.name.c_str());
    switch (object.shape) {
      case ObjectShape::kBox:
        add_box(body, object);
        break;
      case ObjectShape::kStick:
        add_stick(body, object);
        break;
      case ObjectShape::kBall:
        touch(add_shape(body, mjGEOM_SPHERE, {object.size[0] / 2, 0, 0}, {0.93F, 0.46F, 0.10F}),
              object);
        break;
    }
  }
  if (!objects.empty()) add_to_key_frames(spec, objects);
}

}  // namespace trifinger::detail
