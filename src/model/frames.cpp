// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/model/frames.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <utility>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

using detail::require;

// The point `local` of a body at `pose`, in the world frame.
std::array<double, 3> point_of(const FramePose& pose, const double* local) noexcept {
  std::array<double, 3> point{};
  mju_rotVecQuat(point.data(), local, pose.orientation.data());
  mju_addTo3(point.data(), pose.position.data());
  return point;
}

void turn(FramePose& pose, const double* quaternion) noexcept {
  const std::array<double, 4> before = pose.orientation;
  mju_mulQuat(pose.orientation.data(), before.data(), quaternion);
}

// Moves the pose of a body by one of its joints, like MuJoCo's kinematics.
void move(const mjModel& model, int joint, const double* qpos, FramePose& pose) noexcept {
  const int address = model.jnt_qposadr[joint];
  const double* const axis = model.jnt_axis + 3 * joint;
  const double* const anchor = model.jnt_pos + 3 * joint;
  const std::array<double, 3> fixed = point_of(pose, anchor);
  std::array<double, 4> quaternion{};
  switch (model.jnt_type[joint]) {
    case mjJNT_SLIDE: {
      std::array<double, 3> direction{};
      mju_rotVecQuat(direction.data(), axis, pose.orientation.data());
      mju_addToScl3(pose.position.data(), direction.data(), qpos[address] - model.qpos0[address]);
      return;
    }
    case mjJNT_HINGE:
      mju_axisAngle2Quat(quaternion.data(), axis, qpos[address] - model.qpos0[address]);
      break;
    default:  // a ball joint
      std::copy_n(qpos + address, 4, quaternion.begin());
      mju_normalize4(quaternion.data());
      break;
  }
  turn(pose, quaternion.data());
  // The joint's anchor stays where it is.
  const std::array<double, 3> moved = point_of(pose, anchor);
  for (std::size_t i = 0; i < 3; ++i) pose.position[i] += fixed[i] - moved[i];
}

// Goes from the pose of its parent to that of a body. `visit` is called with each joint and the
// pose before it.
template <class Visit>
void go_to(const mjModel& model, int body, const double* qpos, FramePose& pose,
           const Visit& visit) noexcept {
  const int first = model.body_jntadr[body];
  if (model.body_jntnum[body] == 1 && model.jnt_type[first] == mjJNT_FREE) {
    const double* const values = qpos + model.jnt_qposadr[first];
    std::copy_n(values, 3, pose.position.begin());
    std::copy_n(values + 3, 4, pose.orientation.begin());
    mju_normalize4(pose.orientation.data());
    return;
  }
  pose.position = point_of(pose, model.body_pos + 3 * body);
  turn(pose, model.body_quat + 4 * body);
  for (int i = 0; i < model.body_jntnum[body]; ++i) {
    visit(first + i, pose);
    move(model, first + i, qpos, pose);
  }
}

std::string names_of(const mjModel& model, mjtObj type, int count) {
  std::string text;
  for (int id = 0; id < count; ++id) {
    const char* const name = mj_id2name(&model, type, id);
    if (name == nullptr || std::string_view(name) == "world") continue;
    text += (text.empty() ? "" : ", ") + std::string(name);
  }
  return text.empty() ? "none" : text;
}

}  // namespace

Frames::Frames(std::shared_ptr<const SceneModel> model, std::span<const std::string> names)
    : model_(std::move(model)) {
  const mjModel& mujoco = *model_->mujoco();
  for (const std::string& name : names) {
    Chain chain{.bodies = {}, .position = nullptr, .orientation = nullptr};
    int body = -1;
    if (const int site = mj_name2id(&mujoco, mjOBJ_SITE, name.c_str()); site >= 0) {
      body = mujoco.site_bodyid[site];
      chain.position = mujoco.site_pos + 3 * site;
      chain.orientation = mujoco.site_quat + 4 * site;
    } else if (const int named = mj_name2id(&mujoco, mjOBJ_BODY, name.c_str()); named >= 0) {
      body = named;
    } else if (const int geom = mj_name2id(&mujoco, mjOBJ_GEOM, name.c_str()); geom >= 0) {
      body = mujoco.geom_bodyid[geom];
      chain.position = mujoco.geom_pos + 3 * geom;
      chain.orientation = mujoco.geom_quat + 4 * geom;
    }
    require(body >= 0,
            detail::text_of("the model has no frame '", name, "'; its sites are ",
                            names_of(mujoco, mjOBJ_SITE, static_cast<int>(mujoco.nsite)),
                            ", its bodies are ",
                            names_of(mujoco, mjOBJ_BODY, static_cast<int>(mujoco.nbody))));
    for (; body > 0; body = mujoco.body_parentid[body]) chain.bodies.push_back(body);
    std::ranges::reverse(chain.bodies);
    require(
        std::ranges::any_of(chain.bodies, [&](int part) { return mujoco.body_jntnum[part] > 0; }),
        detail::text_of("the frame '", name, "' cannot move: no joint moves its body"));
    chains_.push_back(std::move(chain));
  }
}

