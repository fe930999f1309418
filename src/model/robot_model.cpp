// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/model/robot_model.hpp"

#include <utility>

#include "model/export.hpp"
#include "spec.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger {

RobotModel::RobotModel(RobotDescription description, Detail detail)
    : description_(std::move(description)), detail_(detail) {
  const detail::Spec spec = detail::make_spec(description_, detail_);
  model_ = detail::compile(spec.get());
  const mjModel* compiled = model_.get();

  for (const std::string& name : tip_names(description_)) {
    tip_geoms_.push_back(mj_name2id(compiled, mjOBJ_GEOM, name.c_str()));
    tip_sites_.push_back(mj_name2id(compiled, mjOBJ_SITE, name.c_str()));
  }
  for (int geom = 0; geom < static_cast<int>(compiled->ngeom); ++geom)
    surfaces_.push_back(
        detail::surface_of(compiled->geom_contype[geom], compiled->geom_priority[geom]));
  for (std::string& name : trifinger::joint_names(description_)) {
    const int joint = mj_name2id(compiled, mjOBJ_JOINT, name.c_str());
    const Part part{.position = compiled->jnt_qposadr[joint],
                    .velocity = compiled->jnt_dofadr[joint],
                    .share = 1.0};
    const int index = static_cast<int>(joints_.size());
    model_joints_.push_back({.name = name});
    model_parts_.push_back(part);
    motors_.push_back({.actuator = index, .ctrl = index, .parts = {part}});
    joints_.push_back({.name = std::move(name)});
  }
  initial_position_.assign(compiled->key_qpos, compiled->key_qpos + num_joints());
  for (const ObjectDescription& object : description_.objects) {
    const int joint = mj_name2id(compiled, mjOBJ_JOINT, object.name.c_str());
    objects_.push_back({.name = object.name,
                        .body = compiled->jnt_bodyid[joint],
                        .position = compiled->jnt_qposadr[joint],
                        .velocity = compiled->jnt_dofadr[joint]});
  }
}

void RobotModel::reset(mjData_& data) const noexcept {
  mj_resetDataKeyframe(model_.get(), &data, 0);
}

std::string RobotModel::mjcf() const { return export_mjcf(description_); }

std::vector<std::string> RobotModel::camera_names() const {
  std::vector<std::string> names;
  if (description_.cameras && detail_ == Detail::kPictures)
    for (const CameraFigures& camera : camera_figures()) names.emplace_back(camera.name);
  return names;
}

std::string export_mjcf(const RobotDescription& description, Detail detail) {
  const detail::Spec spec = detail::make_spec(description, detail);
  (void)detail::compile(spec.get());
  char error[500] = "";
  std::string xml(1 << 20, '\0');
  const int result =
      mj_saveXMLString(spec.get(), xml.data(), static_cast<int>(xml.size()), error, sizeof(error));
  if (result != 0) throw Error("MuJoCo cannot write the model: " + std::string(error));
  xml.resize(xml.find('\0'));
  return xml;
}

}  // namespace trifinger
