// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/model/robot_model.hpp"

#include <algorithm>
#include <utility>

#include "spec.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/export.hpp"

namespace trifinger {

void RobotModel::Delete::operator()(mjModel_* model) const noexcept { mj_deleteModel(model); }
void RobotModel::Delete::operator()(mjData_* data) const noexcept { mj_deleteData(data); }

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
  initial_position_.assign(compiled->key_qpos, compiled->key_qpos + num_joints());
  for (const ObjectDescription& object : description_.objects) {
    const int joint = mj_name2id(compiled, mjOBJ_JOINT, object.name.c_str());
    objects_.push_back({.name = object.name,
                        .body = compiled->jnt_bodyid[joint],
                        .position = compiled->jnt_qposadr[joint],
                        .velocity = compiled->jnt_dofadr[joint]});
  }
}

RobotModel::RobotModel(RobotModel&&) noexcept = default;
RobotModel& RobotModel::operator=(RobotModel&&) noexcept = default;
RobotModel::~RobotModel() = default;

RobotModel::Compiled RobotModel::copy() const {
  Compiled copied(mj_copyModel(nullptr, model_.get()));
  if (copied == nullptr) throw Error("MuJoCo has no memory for the model");
  return copied;
}

RobotModel::Data RobotModel::make_data() const {
  Data data(mj_makeData(model_.get()));
  if (data == nullptr) throw Error("MuJoCo has no memory for the scene");
  return data;
}

const ObjectAddress& RobotModel::object(const std::string& name) const {
  const auto found = std::ranges::find(objects_, name, &ObjectAddress::name);
  if (found != objects_.end()) return *found;
  std::string known;
  for (const ObjectAddress& object : objects_) known += (known.empty() ? "" : ", ") + object.name;
  throw InvalidArgument("There is no object '" + name + "'; " +
                        (known.empty() ? "the scene has none." : "the scene has " + known + "."));
}

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