FramePose Frames::pose(std::size_t frame, std::span<const double> configuration) const noexcept {
  const auto& [bodies, position, orientation] = chains_[frame];
  FramePose pose;
  for (const int body : bodies) {
    go_to(*model_->mujoco(), body, configuration.data(), pose, [](int, const FramePose&) {});
  }
  if (position != nullptr) {
    pose.position = point_of(pose, position);
    turn(pose, orientation);
  }
  return pose;
}

std::array<double, 3> Frames::position(std::size_t frame,
                                       std::span<const double> configuration) const noexcept {
  return pose(frame, configuration).position;
}

void Frames::positions(std::span<const double> configuration,
                       std::span<double> positions) const noexcept {
  for (std::size_t i = 0; i < chains_.size(); ++i) {
    std::ranges::copy(position(i, configuration),
                      positions.begin() + static_cast<std::ptrdiff_t>(3 * i));
  }
}

void Frames::jacobian(std::size_t frame, std::span<const double> configuration,
                      std::span<double> jacobian) const noexcept {
  const mjModel& model = *model_->mujoco();
  const std::array<double, 3> point = position(frame, configuration);
  FramePose pose;
  const auto add = [&](int joint, const FramePose& before) {
    const int type = model.jnt_type[joint];
    if (type != mjJNT_HINGE && type != mjJNT_SLIDE) return;
    std::array<double, 3> axis{};
    mju_rotVecQuat(axis.data(), model.jnt_axis + 3 * joint, before.orientation.data());
    std::array<double, 3> column = axis;
    if (type == mjJNT_HINGE) {
      std::array<double, 3> arm{};
      mju_sub3(arm.data(), point.data(), point_of(before, model.jnt_pos + 3 * joint).data());
      mju_cross(column.data(), axis.data(), arm.data());
    }
    const auto width = static_cast<std::size_t>(model.nv);
    const auto dof = static_cast<std::size_t>(model.jnt_dofadr[joint]);
    const bool has_rotation = jacobian.size() >= 6 * width;
    for (std::size_t row = 0; row < 3; ++row) {
      jacobian[row * width + dof] = column[row];
      if (has_rotation) jacobian[(3 + row) * width + dof] = type == mjJNT_HINGE ? axis[row] : 0.0;
    }
  };
  for (const int body : chains_[frame].bodies) {
    go_to(model, body, configuration.data(), pose, add);
  }
}

std::vector<std::string> end_frames(const SceneModel& model) {
  const mjModel& mujoco = *model.mujoco();
  std::vector<std::string> names;
  const auto add = [&](mjtObj type, int id) {
    const char* const name = mj_id2name(&mujoco, type, id);
    if (name != nullptr && *name != '\0') names.emplace_back(name);
    return name != nullptr && *name != '\0';
  };
  for (const int site : model.tip_sites()) add(mjOBJ_SITE, site);
  if (!names.empty()) return names;

  const auto count = static_cast<std::size_t>(mujoco.nbody);
  std::vector<bool> is_moved(count, false);    // by a driven joint
  std::vector<bool> has_bodies(count, false);  // beneath it
  std::vector<double> unit(static_cast<std::size_t>(mujoco.nv), 0.0);
  for (std::size_t body = 1; body < count; ++body) {
    const auto parent = static_cast<std::size_t>(mujoco.body_parentid[body]);
    has_bodies[parent] = true;
    is_moved[body] = is_moved[parent];
    for (int i = 0; i < mujoco.body_dofnum[body]; ++i) {
      const int number = mujoco.body_dofadr[body] + i;
      const auto dof = static_cast<std::size_t>(number);
      unit[dof] = 1.0;
      for (std::size_t joint = 0; joint < model.joints().size(); ++joint) {
        if (model.torque_of(joint, unit.data()) != 0.0) is_moved[body] = true;
      }
      unit[dof] = 0.0;
    }
  }
  const auto num_sites = static_cast<int>(mujoco.nsite);
  for (std::size_t body = 1; body < count; ++body) {
    if (!is_moved[body] || has_bodies[body]) continue;
    int site = 0;
    const auto own = static_cast<int>(body);
    while (site < num_sites && mujoco.site_bodyid[site] != own) ++site;
    if (site == num_sites || !add(mjOBJ_SITE, site)) {
      add(mjOBJ_BODY, static_cast<int>(body));
    }
  }
  return names;
}

}  // namespace trifinger
