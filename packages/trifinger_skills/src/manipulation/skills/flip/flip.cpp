// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <memory>
#include <optional>

#include "manipulation/parts/object_of.hpp"
#include "manipulation/parts/repose.hpp"
#include "manipulation/skills/makers.hpp"
#include "model/rotation_between.hpp"

namespace trifinger::manipulation {

std::unique_ptr<Skill> make_flip(const SkillContext& context, const config::Node& root) {
  const ReposeConfig config = read_repose(root);
  const Eigen::Vector3d face = read_face(root, "face");
  const auto radius = root.required<double>("radius", {.unit = "m", .min = 0, .max = 0.2});
  const Eigen::Vector3d half =
      Eigen::Vector3d::Map(
          object_of(context.description, config.object, ObjectShape::kBox).size.data()) /
      2;
  return std::make_unique<Repose>(
      context, config, [=](int number, const Pose& pose) -> std::optional<Goal> {
        if (number > 0) return std::nullopt;
        const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
        // The least turn that brings the face up.
        const Eigen::Quaterniond turn = rotation_between(pose.orientation * face, z);
        return Goal{.pose = {{0, 0, half.dot(face.cwiseAbs())}, turn * pose.orientation},
                    .axis = face,
                    .free_radius = radius};
      });
}

}  // namespace trifinger::manipulation
