// SPDX-License-Identifier: BSD-3-Clause
#include "spec.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "blueprint.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::detail {
namespace {

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
constexpr int kObjectMeets = kTableBit | kBoundaryBit | kObjectBit;
constexpr int kLowerMeets = kTableBit | kBoundaryBit | kObjectBit | kLowerBit;
constexpr int kMiddleMeets = kObjectBit | kLowerBit | kMiddleBit;
constexpr int kUpperMeets = kObjectBit | kLowerBit | kMiddleBit;

// The tip's rubber determines the contact, whatever it touches.
constexpr int kTipPriority = 1;

// Groups that viewers can show or hide.
constexpr int kLooksGroup = 0;
constexpr int kSurroundGroup = 1;  // Frame and wall, which surround everything that moves.
constexpr int kTouchesGroup = 3;
constexpr int kSiteGroup = 4;

// Smallest time constant of contacts [s]: less than two steps would be unstable.
constexpr double kHardest = 0.002;

// Everything that moves has a number: fingers their own, then the objects.
constexpr int kScene = -1;

constexpr double kTableHalf = 0.5;
constexpr double kFloorHeight = -0.75;
constexpr int kPanels = 18;
constexpr double kPanelThickness = 0.01;

template <std::size_t size>
void copy(double (&to)[size], const Eigen::Matrix<double, static_cast<int>(size), 1>& from) {
  Eigen::Map<Eigen::Matrix<double, static_cast<int>(size), 1>>{to} = from;
}

template <std::size_t size>
void copy(double (&to)[size], const Triple& from) {
  std::ranges::copy(from, to);
}

void set_pose(double (&position)[3], double (&quaternion)[4], const Eigen::Isometry3d& pose) {
  copy(position, Eigen::Vector3d(pose.translation()));
  const Eigen::Quaterniond rotation(pose.linear());
  quaternion[0] = rotation.w();
  quaternion[1] = rotation.x();
  quaternion[2] = rotation.y();
  quaternion[3] = rotation.z();
}

void set_colour(float (&rgba)[4], const Colour& colour) {
  rgba[0] = colour.red;
  rgba[1] = colour.green;
  rgba[2] = colour.blue;
  rgba[3] = colour.opacity;
}

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

class Builder {
 public:
  Builder(const RobotDescription& description, Detail detail)
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

  Spec take() { return std::move(spec_); }

