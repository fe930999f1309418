// SPDX-License-Identifier: BSD-3-Clause
#include "rollout_records.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <limits>

namespace trifinger::control {
namespace {

std::size_t position_size(const PlanningModel& model) noexcept {
  return static_cast<std::size_t>(model.position_size());
}
std::size_t velocity_size(const PlanningModel& model) noexcept {
  return static_cast<std::size_t>(model.velocity_size());
}

}  // namespace

void RolloutRecord::write(const PlanningModel& model, std::size_t k, const mjData* data,
                          std::span<const double> target) const noexcept {
  if (positions == nullptr) return;
  const auto put = [k](double* to, const double* from, std::size_t count) {
    if (to == nullptr) return;
    if (from == nullptr) {
      std::fill_n(to + k * count, count, std::numeric_limits<double>::quiet_NaN());
    } else {
      std::copy_n(from, count, to + k * count);
    }
  };
  const bool is_good = data != nullptr;
  const std::size_t num_joints = model.joints().size();
  put(positions, is_good ? data->qpos : nullptr, position_size(model));
  put(velocities, is_good ? data->qvel : nullptr, velocity_size(model));
  put(targets, is_good ? target.data() : nullptr, num_joints);
  put(torques, is_good ? data->ctrl : nullptr, num_joints);
  if (tips == nullptr) return;
  const std::size_t num_tips = model.tip_sites().size();
  for (std::size_t i = 0; i < num_tips; ++i) {
    double* const tip = tips + 3 * (k * num_tips + i);
    if (is_good) {
      std::copy_n(data->site_xpos + std::ptrdiff_t{3} * model.tip_sites()[i], 3, tip);
    } else {
      std::fill_n(tip, 3, std::numeric_limits<double>::quiet_NaN());
    }
  }
}

void RolloutRecords::resize(const PlanningModel& model, std::size_t num_rollouts,
                            std::size_t num_states) {
  num_rollouts_ = num_rollouts;
  const std::size_t count = num_rollouts * num_states;
  positions_.resize(count * position_size(model));
  velocities_.resize(count * velocity_size(model));
  targets_.resize(count * model.joints().size());
  torques_.resize(count * model.joints().size());
  tips_.resize(count * 3 * model.tip_sites().size());
}

RolloutRecord RolloutRecords::of(std::size_t rollout) noexcept {
  const auto begin = [&](std::vector<double>& all) {
    return all.data() + rollout * (all.size() / num_rollouts_);
  };
  return {begin(positions_), begin(velocities_), begin(targets_), begin(torques_), begin(tips_)};
}

}  // namespace trifinger::control
