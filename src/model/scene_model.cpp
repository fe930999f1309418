// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/model/scene_model.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <numeric>
#include <set>

#include "trifinger/base/error.hpp"

namespace trifinger {

void SceneModel::Delete::operator()(mjModel_* model) const noexcept { mj_deleteModel(model); }
void SceneModel::Delete::operator()(mjData_* data) const noexcept { mj_deleteData(data); }

SceneModel::Compiled SceneModel::copy() const {
  Compiled copied(mj_copyModel(nullptr, model_.get()));
  if (copied == nullptr) throw Error("MuJoCo has no memory for the model");
  return copied;
}

SceneModel::Data SceneModel::make_data() const {
  Data data(mj_makeData(model_.get()));
  if (data == nullptr) throw Error("MuJoCo has no memory for the scene");
  return data;
}

void SceneModel::set_timestep(double seconds) noexcept { model_->opt.timestep = seconds; }

std::vector<std::string> SceneModel::joint_names() const {
  std::vector<std::string> names;
  names.reserve(joints_.size());
  for (const DrivenJoint& joint : joints_) names.push_back(joint.name);
  return names;
}

const ObjectAddress& SceneModel::object(const std::string& name) const {
  const auto found = std::ranges::find(objects_, name, &ObjectAddress::name);
  if (found != objects_.end()) return *found;
  std::string known;
  for (const ObjectAddress& other : objects_) known += (known.empty() ? "" : ", ") + other.name;
  throw InvalidArgument("There is no object '" + name + "'; " +
                        (known.empty() ? "the scene has none." : "the scene has " + known + "."));
}

void SceneModel::set_velocity(const ObjectAddress& object, const std::array<double, 3>& linear,
                              const std::array<double, 3>& angular, mjData_& data) noexcept {
  double* const values = data.qvel + object.velocity;
  std::ranges::copy(linear, values);
  // MuJoCo expresses the rotation of a free body in the body's frame.
  std::array<double, 4> inverse{};
  mju_negQuat(inverse.data(), data.qpos + object.position + 3);
  mju_rotVecQuat(values + 3, angular.data(), inverse.data());
}

std::vector<std::size_t> SceneModel::followers(std::size_t joint) const {
  std::vector<std::size_t> found;
  for (const Follower& follower : motors_[joint].followers) {
    const auto place = std::ranges::find(model_parts_, follower.position, &Part::position);
    found.push_back(static_cast<std::size_t>(place - model_parts_.begin()));
  }
  return found;
}

double SceneModel::position(std::size_t joint, const mjData_& data) const noexcept {
  double position = 0.0;
  for (const Part& part : motors_[joint].parts) position += part.share * data.qpos[part.position];
  return position;
}

double SceneModel::velocity(std::size_t joint, const mjData_& data) const noexcept {
  double velocity = 0.0;
  for (const Part& part : motors_[joint].parts) velocity += part.share * data.qvel[part.velocity];
  return velocity;
}

double SceneModel::acceleration(std::size_t joint, const mjData_& data) const noexcept {
  double acceleration = 0.0;
  for (const Part& part : motors_[joint].parts) {
    acceleration += part.share * data.qacc[part.velocity];
  }
  return acceleration;
}

double SceneModel::rotor_inertia(std::size_t joint, const mjModel_& model) const noexcept {
  const Motor& motor = motors_[joint];
  double inertia = model.actuator_armature[motor.actuator];
  for (const Part& part : motor.parts) {
    inertia += part.share * part.share * model.dof_armature[part.velocity];
  }
  return inertia;
}

void SceneModel::set_position(std::size_t joint, double position, mjData_& data) const noexcept {
  set_position(joint, position, std::span(data.qpos, static_cast<std::size_t>(model_->nq)));
}

void SceneModel::set_position(std::size_t joint, double position,
                              std::span<double> configuration) const noexcept {
  const auto at = [&](const Part& part) -> double& {
    return configuration[static_cast<std::size_t>(part.position)];
  };
  const std::vector<Part>& parts = motors_[joint].parts;
  if (parts.size() == 1 && parts[0].share == 1.0) {
    at(parts[0]) = position;
  } else {
    double present = 0.0;
    for (const Part& part : parts) present += part.share * at(part);
    const double way = (position - present) / motors_[joint].sum_of_squares;
    for (const Part& part : parts) at(part) += part.share * way;
  }
  for (const Follower& follower : motors_[joint].followers) {
    const double moved =
        configuration[static_cast<std::size_t>(follower.leader)] - follower.leader_start;
    const double sum =
        std::accumulate(follower.factors.rbegin(), follower.factors.rend(), 0.0,
                        [moved](double rest, double factor) { return rest * moved + factor; });
    configuration[static_cast<std::size_t>(follower.position)] = follower.start + sum;
  }
}

void SceneModel::set_velocity(std::size_t joint, double velocity, mjData_& data) const noexcept {
  const Motor& motor = motors_[joint];
  for (const Part& part : motor.parts) {
    data.qvel[part.velocity] = part.share * velocity / motor.sum_of_squares;
  }
  for (const Follower& follower : motor.followers) {
    data.qvel[follower.velocity] = follower.speed * velocity;
  }
}

// A follower of a follower comes after it.
void SceneModel::find_followers() {
  const mjModel& model = *model_;
  std::vector<int> left;
  for (int i = 0; i < static_cast<int>(model.neq); ++i) {
    if (model.eq_type[i] == mjEQ_JOINT && model.eq_obj2id[i] >= 0 && model.eq_active0[i])
      left.push_back(i);
  }
  const auto is_driven = [&](int dof) {
    return std::ranges::any_of(motors_, [dof](const Motor& motor) {
      return std::ranges::find(motor.parts, dof, &Part::velocity) != motor.parts.end();
    });
  };
  // What a motor moves itself is coupled already. A joint follows one other joint.
  std::set<int> seen;
  std::erase_if(left, [&](int i) {
    return is_driven(model.jnt_dofadr[model.eq_obj1id[i]]) ||
           !seen.insert(model.eq_obj1id[i]).second;
  });
  const auto finds_leader = [&](int equality) {
    const int leader = model.eq_obj2id[equality];
    const int follower = model.eq_obj1id[equality];
    const int dof = model.jnt_dofadr[leader];
    for (Motor& motor : motors_) {
      double speed = 0.0;  // of the leader
      for (const Part& part : motor.parts) {
        if (part.velocity == dof) speed = part.share / motor.sum_of_squares;
      }
      for (const Follower& other : motor.followers) {
        if (other.velocity == dof) speed = other.speed;
      }
      if (speed == 0.0) continue;
      std::array<double, 5> factors{};
      std::copy_n(model.eq_data + mjNEQDATA * equality, factors.size(), factors.begin());
      motor.followers.push_back({.position = model.jnt_qposadr[follower],
                                 .velocity = model.jnt_dofadr[follower],
                                 .start = model.qpos0[model.jnt_qposadr[follower]],
                                 .leader = model.jnt_qposadr[leader],
                                 .leader_start = model.qpos0[model.jnt_qposadr[leader]],
                                 .factors = factors,
                                 .speed = speed * factors[1]});
      return true;
    }
    return false;
  };
  while (std::erase_if(left, finds_leader) > 0) {
  }
}

void SceneModel::set_torque(std::size_t joint, double torque, mjData_& data) const noexcept {
  data.ctrl[motors_[joint].ctrl] = torque;
}

double SceneModel::torque_of(std::size_t joint, const double* force) const noexcept {
  double torque = 0.0;
  for (const Part& part : motors_[joint].parts) torque += part.share * force[part.velocity];
  torque /= motors_[joint].sum_of_squares;
  for (const Follower& follower : motors_[joint].followers)
    torque += follower.speed * force[follower.velocity];
  return torque;
}

double SceneModel::model_position(std::size_t joint, const mjData_& data) const noexcept {
  return data.qpos[model_parts_[joint].position];
}

double SceneModel::model_velocity(std::size_t joint, const mjData_& data) const noexcept {
  return data.qvel[model_parts_[joint].velocity];
}

void SceneModel::set_model_position(std::size_t joint, double position,
                                    mjData_& data) const noexcept {
  data.qpos[model_parts_[joint].position] = position;
}

void SceneModel::set_model_position(std::size_t joint, double position,
                                    std::span<double> configuration) const noexcept {
  configuration[static_cast<std::size_t>(model_parts_[joint].position)] = position;
}

bool SceneModel::is_finite(const mjModel& model, const mjData& data) noexcept {
  const auto all_finite = [](const double* values, auto count) {
    return std::none_of(values, values + count, [](double value) { return mju_isBad(value) != 0; });
  };
  return all_finite(data.qpos, model.nq) && all_finite(data.qvel, model.nv) &&
         data.warning[mjWARN_BADQACC].number == 0;
}

void SceneModel::compute_weight(const mjModel_& model, mjData_& data,
                                std::span<double> torque) const noexcept {
  // These calls compute only what the inverse dynamics of a robot at rest needs.
  mj_kinematics(&model, &data);
  mj_comPos(&model, &data);
  mj_tendon(&model, &data);
  mj_comVel(&model, &data);
  mj_passive(&model, &data);
  // qfrc_inverse only serves as memory of the right size: no step reads it.
  mj_rne(&model, &data, 0, data.qfrc_inverse);
  mju_subFrom(data.qfrc_inverse, data.qfrc_spring, static_cast<int>(model.nv));
  mju_subFrom(data.qfrc_inverse, data.qfrc_gravcomp, static_cast<int>(model.nv));
  for (std::size_t i = 0; i < torque.size(); ++i) torque[i] = torque_of(i, data.qfrc_inverse);
}

}  // namespace trifinger
