// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/planning_model.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "trifinger/base/error.hpp"

namespace trifinger::control {
namespace {

using detail::require;

// Bit masks that say who touches whom.
enum Bit : int { kTableBit = 1, kObjectBit = 2, kTipBit = 4, kLinkBit = 8 };

RobotDescription without_wall(RobotDescription description) {
  description.boundary = false;
  return description;
}

void touch(mjModel& model, int geom, int own, int meets) {
  model.geom_contype[geom] = own;
  model.geom_conaffinity[geom] = meets;
  // Friction against twisting at a tip changes little, and costs two more rows per contact.
  model.geom_condim[geom] = 3;
}

// The longest capsule of the body; nothing if it has none.
std::optional<int> longest_capsule(const mjModel& model, int body) {
  std::optional<int> longest;
  for (int i = 0; i < model.body_geomnum[body]; ++i) {
    const int geom = model.body_geomadr[body] + i;
    if (model.geom_type[geom] != mjGEOM_CAPSULE || model.geom_contype[geom] == 0) continue;
    if (!longest || model.geom_size[3 * geom + 1] > model.geom_size[3 * *longest + 1])
      longest = geom;
  }
  return longest;
}

void choose_contacts(const RobotModel& robot, const PlanningModelOptions& options, mjModel& model) {
  const mjModel& original = *robot.mujoco();
  const int fingers = options.fingers_touch ? kTipBit | kLinkBit : 0;
  for (int geom = 0; geom < static_cast<int>(model.ngeom); ++geom) {
    const auto surface = robot.surfaces()[static_cast<std::size_t>(geom)];
    model.geom_contype[geom] = 0;
    model.geom_conaffinity[geom] = 0;
    if (surface == Surface::kTable) touch(model, geom, kTableBit, 0);
    if (surface == Surface::kObject) touch(model, geom, kObjectBit, kTableBit | kObjectBit);
  }
  for (const int tip : robot.tip_geoms()) {
    touch(model, tip, kTipBit, kTableBit | kObjectBit | fingers);
    const auto link = longest_capsule(original, original.geom_bodyid[tip]);
    if (options.lower_links && link) touch(model, *link, kLinkBit, kObjectBit | fingers);
  }
  // Listed pairs ignore the bits. The table never meets itself.
  const int table = mj_name2id(&model, mjOBJ_GEOM, "table");
  for (int pair = 0; pair < static_cast<int>(model.npair); ++pair) {
    const int one = model.pair_geom1[pair];
    const int other = model.pair_geom2[pair];
    const bool meet = (model.geom_contype[one] & model.geom_conaffinity[other]) != 0 ||
                      (model.geom_contype[other] & model.geom_conaffinity[one]) != 0;
    model.pair_dim[pair] = 3;
    if (!meet) model.pair_geom1[pair] = model.pair_geom2[pair] = table;
  }
}

// True if the damping of a whole step does not turn any joint's velocity around. It can then be a
// torque like any other, which saves a factorization in each step.
bool is_lightly_damped(const mjModel& model) {
  for (int i = 0; i < static_cast<int>(model.nv); ++i) {
    if (model.opt.timestep * model.dof_damping[i] > model.dof_M0[i]) return false;
  }
  return true;
}

void rotate(double (&result)[3], const double* vector, const double* quaternion, bool back) {
  double rotation[4];
  std::copy_n(quaternion, 4, rotation);
  if (back) mju_negQuat(rotation, quaternion);
  mju_rotVecQuat(result, vector, rotation);
}

}  // namespace

PlanningModel::PlanningModel(const RobotDescription& description,
                             const PlanningModelOptions& options) {
  detail::require_positive("time_step", options.time_step.count());
  require(options.iterations >= 1,
          "iterations is " + std::to_string(options.iterations) + ", must be at least 1");
  detail::require_positive("impratio", options.impratio);
  require(options.torque_share > 0.0 && options.torque_share <= 1.0,
          "torque_share is " + std::to_string(options.torque_share) + ", must be above 0 to 1");
  const SafetyLimits limits = options.limits ? *options.limits : safety_limits(description);
  validate(limits);

  const RobotModel robot(without_wall(description));
  model_ = robot.copy();
  mjOption& option = model_->opt;
  option.timestep = options.time_step.count();
  option.cone = mjCONE_PYRAMIDAL;
  option.impratio = options.impratio;
  option.iterations = options.iterations;
  // Newton's method with few iterations can leave forces that throw things apart. This one always
  // reduces the error, and its iterations are cheap for so few contacts.
  option.solver = mjSOL_PGS;
  option.integrator = mjINT_EULER;
  // So few geoms are sooner compared one by one than by trees of boxes around them.
  option.disableflags |= mjDSBL_ISLAND | mjDSBL_SENSOR | mjDSBL_MIDPHASE;
  choose_contacts(robot, options, *model_);
  for (std::size_t i = 0; std::cmp_less(i, robot.num_joints()); ++i) {
    model_->dof_damping[i] += limits.safety_kd[i];
    joints_.push_back({.lower = limits.soft_lower[i],
                       .upper = limits.soft_upper[i],
                       .max_torque = options.torque_share * limits.max_torque[i]});
  }
  tip_sites_ = robot.tip_sites();
  objects_ = robot.objects();
  // MuJoCo also keeps per body what its geoms touch.
  const SceneModel::Data data = robot.make_data();
  mj_setConst(model_.get(), data.get());
  if (is_lightly_damped(*model_)) option.disableflags |= mjDSBL_EULERDAMP;
}

PlanningModel::PlanningModel(const mjModel_& model, std::span<const PlannedJoint> joints,
                             std::span<const int> tip_sites, std::span<const ObjectAddress> objects)
    : model_(mj_copyModel(nullptr, &model)),
      joints_(joints.begin(), joints.end()),
      tip_sites_(tip_sites.begin(), tip_sites.end()),
      objects_(objects.begin(), objects.end()) {
  if (model_ == nullptr) throw Error("MuJoCo has no memory for the model");
  const auto count = static_cast<int>(joints.size());
  require(count >= 1 && count <= kMaxPlannedJoints, "there are " + std::to_string(count) +
                                                        " joints, must be 1 to " +
                                                        std::to_string(kMaxPlannedJoints));
  require(count <= model.njnt && count <= model.nu,
          "the model has " + std::to_string(model.njnt) + " joints and " +
              std::to_string(model.nu) + " motors, must have at least " + std::to_string(count));
  for (int i = 0; i < count; ++i) {
    const bool is_simple = model.jnt_type[i] == mjJNT_HINGE || model.jnt_type[i] == mjJNT_SLIDE;
    require(
        is_simple && model.actuator_trntype[i] == mjTRN_JOINT && model.actuator_trnid[2 * i] == i,
        "joint " + std::to_string(i) + " of the model is not a hinge or slide with motor " +
            std::to_string(i));
    const PlannedJoint& joint = joints[static_cast<std::size_t>(i)];
    // Written so that NaN fails.
    require(joint.lower < joint.upper,
            "the range of joint " + std::to_string(i) + " is empty: lower is not below upper");
    detail::require_positive("max_torque", joint.max_torque);
  }
  // The planner must see numbers that are not finite; MuJoCo must not reset silently.
  model_->opt.disableflags |= mjDSBL_AUTORESET;
}

SceneModel::Compiled PlanningModel::copy() const {
  SceneModel::Compiled copied(mj_copyModel(nullptr, model_.get()));
  if (copied == nullptr) throw Error("MuJoCo has no memory for the model");
  return copied;
}

Seconds PlanningModel::time_step() const noexcept { return Seconds(model_->opt.timestep); }
int PlanningModel::position_size() const noexcept { return static_cast<int>(model_->nq); }
int PlanningModel::velocity_size() const noexcept { return static_cast<int>(model_->nv); }

const ObjectAddress& PlanningModel::object(const std::string& name) const {
  const auto found = std::ranges::find(objects_, name, &ObjectAddress::name);
  if (found != objects_.end()) return *found;
  std::string known;
  for (const ObjectAddress& object : objects_) known += (known.empty() ? "" : ", ") + object.name;
  throw InvalidArgument("There is no object '" + name + "'; " +
                        (known.empty() ? "the scene has none." : "the scene has " + known + "."));
}

PlanningState PlanningModel::initial_state() const {
  const double* const position = model_->nkey > 0 ? model_->key_qpos : model_->qpos0;
  PlanningState state;
  state.position.assign(position, position + model_->nq);
  state.velocity.assign(static_cast<std::size_t>(model_->nv), 0.0);
  return state;
}

void PlanningModel::set_joints(std::span<const double> position, std::span<const double> velocity,
                               PlanningState& state) const noexcept {
  std::copy_n(position.begin(), joints_.size(), state.position.begin());
  std::copy_n(velocity.begin(), joints_.size(), state.velocity.begin());
}

void PlanningModel::set_object(const ObjectAddress& object, const Pose& pose, const Twist& twist,
                               PlanningState& state) noexcept {
  double* const position = state.position.data() + object.position;
  double* const velocity = state.velocity.data() + object.velocity;
  std::copy_n(pose.position.data(), 3, position);
  const Eigen::Quaterniond& rotation = pose.orientation;
  const double quaternion[] = {rotation.w(), rotation.x(), rotation.y(), rotation.z()};
  std::ranges::copy(quaternion, position + 3);
  std::copy_n(twist.linear.data(), 3, velocity);
  // MuJoCo expresses the rotation of a free body in the body's frame.
  double angular[3];
  rotate(angular, twist.angular.data(), quaternion, true);
  std::ranges::copy(angular, velocity + 3);
}

Pose PlanningModel::object_pose(const ObjectAddress& object,
                                std::span<const double> position) noexcept {
  const double* const values = position.data() + object.position;
  return {Eigen::Vector3d(values), Eigen::Quaterniond(values[3], values[4], values[5], values[6])};
}

Twist PlanningModel::object_twist(const ObjectAddress& object, std::span<const double> position,
                                  std::span<const double> velocity) noexcept {
  const double* const values = velocity.data() + object.velocity;
  double angular[3];
  rotate(angular, values + 3, position.data() + object.position + 3, false);
  return {Eigen::Vector3d(values), Eigen::Vector3d(angular)};
}

void PlanningModel::check(const PlanningState& state) const {
  // Texts are made only for errors, because plans check their starts.
  if (state.position.size() != static_cast<std::size_t>(position_size()) ||
      state.velocity.size() != static_cast<std::size_t>(velocity_size())) {
    throw InvalidArgument("the state has " + std::to_string(state.position.size()) +
                          " positions and " + std::to_string(state.velocity.size()) +
                          " velocities, must have " + std::to_string(position_size()) + " and " +
                          std::to_string(velocity_size()));
  }
  const auto is_finite = [](double value) { return std::isfinite(value); };
  if (!std::ranges::all_of(state.position, is_finite) ||
      !std::ranges::all_of(state.velocity, is_finite) || !is_finite(state.time.count())) {
    throw InvalidArgument("the state has a number that is not finite");
  }
}

}  // namespace trifinger::control
