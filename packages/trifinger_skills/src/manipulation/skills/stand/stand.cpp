// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "manipulation/parts/pinched_handling.hpp"
#include "manipulation/skills/makers.hpp"

namespace trifinger::manipulation {
namespace {

// Two tips hold a long box in its middle, the third one turns it upright, and it is left standing.
class Stand final : public PinchedHandling {
 public:
  using PinchedHandling::PinchedHandling;

 protected:
  [[nodiscard]] std::string_view wrong_end() const noexcept override {
    return "the cuboid does not stand";
  }
  // The tilt of the edge that should be upright.
  [[nodiscard]] double error_of(const Pose& pose, const Pose& goal) const noexcept override {
    const Eigen::Vector3d edge = goal.orientation.conjugate() * Eigen::Vector3d::UnitZ();
    const double cosine = std::min((pose.orientation * edge).z(), 1.0);
    return std::acos(std::max(cosine, -1.0));
  }
  [[nodiscard]] bool may_begin_again(const Pose& /*first*/,
                                     const Pose& /*now*/) const noexcept override {
    return true;
  }
};

}  // namespace

std::unique_ptr<Skill> make_stand(const SkillContext& context, const config::Node& root) {
  return std::make_unique<Stand>(context, read_pinched_handling(root, true));
}

}  // namespace trifinger::manipulation
