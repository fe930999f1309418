// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "spec_builder.hpp"

namespace trifinger::detail {
namespace {

constexpr int kLowerMeets = kTableBit | kBoundaryBit | kObjectBit | kLowerBit;
constexpr int kMiddleMeets = kObjectBit | kLowerBit | kMiddleBit;
constexpr int kUpperMeets = kObjectBit | kLowerBit | kMiddleBit;

// Smallest time constant of contacts [s]: less than two steps would be unstable.
constexpr double kHardest = 0.002;

const std::array<std::string, kJointsPerFinger> kLinkNames{
    "finger_upper_link", "finger_middle_link", "finger_lower_link"};

}  // namespace

void SpecBuilder::add_fingers() {
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
      name(body->element, kLinkNames[static_cast<std::size_t>(j)] + suffix);
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

void SpecBuilder::add_link(mjsBody* body, const Finger& finger, int index, int joint) {
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

void SpecBuilder::add_joint(mjsBody* body, const Link& link, const std::string& joint_name,
                            int index) {
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

void SpecBuilder::add_tip(mjsBody* lower, const Finger& finger, int index,
                          const std::string& tip_name) {
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
  tip->solref[1] = description_.soft_tips ? description_.contact.tip_damping_ratio : 1;
  constexpr double kSoft[] = {0.95, 0.99, 0.001, 0.5, 2};
  constexpr double kHard[] = {0.99, 0.999, 0.0005, 0.5, 2};
  std::copy_n(description_.soft_tips ? kSoft : kHard, mjNIMP, tip->solimp);

  mjsSite* site = mjs_addSite(lower, nullptr);
  name(site->element, tip_name);
  copy(site->pos, finger.tip_origin);
  site->size[0] = 0.002;
  site->group = kSiteGroup;
}

}  // namespace trifinger::detail
