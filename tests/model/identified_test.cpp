// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/model/identified.hpp"

#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <array>
#include <vector>

#include "model/file_robots.hpp"
#include "support/folder.hpp"
#include "trifinger/model/model_file.hpp"

namespace trifinger::test {
namespace {

// A link with a part that is fixed to it, turned and with another part on it, and a second link.
constexpr const char* kLinks = R"(<mujoco><worldbody>
  <body name="first" pos="0 0 1" euler="20 0 40">
    <joint name="a" axis="0 1 0"/><geom type="box" size="0.1 0.02 0.03" pos="0.1 0 0"/>
    <body name="fixed" pos="0.2 0 0" euler="30 50 0">
      <geom size="0.05" pos="0 0.05 0"/>
      <body name="fixed to it" euler="0 70 10"><geom size="0.04"/></body>
      <body name="second" pos="0 0 0.1">
        <joint name="b" axis="1 0 0"/><geom type="box" size="0.02 0.1 0.03" pos="0 0.1 0"/>
      </body>
    </body>
  </body>
</worldbody><actuator><motor joint="a"/><motor joint="b"/></actuator></mujoco>)";

// Where centres of mass are in a pose, and the torques that hold it.
struct AtRest {
  std::vector<std::array<double, 3>> centers;
  std::vector<double> torques;
};

AtRest at_rest(const SceneModel& scene, const mjModel& model) {
  const SceneModel::Data data = scene.make_data();
  data->qpos[0] = 0.3;
  data->qpos[1] = -0.5;
  mj_forward(&model, data.get());
  AtRest found;
  for (int body = 1; body < model.nbody; ++body) {
    const double* const center = data->xipos + 3 * body;
    found.centers.push_back({center[0], center[1], center[2]});
  }
  found.torques.assign(data->qfrc_bias, data->qfrc_bias + model.nv);
  return found;
}

TEST(Identified, MovesCentersOfALinkAndOfAllThatIsFixedToIt) {
  const Folder folder;
  write(folder / "links.xml", kLinks);
  const ModelFile scene({.path = folder / "links.xml"});
  const SceneModel::Compiled changed = scene.copy();
  const double shift[] = {0.01, -0.02, 0.03};
  scene.apply({.link_center_x = {shift[0], 0},
               .link_center_y = {shift[1], 0},
               .link_center_z = {shift[2], 0}},
              *changed);
  const AtRest before = at_rest(scene, *scene.mujoco());
  const AtRest after = at_rest(scene, *changed);

  const SceneModel::Data data = scene.make_data();
  data->qpos[0] = 0.3;
  mj_kinematics(scene.mujoco(), data.get());
  const int link = mj_name2id(scene.mujoco(), mjOBJ_BODY, "first");
  mjtNum moved[3];
  mju_mulMatVec3(moved, data->xmat + 9 * link, shift);
  double mass = 0;
  for (std::size_t i = 0; i < before.centers.size(); ++i) {
    const int body = static_cast<int>(i) + 1;
    const bool is_second = body == mj_name2id(scene.mujoco(), mjOBJ_BODY, "second");
    if (!is_second) mass += scene.mujoco()->body_mass[body];
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_NEAR(after.centers[i][k] - before.centers[i][k], is_second ? 0 : moved[k], 1e-12);
  }
  // Its weight has another lever about the axis of its joint, and none about that of the second.
  mjtNum torque[3];
  const mjtNum weight[] = {0, 0, mass * 9.81};
  mju_cross(torque, moved, weight);
  mjtNum axis[3];
  const mjtNum own[] = {0, 1, 0};
  mju_mulMatVec3(axis, data->xmat + 9 * link, own);
  EXPECT_NEAR(after.torques[0] - before.torques[0], mju_dot3(torque, axis), 1e-9);
  EXPECT_NEAR(after.torques[1], before.torques[1], 1e-9);
}

}  // namespace
}  // namespace trifinger::test
