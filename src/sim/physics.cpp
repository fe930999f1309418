// SPDX-License-Identifier: BSD-3-Clause
#include "physics.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <mutex>

#include "trifinger/base/error.hpp"

namespace trifinger::sim {
namespace {

// What a step changes of the state: the rest are inputs that nobody here gives.
constexpr int kChangedByStep = mjSTATE_FULLPHYSICS | mjSTATE_WARMSTART | mjSTATE_CTRL;

// MuJoCo writes warnings to a file in the working directory. Ours are faults: the counters in
// mjData tell.
void silence_warnings() {
  static std::once_flag once;
  std::call_once(once, [] { mju_user_warning = [](const char*) {}; });
}

}  // namespace

void Physics::Delete::operator()(mjData_* data) const noexcept { mj_deleteData(data); }

Physics::Physics(const RobotDescription& description, int substeps)
    : model_(description),
      substeps_(substeps),
      data_(mj_makeData(model_.mujoco())),
      state_size_(static_cast<std::size_t>(mj_stateSize(model_.mujoco(), mjSTATE_INTEGRATION))),
      before_step_(static_cast<std::size_t>(mj_stateSize(model_.mujoco(), kChangedByStep))),
      after_step_(before_step_.size()),
      tip_forces_(static_cast<std::size_t>(model_.num_fingers())),
      bias_(static_cast<std::size_t>(model_.mujoco()->nv)) {
  if (data_ == nullptr) throw Error("MuJoCo has no memory for the scene");
  silence_warnings();
  reset();
}

void Physics::reset() noexcept {
  mj_resetDataKeyframe(model_.mujoco(), data_.get(), 0);
  std::ranges::fill(tip_forces_, 0.0);
}

void Physics::set_joint(int joint, double position) noexcept { data_->qpos[joint] = position; }
double Physics::position(int joint) const noexcept { return data_->qpos[joint]; }
double Physics::velocity(int joint) const noexcept { return data_->qvel[joint]; }

bool Physics::step(std::span<const double> torque) noexcept {
  mj_getState(model_.mujoco(), data_.get(), before_step_.data(), kChangedByStep);
  std::ranges::copy(torque, data_->ctrl);
  for (int i = 0; i < substeps_; ++i) mj_step(model_.mujoco(), data_.get());
  measure_tip_forces();
  return is_finite();
}

bool Physics::is_finite() const noexcept {
  const mjModel& model = *model_.mujoco();
  const auto all_finite = [](const double* values, auto count) {
    return std::none_of(values, values + count, [](double value) { return mju_isBad(value) != 0; });
  };
  return all_finite(data_->qpos, model.nq) && all_finite(data_->qvel, model.nv) &&
         data_->warning[mjWARN_BADQACC].number == 0;
}

void Physics::measure_tip_forces() noexcept {
  std::ranges::fill(tip_forces_, 0.0);
  const std::vector<int>& tips = model_.tip_geoms();
  for (int i = 0; i < data_->ncon; ++i) {
    const mjContact& contact = data_->contact[i];
    for (std::size_t finger = 0; finger < tips.size(); ++finger) {
      if (contact.geom[0] != tips[finger] && contact.geom[1] != tips[finger]) continue;
      mjtNum force[6];
      mj_contactForce(model_.mujoco(), data_.get(), i, force);
      // In the contact's frame, whose first axis is the normal.
      tip_forces_[finger] += force[0];
    }
  }
}

void Physics::gravity_torques(std::span<double> torque) noexcept {
  const mjModel* const model = model_.mujoco();
  // Only what the inverse dynamics of a robot at rest needs; the warm start of the solver stays
  // untouched.
  mj_kinematics(model, data_.get());
  mj_comPos(model, data_.get());
  mj_comVel(model, data_.get());
  mj_rne(model, data_.get(), 0, bias_.data());
  std::copy_n(bias_.begin(), torque.size(), torque.begin());
}

ObjectPose Physics::object_pose(const ObjectAddress& object) const noexcept {
  ObjectPose pose;
  const double* const values = data_->qpos + object.position;
  std::copy_n(values, pose.position.size(), pose.position.begin());
  std::copy_n(values + pose.position.size(), pose.orientation.size(), pose.orientation.begin());
  return pose;
}

void Physics::place_object(const ObjectAddress& object, const ObjectPose& pose) noexcept {
  double* const values = data_->qpos + object.position;
  std::ranges::copy(pose.position, values);
  std::ranges::copy(pose.orientation, values + pose.position.size());
  constexpr int kFreeJointSpeeds = 6;
  std::fill_n(data_->qvel + object.velocity, kFreeJointSpeeds, 0.0);
}

void Physics::push_object(const ObjectAddress& object,
                          const std::array<double, 3>& force) noexcept {
  constexpr std::ptrdiff_t kWrench = 6;  // Force, then moment.
  std::ranges::copy(force, data_->xfrc_applied + kWrench * object.body);
}

void Physics::get_state(std::span<double> state) const noexcept {
  mj_getState(model_.mujoco(), data_.get(), state.data(), mjSTATE_INTEGRATION);
}

void Physics::get_state_before_step(std::span<double> state) noexcept {
  mj_getState(model_.mujoco(), data_.get(), after_step_.data(), kChangedByStep);
  mj_setState(model_.mujoco(), data_.get(), before_step_.data(), kChangedByStep);
  get_state(state);
  mj_setState(model_.mujoco(), data_.get(), after_step_.data(), kChangedByStep);
}

void Physics::set_state(std::span<const double> state) noexcept {
  mj_setState(model_.mujoco(), data_.get(), state.data(), mjSTATE_INTEGRATION);
  data_->warning[mjWARN_BADQACC].number = 0;
}

std::vector<std::byte> Physics::model_bytes() const {
  std::vector<std::byte> bytes(static_cast<std::size_t>(mj_sizeModel(model_.mujoco())));
  mj_saveModel(model_.mujoco(), nullptr, bytes.data(), static_cast<int>(bytes.size()));
  return bytes;
}

std::vector<double> Physics::configuration() const {
  const mjModel& model = *model_.mujoco();
  std::vector<double> values(data_->qpos, data_->qpos + model.nq);
  values.insert(values.end(), data_->qvel, data_->qvel + model.nv);
  return values;
}

}  // namespace trifinger::sim
