// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "trifinger/core/frontend.hpp"
#include "trifinger/manipulation/skill.hpp"

namespace trifinger::manipulation {

// Reads the poses of one object from a robot's companion "object".
class ObjectReader {
 public:
  // Throws IncompatibleSession if `robot` has no such companion or it does not know the object.
  ObjectReader(const Frontend<TriFinger>& robot, const std::string& object);

  // A pose that is known at step `t` and was not returned before.
  [[nodiscard]] std::optional<SeenPose> new_pose(TimeIndex t);

 private:
  UntypedFrontend companion_;
  std::vector<std::byte> element_;
  std::size_t stamp_offset_;
  std::size_t pose_offset_;
  std::optional<TimeIndex> last_;
};

}  // namespace trifinger::manipulation
