// SPDX-License-Identifier: BSD-3-Clause
#include "joint/counted_driver.hpp"

#include <utility>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger {

void CountedDriverOptions::validate_joints(std::size_t num_motors) const {
  const auto require_count = [this](const char* what, std::size_t found) {
    detail::require(found == names.size(),
                    detail::text_of("there are ", found, " ", what, " for ", names.size(),
                                    " joints, must be one each"));
  };
  require_count("motors", num_motors);
  require_count("limits", limits.size());
  require_count("initial positions", initial_position.size());
  trifinger::validate(limits);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const JointLimit& limit = limits[i];
    const std::string name = names[i].empty() ? detail::text_of("joint ", i) : names[i];
    // Written so that NaN fails.
    detail::require(
        initial_position[i] >= limit.soft_lower && initial_position[i] <= limit.soft_upper,
        detail::text_of(name, " begins at ", initial_position[i], ", its soft limits are ",
                        limit.soft_lower, " and ", limit.soft_upper));
  }
  detail::require(period > Nanoseconds::zero(), "period must be above 0");
}

FixedText CountedDriverOptions::joint_text(std::size_t joint) const noexcept {
  FixedText text("joint ");
  text.append(joint);
  if (!names[joint].empty()) text.append(" (").append(names[joint]).append(")");
  return text;
}

CountedDriver::CountedDriver(const CountedDriverOptions& options,
                             const std::vector<JointLimit>& limits)
    : chain_(options.types, options.names, limits),
      observation_(options.names.size()),
      all_positions_(options.all_joints.size(), kNotGiven),
      all_velocities_(options.all_joints.size(), kNotGiven),
      tip_force_(options.num_tips, kNotGiven),
      weight_(options.weight),
      all_joints_(options.all_joints),
      stop_(options.stop, options.period),
      period_(options.period),
      held_(options.names.size()) {}

void CountedDriver::add_check(CountedChain::Check check) {
  chain_.add_check(std::move(check), [this](void* element) { write_observation(element); });
}

void CountedDriver::write_observation(void* element) const noexcept {
  write_element(observation_, all_positions_, all_velocities_, tip_force_, element);
}

void CountedDriver::copy_to_all_joints() noexcept {
  for (std::size_t i = 0; i < all_joints_.size(); ++i) {
    if (!all_joints_[i] || *all_joints_[i] >= num_joints()) continue;
    all_positions_[i] = observation_.position[*all_joints_[i]];
    all_velocities_[i] = observation_.velocity[*all_joints_[i]];
  }
}

void CountedDriver::write_weight(const PerJoint<double>& position,
                                 PerJoint<double>& torque) const noexcept {
  if (weight_) weight_(position, torque);
}

DriverReport CountedDriver::hold(const void* observation, void* action) noexcept {
  read_element(observation, held_);
  CountedAction holding = hold_position(held_);
  write_weight(held_.position, holding.torque);
  write_element(holding, action);
  return DriverReport::ready();
}

std::string_view CountedDriver::fault_text(std::int32_t) const noexcept {
  return chain_.fault_text();
}

std::string_view CountedDriver::rejection_text() const noexcept { return chain_.rejection_text(); }

}  // namespace trifinger
