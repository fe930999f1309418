// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/model/identified.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <initializer_list>
#include <string_view>
#include <vector>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/scene_model.hpp"

namespace trifinger {

using detail::require;
using detail::text_of;

void Identified::validate(std::size_t joints) const {
  for (const IdentifiedField& field : fields()) {
    const std::vector<double>& list = this->*field.value;
    require(list.empty() || list.size() == joints,
            text_of("identified.", field.name, " has ", list.size(), " numbers, must have ", joints,
                    ", one for each joint"));
    for (const double value : list) {
      require(value >= field.min && value <= field.max,
              text_of("identified.", field.name, " has ", value, ", must be ", field.min, " to ",
                      field.max));
    }
  }
}

void SceneModel::apply(const Identified& identified, mjModel_& model) const {
  identified.validate(joints_.size());
  using List = std::vector<double> Identified::*;
  const auto has_any = [&](std::initializer_list<List> lists) {
    return std::ranges::any_of(lists, [&](List list) { return !(identified.*list).empty(); });
  };
  const bool has_links = has_any({&Identified::link_mass, &Identified::link_center_x,
                                  &Identified::link_center_y, &Identified::link_center_z});
  const bool has_joints =
      has_any({&Identified::rotor_inertia, &Identified::damping, &Identified::friction});
  if (!has_links && !has_joints) return;
  const Data data = make_data();
  mj_kinematics(&model, data.get());
  const auto link_of = [&](std::size_t joint) {
    return model.body_weldid[model.dof_bodyid[motors_[joint].parts.front().velocity]];
  };
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    const Motor& motor = motors_[i];
    require(motor.parts.size() == 1 && motor.parts.front().share == 1.0,
            text_of("'", joints_[i].name,
                    "' moves several joints of the model: of those only torque_scale, backlash "
                    "and zero_offset can be identified"));
    const int dof = motor.parts.front().velocity;
    if (!identified.rotor_inertia.empty()) {
      model.dof_armature[dof] = identified.rotor_inertia[i];
      model.actuator_armature[motor.actuator] = 0.0;
    }
    if (!identified.damping.empty()) {
      model.dof_damping[dof] = identified.damping[i];
      model.actuator_damping[motor.actuator] = 0.0;
      std::fill_n(model.dof_dampingpoly + mjNPOLY * dof, mjNPOLY, 0.0);
      std::fill_n(model.actuator_dampingpoly + mjNPOLY * motor.actuator, mjNPOLY, 0.0);
    }
    if (!identified.friction.empty()) model.dof_frictionloss[dof] = identified.friction[i];
    if (!has_links) continue;
    const int link = link_of(i);
    bool is_last = true;
    for (std::size_t k = i + 1; k < joints_.size(); ++k) is_last = is_last && link_of(k) != link;
    if (!is_last) continue;
    const mjtNum shift[] = {Identified::of(identified.link_center_x, i, 0.0),
                            Identified::of(identified.link_center_y, i, 0.0),
                            Identified::of(identified.link_center_z, i, 0.0)};
    mjtNum in_world[3];
    mju_mulMatVec3(in_world, data->xmat + 9 * link, shift);
    const double factor = Identified::of(identified.link_mass, i, 1.0);
    for (int body = 1; body < static_cast<int>(model.nbody); ++body) {
      if (model.body_weldid[body] != link) continue;
      model.body_mass[body] *= factor;
      for (int k = 3 * body; k < 3 * body + 3; ++k) model.body_inertia[k] *= factor;
      mjtNum in_body[3];
      mju_mulMatTVec3(in_body, data->xmat + 9 * body, in_world);
      mju_addTo3(model.body_ipos + 3 * body, in_body);
    }
  }
  mj_setConst(&model, data.get());
}

void SceneModel::adopt(const Identified& identified) { apply(identified, *model_); }

double SceneModel::described(const char* field, std::size_t joint) const {
  const mjModel& model = *model_;
  const Motor& motor = motors_[joint];
  const int dof = motor.parts.front().velocity;
  const std::string_view name = field;
  if (name == "rotor_inertia") return rotor_inertia(joint, model);
  if (name == "damping") return model.dof_damping[dof] + model.actuator_damping[motor.actuator];
  if (name == "friction") return model.dof_frictionloss[dof];
  return name == "torque_scale" || name == "link_mass" ? 1.0 : 0.0;
}

}  // namespace trifinger
