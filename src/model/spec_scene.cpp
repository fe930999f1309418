// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "spec_builder.hpp"

namespace trifinger::detail {
namespace {

constexpr double kTableHalf = 0.5;
constexpr double kFloorHeight = -0.75;
constexpr int kPanels = 18;
constexpr double kPanelThickness = 0.01;

// The point that the lights face.
const Eigen::Vector3d kLit{0, 0, 0.15};

// Returns a frame whose z axis points along `direction` and whose y axis stays level.
Eigen::Matrix3d along(const Eigen::Vector3d& direction) {
  const Eigen::Vector3d z = direction.normalized();
  const Eigen::Vector3d aside = std::abs(z.z()) > 0.999
                                    ? Eigen::Vector3d(z.cross(Eigen::Vector3d::UnitX()))
                                    : Eigen::Vector3d(Eigen::Vector3d::UnitZ().cross(z));
  Eigen::Matrix3d rotation;
  rotation.col(2) = z;
  rotation.col(1) = aside.normalized();
  rotation.col(0) = rotation.col(1).cross(z);
  return rotation;
}

}  // namespace

void SpecBuilder::add_surroundings() {
  add_material("metal", 0.5F, 0.6F);
  add_material("plastic", 0.25F, 0.4F);
  add_material("rubber", 0.05F, 0.1F);
  add_material("matte", 0.05F, 0.1F);

  mjsTexture* sky = mjs_addTexture(spec_.get(), nullptr);
  mjs_setName(sky->element, "sky");
  sky->type = mjTEXTURE_SKYBOX;
  sky->builtin = mjBUILTIN_GRADIENT;
  sky->width = 256;
  sky->height = 1536;
  const double high[] = {0.70, 0.76, 0.82};
  const double low[] = {0.93, 0.94, 0.95};
  std::ranges::copy(high, sky->rgb1);
  std::ranges::copy(low, sky->rgb2);

  mjsGeom* floor = add_geom(world_, mjGEOM_PLANE);
  floor->pos[2] = kFloorHeight;
  floor->size[0] = floor->size[1] = 6;
  floor->size[2] = 0.5;
  set_colour(floor->rgba, {0.62F, 0.64F, 0.66F, 1});
  mjs_setString(floor->material, "matte");

  add_light({0.9, -1.2, 2.4}, 0.58F, true);
  add_light({-1.4, 0.4, 1.5}, 0.16F, false);
  add_light({0.5, 1.5, 1.2}, 0.12F, false);
}

void SpecBuilder::add_material(const char* material_name, float specular, float shininess) {
  mjsMaterial* material = mjs_addMaterial(spec_.get(), nullptr);
  mjs_setName(material->element, material_name);
  material->specular = specular;
  material->shininess = shininess;
}

void SpecBuilder::add_light(const Eigen::Vector3d& position, float brightness, bool shadow) {
  mjsLight* light = mjs_addLight(world_, nullptr);
  light->type = shadow ? mjLIGHT_SPOT : mjLIGHT_DIRECTIONAL;
  light->cutoff = 50;
  light->exponent = 1;
  copy(light->pos, position);
  copy(light->dir, Eigen::Vector3d((kLit - position).normalized()));
  light->castshadow = shadow;
  for (int i = 0; i < 3; ++i) {
    light->diffuse[i] = brightness;
    light->specular[i] = 0.2F * brightness;
    light->ambient[i] = 0;
  }
}

void SpecBuilder::add_table() {
  // For contacts a plane has no edge, so objects that leave the drawn table slide on. Planes are
  // the cheapest contacts.
  mjsGeom* plane = add_geom(world_, mjGEOM_PLANE);
  name(plane->element, "table");
  plane->size[0] = plane->size[1] = kTableHalf;
  plane->size[2] = 0.1;
  touch(plane, kTableBit, 0, kScene);
  const Colour top = description_.variant == Variant::kEdu   ? Colour{0.84F, 0.84F, 0.82F, 1}
                     : description_.variant == Variant::kPro ? Colour{0.21F, 0.23F, 0.20F, 1}
                                                             : Colour{0.20F, 0.17F, 0.21F, 1};
  plane->group = kTouchesGroup;
  if (!pictures_) return;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation().z() = -0.015;
  mjsGeom* slab = add_box(world_, pose, {kTableHalf, kTableHalf, 0.015});
  set_colour(slab->rgba, top);
  mjs_setString(slab->material, "matte");
  for (const double x : {-0.44, 0.44})
    for (const double y : {-0.44, 0.44}) {
      pose.translation() << x, y, 0.5 * (kFloorHeight - 0.03);
      mjsGeom* leg = add_box(world_, pose, {0.025, 0.025, -0.5 * kFloorHeight - 0.015});
      paint(leg, Paint::kBracket);
    }
}

void SpecBuilder::add_platform() {
  platform_ = mjs_addBody(world_, nullptr);
  name(platform_->element, "platform");
  set_pose(platform_->pos, platform_->quat, platform_in_world(description_));
  if (description_.boundary)
    for (const Ring& ring : boundary_rings(description_)) add_ring(ring);
  if (pictures_) add_frame();
  if (pictures_ && description_.cameras)
    for (const CameraFigures& camera : camera_figures()) add_camera(camera);
}

void SpecBuilder::add_ring(const Ring& ring) {
  const double step = 2 * std::numbers::pi / kPanels;
  const Eigen::Vector2d slope(ring.upper_radius - ring.lower_radius,
                              ring.upper_height - ring.lower_height);
  const double lean = std::atan2(slope.x(), slope.y());
  // The panel is wide enough to meet its neighbours at the outer, upper edge.
  const double half_width =
      (std::max(ring.lower_radius, ring.upper_radius) + kPanelThickness) * std::tan(step / 2);
  for (int i = 0; i < kPanels; ++i) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.rotate(Eigen::AngleAxisd(i * step, Eigen::Vector3d::UnitZ()));
    pose.translate(Eigen::Vector3d((ring.lower_radius + ring.upper_radius) / 2, 0,
                                   (ring.lower_height + ring.upper_height) / 2));
    pose.rotate(Eigen::AngleAxisd(lean, Eigen::Vector3d::UnitY()));
    pose.translate(Eigen::Vector3d(kPanelThickness / 2, 0, 0));
    mjsGeom* panel = add_box(platform_, pose, {kPanelThickness / 2, half_width, slope.norm() / 2});
    touch(panel, kBoundaryBit, 0, kScene);
    paint(panel, Paint::kWall);
    surround(panel);
  }
}

