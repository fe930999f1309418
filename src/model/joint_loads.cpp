// SPDX-License-Identifier: BSD-3-Clause
#include "joint_loads.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <span>

#include "base/text_of.hpp"

namespace trifinger::detail {
namespace {

constexpr int kNumPoses = 100;

std::string name_of(const mjModel& model, int joint) {
  const char* const name = mj_id2name(&model, mjOBJ_JOINT, joint);
  return name != nullptr ? name : "";
}

bool is_scalar(const mjModel& model, int joint) {
  return model.jnt_type[joint] == mjJNT_HINGE || model.jnt_type[joint] == mjJNT_SLIDE;
}

}  // namespace

JointLoads::JointLoads(const SceneModel& model)
    : model_(model), changed_(model.copy()), data_(model.make_data()), scratch_(model.make_data()) {
  model_.reset(*data_);
  std::fill_n(data_->qvel, changed_->nv, 0.0);
}

double JointLoads::start(std::size_t joint) const noexcept {
  return model_.position(joint, *data_);
}

std::vector<std::pair<std::string, double>> JointLoads::begin_at(std::size_t joint,
                                                                 double position) {
  model_.set_position(joint, position, *data_);
  std::vector<std::pair<std::string, double>> followers;
  for (const std::size_t follower : model_.followers(joint)) {
    followers.emplace_back(model_.model_joints()[follower].name,
                           model_.model_position(follower, *data_));
  }
  return followers;
}

std::vector<std::pair<std::string, double>> JointLoads::add_rotor(std::size_t joint, double more) {
  mjModel& model = *changed_;
  const std::vector<double> forces = motor(joint);
  double squares = 0.0;
  for (const double force : forces) squares += force * force;
  std::vector<std::pair<std::string, double>> rotors;
  for (int i = 0; i < static_cast<int>(model.njnt); ++i) {
    const int dof = model.jnt_dofadr[i];
    if (!is_scalar(model, i) || forces[static_cast<std::size_t>(dof)] == 0.0) continue;
    model.dof_armature[dof] += more * squares;
    model.dof_M0[dof] += more * squares;  // that of a body on its own, which is not computed anew
    // A rotor of a configuration stands for that of the actuator, too.
    const int actuator = model.jnt_actuatorid[i];
    const double of_actuator = actuator >= 0 ? model.actuator_armature[actuator] : 0.0;
    rotors.emplace_back(name_of(model, i), model.dof_armature[dof] + of_actuator);
  }
  return rotors;
}

void JointLoads::add_resistance(std::size_t joint, JointLoad& load) const {
  const std::vector<double> forces = motor(joint);
  double squares = 0.0;
  for (const double force : forces) squares += force * force;
  for (std::size_t dof = 0; dof < forces.size(); ++dof) {
    // How fast this one is if the driven joint has a velocity of 1.
    const double speed = forces[dof] / squares;
    load.damping += speed * speed * changed_->dof_damping[dof];
    load.friction += std::abs(speed) * changed_->dof_frictionloss[dof];
  }
}

std::vector<double> JointLoads::motor(std::size_t joint) const {
  mjData* const moved = scratch_.get();
  std::copy_n(data_->qpos, changed_->nq, moved->qpos);
  std::fill_n(moved->ctrl, changed_->nu, 0.0);
  model_.set_torque(joint, 1.0, *moved);
  mj_fwdPosition(changed_.get(), moved);
  mj_fwdVelocity(changed_.get(), moved);
  mj_fwdActuation(changed_.get(), moved);
  return {moved->qfrc_actuator, moved->qfrc_actuator + changed_->nv};
}

std::vector<std::string> JointLoads::overlaps() const {
  constexpr double kDeep = 0.05;  // of the smaller one
  const mjModel& model = *changed_;
  std::set<std::string> pairs;
  mj_fwdPosition(&model, data_.get());
  for (const mjContact& contact :
       std::span(data_->contact, static_cast<std::size_t>(data_->ncon))) {
    const auto [first, second] = std::minmax(contact.geom[0], contact.geom[1]);
    if (first < 0) continue;
    const auto [one, other] = std::minmax(model.geom_bodyid[first], model.geom_bodyid[second]);
    const double size = std::min(model.geom_rbound[first], model.geom_rbound[second]);
    if (model.body_rootid[one] != model.body_rootid[other] || contact.dist > -kDeep * size)
      continue;
    pairs.insert(text_of("'", mj_id2name(&model, mjOBJ_BODY, one), "' and '",
                         mj_id2name(&model, mjOBJ_BODY, other), "'"));
  }
  return {pairs.begin(), pairs.end()};
}

std::vector<double> JointLoads::inertias() const {
  const std::size_t count = model_.joints().size();
  std::vector<double> inertias(count);
  std::vector<double> speeds(static_cast<std::size_t>(changed_->nv));
  mj_fwdPosition(changed_.get(), data_.get());
  for (std::size_t joint = 0; joint < count; ++joint) {
    const std::vector<double> forces = motor(joint);
    mj_solveM(changed_.get(), data_.get(), speeds.data(), forces.data(), 1);
    inertias[joint] = 1.0 / mju_dot(speeds.data(), forces.data(), static_cast<int>(changed_->nv));
  }
  return inertias;
}

std::vector<JointLoad> JointLoads::loads(
    const std::vector<std::pair<double, double>>& ranges) const {
  const std::vector<double> inertia = inertias();
  std::vector<JointLoad> loads(inertia.size());
  std::vector<double> weight(inertia.size());
  const std::vector<double> begin(data_->qpos, data_->qpos + changed_->nq);
  std::mt19937 random(1);  // the same poses each time
  for (int pose = 0; pose <= kNumPoses; ++pose) {
    for (std::size_t joint = 0; pose > 0 && joint < ranges.size(); ++joint) {
      const double share = static_cast<double>(random()) / static_cast<double>(std::mt19937::max());
      const auto& [lower, upper] = ranges[joint];
      model_.set_position(joint, lower + share * (upper - lower), *data_);
    }
    model_.compute_weight(*changed_, *data_, weight);
    for (std::size_t joint = 0; joint < loads.size(); ++joint) {
      if (pose == 0) {
        loads[joint] = {.inertia = inertia[joint], .weight = std::abs(weight[joint])};
        add_resistance(joint, loads[joint]);
      }
      loads[joint].largest_weight = std::max(loads[joint].largest_weight, std::abs(weight[joint]));
    }
  }
  std::ranges::copy(begin, data_->qpos);
  return loads;
}

}  // namespace trifinger::detail
