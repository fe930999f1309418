// SPDX-License-Identifier: BSD-3-Clause
#include "guiding/joint_elements.hpp"

#include <cstring>

#include "base/text_of.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::guiding::detail {

JointElements::JointElements(const Session& session)
    : action_(session.description().default_action),
      observation_(session.element(Series::kObservation).size()) {
  const ElementDescription& action = session.element(Series::kDesiredAction);
  const ElementDescription& observation = session.element(Series::kObservation);
  const FieldDescription* const position = observation.find("position");
  joints_ = position != nullptr ? position->count() : 0;
  const auto place_of = [&](const ElementDescription& element, const char* name) {
    const FieldDescription* const field = element.find(name);
    const bool fits = field != nullptr && field->type == ScalarType::kFloat64 &&
                      field->shape == std::vector{joints_} && joints_ <= kMaxCountedJoints;
    if (fits) return field->offset;
    const SessionInfo info = session.info();
    throw InvalidArgument(trifinger::detail::text_of(
        "robot '", info.name, "' is of type '", info.type, "' and has no '", name,
        "' of each joint; a guide steers joints by torques and positions"));
  };
  measured_position_ = place_of(observation, "position");
  measured_velocity_ = place_of(observation, "velocity");
  torque_ = place_of(action, "torque");
  position_ = place_of(action, "position");
  const FieldDescription* const all = observation.find("joint_position");
  if (all != nullptr && all->type == ScalarType::kFloat64) {
    measured_all_ = all->offset;
    all_.resize(all->count());
  }
  measured_.position.resize(static_cast<Eigen::Index>(joints_));
  measured_.velocity.resize(static_cast<Eigen::Index>(joints_));
  measured_.all = all_;
}

const MeasuredJoints& JointElements::measured() noexcept {
  const std::size_t size = joints_ * sizeof(double);
  std::memcpy(measured_.position.data(), observation_.data() + measured_position_, size);
  std::memcpy(measured_.velocity.data(), observation_.data() + measured_velocity_, size);
  if (!all_.empty())
    std::memcpy(all_.data(), observation_.data() + measured_all_, all_.size() * sizeof(double));
  return measured_;
}

const void* JointElements::action(const GuideCommand& command) noexcept {
  const std::size_t size = joints_ * sizeof(double);
  std::memcpy(action_.data() + torque_, command.torque.data(), size);
  std::memcpy(action_.data() + position_, command.position.data(), size);
  return action_.data();
}

}  // namespace trifinger::guiding::detail
