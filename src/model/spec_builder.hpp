// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mujoco/mujoco.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "blueprint.hpp"
#include "spec.hpp"

namespace trifinger::detail {

// Groups that viewers can show or hide.
inline constexpr int kLooksGroup = 0;
inline constexpr int kSurroundGroup = 1;  // Frame and wall, which surround everything that moves.
inline constexpr int kTouchesGroup = 3;
inline constexpr int kSiteGroup = 4;

// Bit masks of MuJoCo that say who can touch whom. Pairs that cannot meet are excluded: links and
// table if the link hangs too high, upper links among themselves, and middle links with the
// boundary unless the fingers hang low. A test checks this geometry.
enum Bit : int {
  kTableBit = 1,
  kBoundaryBit = 2,
  kObjectBit = 4,
  kLowerBit = 8,
  kMiddleBit = 16,
  kUpperBit = 32,
};

// The tip's rubber determines the contact, whatever it touches.
inline constexpr int kTipPriority = 1;

// Everything that moves has a number: fingers their own, then the objects.
inline constexpr int kScene = -1;

template <std::size_t size>
void copy(double (&to)[size], const Eigen::Matrix<double, static_cast<int>(size), 1>& from) {
  Eigen::Map<Eigen::Matrix<double, static_cast<int>(size), 1>>{to} = from;
}

template <std::size_t size>
void copy(double (&to)[size], const Triple& from) {
  std::ranges::copy(from, to);
}

inline void set_pose(double (&position)[3], double (&quaternion)[4],
                     const Eigen::Isometry3d& pose) {
  copy(position, Eigen::Vector3d(pose.translation()));
  const Eigen::Quaterniond rotation(pose.linear());
  quaternion[0] = rotation.w();
  quaternion[1] = rotation.x();
  quaternion[2] = rotation.y();
  quaternion[3] = rotation.z();
}

inline void set_colour(float (&rgba)[4], const Colour& colour) {
  rgba[0] = colour.red;
  rgba[1] = colour.green;
  rgba[2] = colour.blue;
  rgba[3] = colour.opacity;
}

// Builds the spec of a scene, part by part. Each group of functions is in the file that it names.
class SpecBuilder {
 public:
  SpecBuilder(const RobotDescription& description, Detail detail);

  Spec take() { return std::move(spec_); }

 private:
  // spec.cpp
  void set_options();
  void set_view();
  mjsGeom* add_geom(mjsBody* body, mjtGeom type);
  mjsGeom* add_box(mjsBody* body, const Eigen::Isometry3d& pose, const Eigen::Vector3d& half);
  mjsGeom* add_solid(mjsBody* body, const Solid& solid, int finger);
  void paint(mjsGeom* geom, Paint paint, int finger = 0) const;
  void name(mjsElement* element, const std::string& text);
  static void surround(mjsGeom* geom);

  // spec_scene.cpp
  void add_surroundings();
  void add_material(const char* material_name, float specular, float shininess);
  void add_light(const Eigen::Vector3d& position, float brightness, bool shadow);
  void add_table();
  void add_platform();
  void add_ring(const Ring& ring);
  void add_frame();
  void add_part(const Eigen::Isometry3d& pose, const Eigen::Vector3d& half, Paint colour);
  void add_camera(const CameraFigures& figures);

  // spec_fingers.cpp
  void add_fingers();
  void add_link(mjsBody* body, const Finger& finger, int index, int joint);
  void add_joint(mjsBody* body, const Link& link, const std::string& joint_name, int index);
  void add_tip(mjsBody* lower, const Finger& finger, int index, const std::string& tip_name);

  // spec_objects.cpp
  void add_objects();
  void add_box_object(mjsBody* body, const ObjectDescription& object);
  void add_stick(mjsBody* body, const ObjectDescription& object);
  void add_ball(mjsBody* body, const ObjectDescription& object);
  mjsGeom* object_geom(mjsBody* body, const ObjectDescription& object, mjtGeom type);
  [[nodiscard]] Triple resting_place(const ObjectDescription& object, std::size_t place) const;
  void add_initial_key();

  // spec_contacts.cpp
  struct Touching {
    mjsGeom* geom;
    int mover;
  };
  static bool can_meet(const Touching& one, const Touching& other);
  void touch(mjsGeom* geom, int own, int meets, int mover);
  void add_pairs();
  void add_pair(std::size_t first, std::size_t second, double friction);
  std::string contact_name(std::size_t index);

  const RobotDescription& description_;
  const bool pictures_;
  Spec spec_;
  mjsBody* world_;
  mjsBody* platform_{nullptr};
  std::vector<Touching> touching_;
};

}  // namespace trifinger::detail
