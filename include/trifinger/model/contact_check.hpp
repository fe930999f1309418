// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "trifinger/model/scene_model.hpp"

namespace trifinger {

/// Tells whether a pose of a model is free of contacts.
///
/// Many threads may share one; each waits until the one before it is done.
class ContactCheck {
 public:
  /// Parts that touch at `usual`, positions in the order of MuJoCo's `qpos`, may always touch: for
  /// example an object and the table.
  /// @throws Error if there is no memory for it
  ContactCheck(std::shared_ptr<const SceneModel> model, std::span<const double> usual);

  /// True if no other parts touch at this pose. Takes no memory from the heap.
  [[nodiscard]] bool is_free(std::span<const double> configuration) const noexcept;

 private:
  void find_contacts(std::span<const double> configuration) const noexcept;

  std::shared_ptr<const SceneModel> model_;
  mutable std::mutex mutex_;
  SceneModel::Data data_;
  std::vector<std::pair<int, int>> usual_;  // geoms that may touch
};

}  // namespace trifinger
