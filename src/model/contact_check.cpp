// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/model/contact_check.hpp"

#include <mujoco/mujoco.h>

#include <algorithm>

namespace trifinger {
namespace {

// Contacts begin before surfaces touch, if geoms have a margin.
bool touches(const mjContact& contact) { return contact.dist < 0.0; }

std::pair<int, int> parts_of(const mjContact& contact) {
  return {contact.geom[0], contact.geom[1]};
}

}  // namespace

ContactCheck::ContactCheck(std::shared_ptr<const SceneModel> model, std::span<const double> usual)
    : model_(std::move(model)), data_(model_->make_data()) {
  find_contacts(usual);
  for (int i = 0; i < data_->ncon; ++i) {
    if (touches(data_->contact[i])) usual_.push_back(parts_of(data_->contact[i]));
  }
  std::ranges::sort(usual_);
}

bool ContactCheck::is_free(std::span<const double> configuration) const noexcept {
  const std::lock_guard lock(mutex_);
  find_contacts(configuration);
  return std::none_of(data_->contact, data_->contact + data_->ncon, [this](const mjContact& found) {
    return touches(found) && !std::ranges::binary_search(usual_, parts_of(found));
  });
}

void ContactCheck::find_contacts(std::span<const double> configuration) const noexcept {
  const mjModel* const model = model_->mujoco();
  std::ranges::copy(configuration, data_->qpos);
  mj_kinematics(model, data_.get());
  mj_comPos(model, data_.get());
  mj_collision(model, data_.get());
}

}  // namespace trifinger
