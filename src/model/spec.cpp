// SPDX-License-Identifier: BSD-3-Clause
#include "spec.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "model/mujoco_messages.hpp"
#include "spec_builder.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::detail {

SpecBuilder::SpecBuilder(const RobotDescription& description, Detail detail)
    : description_(description),
      pictures_(detail == Detail::kPictures),
      spec_(mj_makeSpec()),
      world_(mjs_findBody(spec_.get(), "world")) {
  mjs_setString(spec_->modelname, std::string(figures(description).name).c_str());
  set_options();
  if (pictures_) add_surroundings();
  add_table();
  add_platform();
  add_fingers();
  add_objects();
  add_pairs();
  add_initial_key();
}

void SpecBuilder::set_options() {
  // The reasons for these options are in docs/decisions/contact_settings.md.
  mjOption& option = spec_->option;
  option.timestep = 0.001;
  option.integrator = mjINT_IMPLICITFAST;
  option.solver = mjSOL_NEWTON;
  option.cone = mjCONE_ELLIPTIC;
  option.impratio = 100;
  // Solving islands of contacts separately pays off only with several objects.
  if (description_.objects.size() < 2) option.disableflags |= mjDSBL_ISLAND;
  // Memory for contacts: twenty times the most that was measured, with a cube between the fingers
  // or with all objects in a heap. MuJoCo's default is 14 MiB, and a back-end in real time keeps
  // all of it in RAM. A model for pictures and files keeps the default, because its users may
  // need it.
  if (!pictures_) {
    spec_->memory = static_cast<mjtSize>((1 + description_.objects.size()) << 20U);
  }

  spec_->compiler.degree = false;
  spec_->compiler.autolimits = true;
  set_view();
}

// Sets where viewers begin: between two fingers, with table and robot in the picture.
void SpecBuilder::set_view() {
  constexpr double kFovy = 38;
  constexpr double kReach = 0.25;  // Reach of the fingers from the vertical axis.
  const double axes = finger_height(description_);
  const double top = description_.flipped ? flip_height(description_) : axes + 0.08;
  spec_->stat.center[2] = top / 2;
  // MuJoCo's viewers begin at a distance of 1.5 times the extent.
  spec_->stat.extent =
      std::hypot(kReach, top / 2) / (1.5 * std::sin(kFovy / 2 * std::numbers::pi / 180));
  spec_->stat.meansize = 0.03;

  mjVisual& visual = spec_->visual;
  visual.global.offwidth = 1920;
  visual.global.offheight = 1440;
  visual.global.azimuth = 90;
  visual.global.elevation = -20;
  visual.global.fovy = kFovy;
  visual.quality.shadowsize = 2048;
  visual.map.znear = 0.01F;
  visual.map.zfar = 20;
  visual.map.shadowclip = 2;
  visual.map.shadowscale = 0.45F;
  for (int i = 0; i < 3; ++i) {
    visual.headlight.ambient[i] = 0.32F;
    visual.headlight.diffuse[i] = 0.12F;
    visual.headlight.specular[i] = 0.05F;
  }
}

mjsGeom* SpecBuilder::add_geom(mjsBody* body, mjtGeom type) {
  mjsGeom* geom = mjs_addGeom(body, nullptr);
  geom->type = type;
  geom->contype = 0;
  geom->conaffinity = 0;
  // Inertias are given explicitly, or result from an object's mass.
  geom->density = 0;
  geom->group = kLooksGroup;
  return geom;
}

mjsGeom* SpecBuilder::add_box(mjsBody* body, const Eigen::Isometry3d& pose,
                              const Eigen::Vector3d& half) {
  mjsGeom* geom = add_geom(body, mjGEOM_BOX);
  set_pose(geom->pos, geom->quat, pose);
  copy(geom->size, half);
  return geom;
}

mjsGeom* SpecBuilder::add_solid(mjsBody* body, const Solid& solid, int finger) {
  mjsGeom* geom = nullptr;
  switch (solid.form) {
    case Form::kBox:
      geom = add_geom(body, mjGEOM_BOX);
      copy(geom->pos, solid.from);
      copy(geom->size, solid.to);
      break;
    case Form::kSphere:
      geom = add_geom(body, mjGEOM_SPHERE);
      copy(geom->pos, solid.from);
      geom->size[0] = solid.radius;
      break;
    case Form::kCylinder:
    case Form::kCapsule:
      geom = add_geom(body, solid.form == Form::kCapsule ? mjGEOM_CAPSULE : mjGEOM_CYLINDER);
      std::ranges::copy(solid.from, geom->fromto);
      std::ranges::copy(solid.to, geom->fromto + 3);
      geom->size[0] = solid.radius;
      break;
  }
  paint(geom, solid.paint, finger);
  return geom;
}

void SpecBuilder::paint(mjsGeom* geom, Paint paint, int finger) const {
  set_colour(geom->rgba, colour(paint, description_.variant, finger));
  if (pictures_)
    mjs_setString(geom->material, paint == Paint::kProfile || paint == Paint::kGroove ? "metal"
                                  : paint == Paint::kTip                              ? "rubber"
                                                                                      : "plastic");
}

void SpecBuilder::name(mjsElement* element, const std::string& text) {
  mjs_setName(element, text.c_str());
}

// Marks what surrounds the scene: it can be left out of pictures, and casts no shadow on the
// rest.
void SpecBuilder::surround(mjsGeom* geom) {
  geom->group = kSurroundGroup;
  geom->castshadow = false;
}

Spec make_spec(const RobotDescription& description, Detail detail) {
  validate(description);
  return SpecBuilder(description, detail).take();
}

SceneModel::Compiled compile(mjSpec* spec) {
  silence_mujoco();
  SceneModel::Compiled model(mj_compile(spec, nullptr));
  if (!model) throw Error("MuJoCo refuses the model: " + std::string(mjs_getError(spec)));
  leave_divergence_visible(*model);
  return model;
}

void leave_divergence_visible(mjModel& model) noexcept {
  model.opt.disableflags |= mjDSBL_AUTORESET;
}

}  // namespace trifinger::detail