 private:
  void set_options() {
    // The reasons for these options are in docs/decisions/contact_settings.md.
    mjOption& option = spec_->option;
    option.timestep = 0.001;
    option.integrator = mjINT_IMPLICITFAST;
    option.solver = mjSOL_NEWTON;
    option.cone = mjCONE_ELLIPTIC;
    option.impratio = 100;
    // The simulation must see numbers that are not finite; MuJoCo must not reset silently.
    option.disableflags |= mjDSBL_AUTORESET;
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
  void set_view() {
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

  // ------------------------------------------------------------------------------------- elements

  mjsGeom* add_geom(mjsBody* body, mjtGeom type) {
    mjsGeom* geom = mjs_addGeom(body, nullptr);
    geom->type = type;
    geom->contype = 0;
    geom->conaffinity = 0;
    // Inertias are given explicitly, or result from an object's mass.
    geom->density = 0;
    geom->group = kLooksGroup;
    return geom;
  }

  mjsGeom* add_box(mjsBody* body, const Eigen::Isometry3d& pose, const Eigen::Vector3d& half) {
    mjsGeom* geom = add_geom(body, mjGEOM_BOX);
    set_pose(geom->pos, geom->quat, pose);
    copy(geom->size, half);
    return geom;
  }

  mjsGeom* add_solid(mjsBody* body, const Solid& solid, int finger) {
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

  void paint(mjsGeom* geom, Paint paint, int finger = 0) const {
    set_colour(geom->rgba, colour(paint, description_.variant, finger));
    if (pictures_)
      mjs_setString(geom->material, paint == Paint::kProfile || paint == Paint::kGroove ? "metal"
                                    : paint == Paint::kTip ? "rubber"
                                                           : "plastic");
  }

  // Marks what surrounds the scene: it can be left out of pictures, and casts no shadow on the
  // rest.
  static void surround(mjsGeom* geom) {
    geom->group = kSurroundGroup;
    geom->castshadow = false;
  }

  void name(mjsElement* element, const std::string& text) { mjs_setName(element, text.c_str()); }

  void touch(mjsGeom* geom, int own, int meets, int mover) {
    touching_.push_back({geom, mover});
    geom->contype = own;
    geom->conaffinity = meets;
    geom->condim = 3;
    geom->friction[0] = description_.contact.floor_friction;
    geom->friction[1] = 0.005;
    geom->friction[2] = 1e-4;
    // MuJoCo's default of 20 ms lets a dropped cube sink in by 7 mm. A damping ratio above 1 keeps
    // the cube from bouncing. Contacts less than 0.3 mm deep are softer, because sliding objects
    // would rattle otherwise.
    geom->solref[0] = description_.contact.time_constant;
    geom->solref[1] = 1.5;
    constexpr double kYielding[] = {0.2, 0.95, 0.0003, 0.5, 2};
    std::ranges::copy(kYielding, geom->solimp);
  }

  // ----------------------------------------------------------------------------------------- scene

  void add_material(const char* material_name, float specular, float shininess) {
    mjsMaterial* material = mjs_addMaterial(spec_.get(), nullptr);
    mjs_setName(material->element, material_name);
    material->specular = specular;
    material->shininess = shininess;
  }

  void add_surroundings() {
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

    add_lamp({0.9, -1.2, 2.4}, 0.58F);
    add_light({-1.4, 0.4, 1.5}, 0.16F, false);
    add_light({0.5, 1.5, 1.2}, 0.12F, false);
  }

  // Adds a lamp with some width: the lights on its rim share the brightness, which softens the
  // edges of shadows. With two more lights and the viewer's own there are eight, the most that
  // OpenGL shows at once.
  void add_lamp(const Eigen::Vector3d& position, float brightness) {
    constexpr int kLights = 5;
    constexpr double kRadius = 0.09;
    const Eigen::Matrix3d rim = along(kLit - position);
    for (int i = 0; i < kLights; ++i) {
      const double angle = 2 * std::numbers::pi * i / kLights;
      add_light(position + kRadius * (std::cos(angle) * rim.col(0) + std::sin(angle) * rim.col(1)),
                brightness / kLights, true);
    }
  }

  void add_light(const Eigen::Vector3d& position, float brightness, bool shadow) {
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

  void add_table() {
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

  void add_platform() {
    platform_ = mjs_addBody(world_, nullptr);
    name(platform_->element, "platform");
    set_pose(platform_->pos, platform_->quat, platform_in_world(description_));
    if (description_.boundary)
      for (const Ring& ring : boundary_rings(description_)) add_ring(ring);
    if (pictures_) add_frame();
    if (pictures_ && description_.cameras)
      for (const CameraFigures& camera : camera_figures()) add_camera(camera);
  }

  void add_ring(const Ring& ring) {
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
      mjsGeom* panel =
          add_box(platform_, pose, {kPanelThickness / 2, half_width, slope.norm() / 2});
      touch(panel, kBoundaryBit, 0, kScene);
      paint(panel, Paint::kWall);
      surround(panel);
    }
  }

  void add_frame() {
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
  void add_part(const Eigen::Isometry3d& pose, const Eigen::Vector3d& half, Paint colour) {
    mjsGeom* part = add_box(platform_, pose, half);
    paint(part, colour);
    surround(part);
  }

  void add_camera(const CameraFigures& figures) {
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

  // --------------------------------------------------------------------------------------- fingers

  void add_fingers() {
    const Finger& finger = finger_blueprint(description_);
    const std::vector<std::string> joints = joint_names(description_);
    const std::vector<std::string> tips = tip_names(description_);
    for (int i = 0; i < num_fingers(description_); ++i) {
      const std::string suffix = finger_suffix(description_, i);
      mjsBody* base = mjs_addBody(platform_, nullptr);
      name(base->element, "finger_base_link" + suffix);
      set_pose(base->pos, base->quat, base_in_platform(description_, i));
      if (pictures_)
        for (const Solid& solid : finger.base) add_solid(base, solid, i);

      mjsBody* body = base;
      for (int j = 0; j < kJointsPerFinger; ++j) {
        body = mjs_addBody(body, nullptr);
        name(body->element, kLinkNames[j] + suffix);
        add_link(body, finger, i, j);
        const std::string& joint =
            joints[static_cast<std::size_t>(i) * kJointsPerFinger + static_cast<std::size_t>(j)];
        add_joint(body, finger.links[static_cast<std::size_t>(j)], joint, j);
      }
      add_tip(body, finger, i, tips[static_cast<std::size_t>(i)]);

      // These links overlap by construction, and elsewhere the joint's stop keeps them apart.
      mjsExclude* exclude = mjs_addExclude(spec_.get());
      mjs_setString(exclude->bodyname1, (kLinkNames[0] + suffix).c_str());
      mjs_setString(exclude->bodyname2, (kLinkNames[2] + suffix).c_str());
    }
  }

  void add_link(mjsBody* body, const Finger& finger, int index, int joint) {
    const Link& link = finger.links[static_cast<std::size_t>(joint)];
    copy(body->pos, link.origin);
    const Inertia inertia = joint == 2 ? lower_with_tip(finger) : link.inertia;
    body->explicitinertial = true;
    body->mass = inertia.mass;
    copy(body->ipos, inertia.centre);
    std::ranges::copy(inertia.moment, body->fullinertia);

    constexpr Bit kOwn[] = {kUpperBit, kMiddleBit, kLowerBit};
    constexpr int kMeets[] = {kUpperMeets, kMiddleMeets, kLowerMeets};
    for (const Solid& solid : link.solids) {
      if (solid.role == Role::kLooks && !pictures_) continue;
      mjsGeom* geom = add_solid(body, solid, index);
      if (solid.role == Role::kLooks) continue;
      touch(geom, kOwn[joint], kMeets[joint], index);
      if (solid.role == Role::kTouches) geom->group = kTouchesGroup;
    }
  }

  void add_joint(mjsBody* body, const Link& link, const std::string& joint_name, int index) {
    const auto j = static_cast<std::size_t>(index);
    const VariantFigures& limits = figures(description_);
    const ActuatorParameters drive = actuator(description_);
    mjsJoint* joint = mjs_addJoint(body, nullptr);
    name(joint->element, joint_name);
    joint->type = mjJNT_HINGE;
    copy(joint->axis, link.axis);
    joint->limited = mjLIMITED_TRUE;
    joint->range[0] = limits.hard_lower[j] - description_.stops.margin;
    joint->range[1] = limits.hard_upper[j] + description_.stops.margin;
    joint->solref_limit[0] = description_.stops.time_constant;
    joint->solref_limit[1] = 1;
    joint->armature = reflected_inertia(drive);
    joint->damping[0] = drive.damping;
    joint->frictionloss = drive.friction;

    mjsActuator* motor = mjs_addActuator(spec_.get(), nullptr);
    name(motor->element, joint_name);
    mjs_setToMotor(motor);
    motor->trntype = mjTRN_JOINT;
    mjs_setString(motor->target, joint_name.c_str());
    motor->ctrllimited = mjLIMITED_TRUE;
    motor->ctrlrange[0] = -drive.torque_limit;
    motor->ctrlrange[1] = drive.torque_limit;
  }

  void add_tip(mjsBody* lower, const Finger& finger, int index, const std::string& tip_name) {
    if (pictures_) {
      for (Solid solid : finger.tip_solids) {
        for (std::size_t i = 0; i < 3; ++i) {
          solid.from[i] += finger.tip_origin[i];
          solid.to[i] += finger.tip_origin[i];
        }
        add_solid(lower, solid, index);
      }
    }
    mjsGeom* tip = add_geom(lower, mjGEOM_SPHERE);
    name(tip->element, tip_name);
    copy(tip->pos, finger.tip_origin);
    tip->size[0] = figures(description_).tip_radius;
    paint(tip, Paint::kTip);
    touch(tip, kLowerBit, kLowerMeets, index);
    tip->condim = 4;
    tip->friction[0] = description_.contact.tip_friction;
    tip->friction[1] = description_.contact.tip_torsional_friction;
    tip->priority = kTipPriority;
    tip->solref[0] = description_.soft_tips ? description_.contact.tip_time_constant : kHardest;
    tip->solref[1] = 1;
    constexpr double kSoft[] = {0.95, 0.99, 0.001, 0.5, 2};
    constexpr double kHard[] = {0.99, 0.999, 0.0005, 0.5, 2};
    std::copy_n(description_.soft_tips ? kSoft : kHard, mjNIMP, tip->solimp);

    mjsSite* site = mjs_addSite(lower, nullptr);
    name(site->element, tip_name);
    copy(site->pos, finger.tip_origin);
    site->size[0] = 0.002;
    site->group = kSiteGroup;
  }

  // --------------------------------------------------------------------------------------- objects

  void add_objects() {
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

  static std::array<double, 4> unit_quaternion(const ObjectDescription& object) {
    std::array<double, 4> unit = object.orientation;
    double norm = 0;
    for (const double number : unit) norm = std::hypot(norm, number);
    for (double& number : unit) number /= norm;
    return unit;
  }

  // Returns a place that is clear of the initial pose of every variant's fingers.
  [[nodiscard]] Triple resting_place(const ObjectDescription& object, std::size_t place) const {
    constexpr double kTri[4][2] = {{0, 0}, {-0.115, -0.035}, {0.027, 0.117}, {0.088, -0.082}};
    constexpr double kSingle[4][2] = {{0, 0.12}, {0.12, -0.06}, {-0.12, 0.06}, {-0.02, -0.15}};
    const auto& [x, y] =
        description_.arrangement == Arrangement::kTriFinger ? kTri[place] : kSingle[place];
    const std::size_t height = object.shape == ObjectShape::kBall    ? 0
                               : object.shape == ObjectShape::kStick ? 1
                                                                     : 2;
    return {x, y, object.size[height] / 2};
  }

  mjsGeom* object_geom(mjsBody* body, const ObjectDescription& object, mjtGeom type) {
    mjsGeom* geom = add_geom(body, type);
    name(geom->element, object.name);
    geom->mass = object.mass;
    touch(geom, kObjectBit, kObjectMeets, mover_of(object));
    if (pictures_) mjs_setString(geom->material, "plastic");
    return geom;
  }

  void add_box_object(mjsBody* body, const ObjectDescription& object) {
    const Eigen::Vector3d half = vector(object.size) / 2;
    mjsGeom* geom = object_geom(body, object, mjGEOM_BOX);
    copy(geom->size, half);
    set_colour(geom->rgba, {0.10F, 0.10F, 0.11F, 1});
    if (!pictures_) return;

    // The axis and the side of each face. Colours are those of the competition's cube.
    struct Face {
      int axis;
      int side;
      Colour colour;
    };
    constexpr Face kFaces[] = {
        {0, 1, {0.765F, 0.188F, 0.000F, 1}},  {1, 1, {0.600F, 0.816F, 0.376F, 1}},
        {2, 1, {0.016F, 0.137F, 0.376F, 1}},  {2, -1, {0.455F, 0.784F, 0.749F, 1}},
        {0, -1, {0.643F, 0.357F, 0.643F, 1}}, {1, -1, {1.000F, 0.922F, 0.424F, 1}}};
    const double rim = 0.06 * object.size[0];
    for (const Face& face : kFaces) {
      Eigen::Vector3d plate = half.array() - rim;
      plate[face.axis] = 0.0002;
      Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
      pose.translation()[face.axis] = face.side * half[face.axis];
      mjsGeom* tile = add_box(body, pose, plate);
      set_colour(tile->rgba, face.colour);
      mjs_setString(tile->material, "plastic");
    }
  }

  [[nodiscard]] int mover_of(const ObjectDescription& object) const {
    return kMaxFingers + static_cast<int>(&object - description_.objects.data());
  }

  // Adds rolling friction. With sliding friction alone, round bodies would roll for ever.
  void resist_rolling(mjsGeom* geom) {
    geom->condim = 6;
    geom->friction[2] = 5e-5;
  }

  void add_stick(mjsBody* body, const ObjectDescription& object) {
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

  void add_ball(mjsBody* body, const ObjectDescription& object) {
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

  // ----------------------------------------------------------------------------------------- pairs

  struct Touching {
    mjsGeom* geom;
    int mover;
  };

  // Parts of one finger never meet: they are neighbours, or excluded.
  static bool can_meet(const Touching& one, const Touching& other) {
    return one.mover != other.mover && ((one.geom->contype & other.geom->conaffinity) != 0 ||
                                        (other.geom->contype & one.geom->conaffinity) != 0);
  }

  // Adds explicit pairs for friction that does not result from the friction of two single geoms.
  void add_pairs() {
    const auto& friction = description_.contact.friction;
    if (friction == OfSurfacePairs<std::optional<double>>{}) return;
    for (std::size_t i = 0; i < touching_.size(); ++i)
      for (std::size_t j = i + 1; j < touching_.size(); ++j) {
        if (!can_meet(touching_[i], touching_[j])) continue;
        const SurfacePair pair = pair_of(*surface_of(touching_[i]), *surface_of(touching_[j]));
        if (friction[pair]) add_pair(i, j, *friction[pair]);
      }
  }

  void add_pair(std::size_t first, std::size_t second, double friction) {
    const mjsGeom* const one = touching_[first].geom;
    const mjsGeom* const other = touching_[second].geom;
    mjsPair* pair = mjs_addPair(spec_.get(), nullptr);
    mjs_setString(pair->geomname1, contact_name(first).c_str());
    mjs_setString(pair->geomname2, contact_name(second).c_str());
    // All other values are mixed like in MuJoCo. Geoms of equal priority have equal stiffness here.
    const bool is_equal = one->priority == other->priority;
    const mjsGeom* const decides = one->priority >= other->priority ? one : other;
    pair->condim = is_equal ? std::max(one->condim, other->condim) : decides->condim;
    std::ranges::copy(decides->solref, pair->solref);
    std::ranges::copy(decides->solimp, pair->solimp);
    const auto mixed = [&](int kind) {
      return is_equal ? std::max(one->friction[kind], other->friction[kind])
                      : decides->friction[kind];
    };
    const double all[] = {friction, friction, mixed(1), mixed(2), mixed(2)};
    std::ranges::copy(all, pair->friction);
  }

  // Pairs refer to geoms by name, and most geoms have none. Objects' names never contain a space.
  std::string contact_name(std::size_t index) {
    mjsElement* const element = touching_[index].geom->element;
    std::string given = mjs_getString(mjs_getName(element));
    if (!given.empty()) return given;
    const std::string made = "part " + std::to_string(index);
    name(element, made);
    return made;
  }

  static std::optional<Surface> surface_of(const Touching& touching) {
    return detail::surface_of(touching.geom->contype, touching.geom->priority);
  }

  void add_initial_key() {
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

  inline static const std::string kLinkNames[] = {"finger_upper_link", "finger_middle_link",
                                                  "finger_lower_link"};

  // The point that the lights face.
  inline static const Eigen::Vector3d kLit{0, 0, 0.15};

  const RobotDescription& description_;
  const bool pictures_;
  Spec spec_;
  mjsBody* world_;
  mjsBody* platform_{nullptr};
  std::vector<Touching> touching_;
};

}  // namespace

std::optional<Surface> surface_of(int contype, int priority) noexcept {
  switch (contype) {
    case kTableBit:
      return Surface::kTable;
    case kBoundaryBit:
      return Surface::kBoundary;
    case kObjectBit:
      return Surface::kObject;
    case kLowerBit:
      return priority == kTipPriority ? Surface::kTip : Surface::kLink;
    case kMiddleBit:
    case kUpperBit:
      return Surface::kLink;
    default:
      return std::nullopt;
  }
}

Spec make_spec(const RobotDescription& description, Detail detail) {
  validate(description);
  return Builder(description, detail).take();
}

RobotModel::Compiled compile(mjSpec* spec) {
  RobotModel::Compiled model(mj_compile(spec, nullptr));
  if (!model) throw Error("MuJoCo refuses the model: " + std::string(mjs_getError(spec)));
  return model;
}

}  // namespace trifinger::detail
