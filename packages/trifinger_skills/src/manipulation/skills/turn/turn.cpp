// SPDX-License-Identifier: BSD-3-Clause
#include "manipulation/parts/pinched_handling.hpp"
#include "manipulation/skills/makers.hpp"

namespace trifinger::manipulation {
namespace {

// Two tips hold the cube between them, above the table, and the third one turns it.
class Turn final : public PinchedHandling {
 public:
  using PinchedHandling::PinchedHandling;

 protected:
  [[nodiscard]] std::string_view wrong_end() const noexcept override {
    return "the cube is not as it should be after the turn";
  }
  [[nodiscard]] double error_of(const Pose& pose, const Pose& goal) const noexcept override {
    return control::rotation_error(goal.orientation, pose.orientation).norm();
  }
  // Only if it still lies on the same face: a second turn would be one too many.
  [[nodiscard]] bool may_begin_again(const Pose& first, const Pose& now) const noexcept override {
    const Eigen::Vector3d up = first.orientation.conjugate() * Eigen::Vector3d::UnitZ();
    constexpr double kMinCosine = 0.9;
    return (now.orientation * up).z() > kMinCosine;
  }
};

}  // namespace

std::unique_ptr<Skill> make_turn(const SkillContext& context, const config::Node& root) {
  return std::make_unique<Turn>(context, read_pinched_handling(root));
}

}  // namespace trifinger::manipulation
