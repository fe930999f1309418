// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <array>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "manipulation/parts/object_of.hpp"
#include "manipulation/parts/repose.hpp"
#include "manipulation/skills/makers.hpp"

namespace trifinger::manipulation {

std::unique_ptr<Skill> make_place(const SkillContext& context, const config::Node& root) {
  ReposeConfig config = read_repose(root);
  config.carry = read_carrier(context, root.section("carry"), config.object);
  const Eigen::Vector3d half =
      Eigen::Vector3d::Map(
          object_of(context.description, config.object, ObjectShape::kBox).size.data()) /
      2;
  std::vector<Goal> goals;
  for (const config::Node& item : root.at("goals").items()) {
    const auto place =
        item.required<std::array<double, 2>>("place", {.unit = "m", .min = -0.2, .max = 0.2});
    const Eigen::Vector3d face = read_face(item, "face");
    const auto turn = item.required<double>("turn", {.unit = "rad", .min = -3.15, .max = 3.15});
    goals.push_back(
        {.pose = {{place[0], place[1], half.dot(face.cwiseAbs())}, lying_on(face, turn)},
         .axis = {},
         .free_radius = 0.0});
  }
  return std::make_unique<Repose>(
      context, config, [goals = std::move(goals)](int number, const Pose&) -> std::optional<Goal> {
        const auto index = static_cast<std::size_t>(number);
        if (index >= goals.size()) return std::nullopt;
        return goals[index];
      });
}

}  // namespace trifinger::manipulation
