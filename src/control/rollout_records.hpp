// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "trifinger/control/planning_model.hpp"

namespace trifinger::control {

// The arrays that a rollout writes its states to. A null pointer leaves that series out.
struct RolloutRecord {
  double* positions{nullptr};
  double* velocities{nullptr};
  double* targets{nullptr};
  double* torques{nullptr};
  double* tips{nullptr};

  // Writes state number `k`. Without data, the state is not a number.
  void write(const PlanningModel& model, std::size_t k, const mjData_* data,
             std::span<const double> target) const noexcept;
};

// The states of some rollouts, which costs of batches read.
class RolloutRecords {
 public:
  void resize(const PlanningModel& model, std::size_t num_rollouts, std::size_t num_states);

  [[nodiscard]] RolloutRecord of(std::size_t rollout) noexcept;
  // The numbers of `count` rollouts, one after the other.
  [[nodiscard]] std::span<const double> positions(std::size_t first,
                                                  std::size_t count) const noexcept {
    return part(positions_, first, count);
  }
  [[nodiscard]] std::span<const double> velocities(std::size_t first,
                                                   std::size_t count) const noexcept {
    return part(velocities_, first, count);
  }
  [[nodiscard]] std::span<const double> targets(std::size_t first,
                                                std::size_t count) const noexcept {
    return part(targets_, first, count);
  }
  [[nodiscard]] std::span<const double> torques(std::size_t first,
                                                std::size_t count) const noexcept {
    return part(torques_, first, count);
  }
  [[nodiscard]] std::span<const double> tips(std::size_t first, std::size_t count) const noexcept {
    return part(tips_, first, count);
  }

 private:
  [[nodiscard]] std::span<const double> part(const std::vector<double>& all, std::size_t first,
                                             std::size_t count) const noexcept {
    const std::size_t width = all.size() / num_rollouts_;
    return std::span<const double>(all).subspan(first * width, count * width);
  }

  std::size_t num_rollouts_{1};
  std::vector<double> positions_;
  std::vector<double> velocities_;
  std::vector<double> targets_;
  std::vector<double> torques_;
  std::vector<double> tips_;
};

}  // namespace trifinger::control