void SpecBuilder::add_frame() {
  const std::vector<Profile> profiles = frame_profiles(description_);
  for (const Profile& profile : profiles) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = (profile.from + profile.to) / 2;
    pose.linear() = along(profile.to - profile.from);
    // Posts turn one face towards the centre.
    if (std::abs(pose.linear()(2, 2)) > 0.999)
      pose.linear() = Eigen::AngleAxisd(std::atan2(profile.from.y(), profile.from.x()),
                                        Eigen::Vector3d::UnitZ())
                          .toRotationMatrix();
    const double half_length = (profile.to - profile.from).norm() / 2;
    add_part(pose, {0.02, 0.02, half_length}, Paint::kProfile);
    // Grooves make the box look like a profile.
    add_part(pose, {0.0202, 0.004, half_length - 0.0005}, Paint::kGroove);
    add_part(pose, {0.004, 0.0202, half_length - 0.0005}, Paint::kGroove);
  }
  for (int i = 0; i < num_fingers(description_); ++i) {
    const Profile& post = profiles[static_cast<std::size_t>(i)];
    Eigen::Isometry3d foot = Eigen::Isometry3d::Identity();
    foot.rotate(Eigen::AngleAxisd(finger_azimuth(description_, i), Eigen::Vector3d::UnitZ()));
    foot.translation() = Eigen::Vector3d(post.from.x(), post.from.y(), 0.004);
    add_part(foot, {0.032, 0.032, 0.004}, Paint::kBracket);
  }
  const double beam_bottom = finger_height(description_) + 0.08;
  if (description_.arrangement == Arrangement::kTriFinger) {
    const Solid hub{.form = Form::kCylinder,
                    .from = {0, 0, beam_bottom - 0.001},
                    .to = {0, 0, beam_bottom + 0.042},
                    .radius = 0.062,
                    .paint = Paint::kBracket,
                    .role = Role::kLooks};
    surround(add_solid(platform_, hub, 0));
  }
}

// Adds a box of the frame.
void SpecBuilder::add_part(const Eigen::Isometry3d& pose, const Eigen::Vector3d& half,
                           Paint colour) {
  mjsGeom* part = add_box(platform_, pose, half);
  paint(part, colour);
  surround(part);
}

void SpecBuilder::add_camera(const CameraFigures& figures) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = vector(figures.position);
  pose.linear() =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(figures.rotation.data());
  // MuJoCo's cameras look along -z with y up.
  pose.linear().col(1) *= -1;
  pose.linear().col(2) *= -1;
  mjsCamera* camera = mjs_addCamera(platform_, nullptr);
  name(camera->element, std::string(figures.name));
  set_pose(camera->pos, camera->quat, pose);
  camera->fovy = figures.vertical_view * 180 / std::numbers::pi;
  camera->resolution[0] = camera->resolution[1] = kCameraImageSize;
  if (description_.arrangement == Arrangement::kSingleFinger) return;

  // Housing and lens stand behind the optical centre, where the camera does not see them.
  Eigen::Isometry3d part = pose;
  part.translation() = pose * Eigen::Vector3d(0, 0, 0.055);
  add_part(part, {0.0145, 0.0145, 0.021}, Paint::kBracket);
  mjsGeom* lens = add_geom(platform_, mjGEOM_CYLINDER);
  part.translation() = pose * Eigen::Vector3d(0, 0, 0.020);
  set_pose(lens->pos, lens->quat, part);
  lens->size[0] = 0.014;
  lens->size[1] = 0.016;
  paint(lens, Paint::kMotor);
  surround(lens);
}

}  // namespace trifinger::detail
