// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/model/frames.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "file_robots.hpp"
#include "support/allocation_counter.hpp"
#include "support/folder.hpp"
#include "support/message_of.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/random.hpp"
#include "trifinger/model/contact_check.hpp"
#include "trifinger/model/model_file.hpp"
#include "trifinger/model/robot_model.hpp"

namespace trifinger::test {
namespace {

// Two links with every kind of joint on the way to their frames, and joints beside the origin.
constexpr const char* kJoints = R"(<mujoco model="joints">
  <compiler angle="radian"/>
  <worldbody>
    <body name="rail" pos="0.1 0.2 0.8" euler="0.3 -0.2 0.1">
      <joint name="slide" type="slide" axis="1 1 0" ref="0.2"/>
      <joint name="hinge" axis="0 1 1" pos="0.05 0.02 -0.1" ref="-0.3"/>
      <geom name="block" type="box" size="0.05 0.05 0.02" pos="0.01 0.02 0.03"/>
      <body name="wrist" pos="0 0 -0.2" quat="0.8 0.6 0 0">
        <joint name="ball" type="ball" pos="0.01 0 0.03"/>
        <geom size="0.02"/>
        <site name="tip" pos="0.01 -0.02 -0.1" euler="0.4 0.5 -0.6"/>
      </body>
    </body>
    <body name="drone"><freejoint/><geom size="0.05"/><site name="nose" pos="0.1 0 0"/></body>
    <site name="corner" pos="1 1 1"/>
  </worldbody>
</mujoco>
)";

class FramesTest : public testing::Test {
 protected:
  [[nodiscard]] std::shared_ptr<const ModelFile> model(const char* text) const {
    write(folder_ / "robot.xml", text);
    return std::make_shared<const ModelFile>(ModelFileOptions{.path = folder_ / "robot.xml"});
  }

  Folder folder_;
};

TEST_F(FramesTest, AreWhereMujocoSays) {
  const auto file = model(kJoints);
  const mjModel& mujoco = *file->mujoco();
  const std::vector<std::string> names{"tip", "wrist", "block", "nose", "drone"};
  const Frames frames(file, names);
  ASSERT_EQ(frames.size(), names.size());
  const SceneModel::Data data = file->make_data();
  Random random{.seed = 5};
  std::vector<double> points(3 * names.size());
  for (int pose = 0; pose < 100; ++pose) {
    std::vector<double> configuration(static_cast<std::size_t>(mujoco.nq));
    // Quaternions need not be normalized.
    for (double& number : configuration) number = random.uniform(-2.0, 2.0);
    std::ranges::copy(configuration, data->qpos);
    mj_kinematics(&mujoco, data.get());
    {
      const AllocationCounter allocations;
      frames.positions(configuration, points);
      EXPECT_EQ(allocations.count(), 0);
    }
    const std::array<const double*, 5> expected{
        data->site_xpos + 3 * mj_name2id(&mujoco, mjOBJ_SITE, "tip"),
        data->xpos + 3 * mj_name2id(&mujoco, mjOBJ_BODY, "wrist"),
        data->geom_xpos + 3 * mj_name2id(&mujoco, mjOBJ_GEOM, "block"),
        data->site_xpos + 3 * mj_name2id(&mujoco, mjOBJ_SITE, "nose"),
        data->xpos + 3 * mj_name2id(&mujoco, mjOBJ_BODY, "drone")};
    for (std::size_t i = 0; i < points.size(); ++i) {
      EXPECT_NEAR(points[i], expected[i / 3][i % 3], 1e-12) << names[i / 3];
    }
    const std::array<const double*, 5> matrices{
        data->site_xmat + 9 * mj_name2id(&mujoco, mjOBJ_SITE, "tip"),
        data->xmat + 9 * mj_name2id(&mujoco, mjOBJ_BODY, "wrist"),
        data->geom_xmat + 9 * mj_name2id(&mujoco, mjOBJ_GEOM, "block"),
        data->site_xmat + 9 * mj_name2id(&mujoco, mjOBJ_SITE, "nose"),
        data->xmat + 9 * mj_name2id(&mujoco, mjOBJ_BODY, "drone")};
    for (std::size_t i = 0; i < names.size(); ++i) {
      const FramePose pose_of = frames.pose(i, configuration);
      std::array<double, 9> matrix{};
      mju_quat2Mat(matrix.data(), pose_of.orientation.data());
      for (std::size_t k = 0; k < matrix.size(); ++k) {
        EXPECT_NEAR(matrix[k], matrices[i][k], 1e-12) << names[i];
      }
    }
  }
}

TEST_F(FramesTest, HaveTheJacobianOfMujoco) {
  const auto file = model(kJoints);
  const mjModel& mujoco = *file->mujoco();
  const std::vector<std::string> names{"tip", "wrist", "block"};
  const Frames frames(file, names);
  const SceneModel::Data data = file->make_data();
  Random random{.seed = 6};
  const auto size = static_cast<std::size_t>(mujoco.nv);
  std::vector<double> expected(6 * size);
  for (int pose = 0; pose < 100; ++pose) {
    std::vector<double> configuration(static_cast<std::size_t>(mujoco.nq));
    for (double& number : configuration) number = random.uniform(-2.0, 2.0);
    std::ranges::copy(configuration, data->qpos);
    mj_kinematics(&mujoco, data.get());
    mj_comPos(&mujoco, data.get());
    for (std::size_t frame = 0; frame < names.size(); ++frame) {
      const std::array<double, 3> point = frames.position(frame, configuration);
      const int body = mj_name2id(&mujoco, mjOBJ_BODY, frame < 2 ? "wrist" : "rail");
      mj_jac(&mujoco, data.get(), expected.data(), expected.data() + 3 * size, point.data(), body);
      std::vector<double> jacobian(6 * size, 0.0);
      const AllocationCounter allocations;
      frames.jacobian(frame, configuration, jacobian);
      EXPECT_EQ(allocations.count(), 0);
      for (std::size_t row = 0; row < 6; ++row) {
        for (std::size_t dof = 0; dof < 2; ++dof) {  // the slide and the hinge
          EXPECT_NEAR(jacobian[row * size + dof], expected[row * size + dof], 1e-12)
              << names[frame] << ' ' << row << ' ' << dof;
        }
      }
    }
  }
}

TEST(EndFrames, AreTheTipsOrTheLastBodiesThatMotorsMove) {
  const Folder folder;
  write(folder / "joints.xml", kJoints);
  write(folder / "arm.xml", kArm);
  const ModelFile joints({.path = folder / "joints.xml"});
  EXPECT_EQ(end_frames(joints), std::vector<std::string>{"tip"});  // the site, not its body
  EXPECT_EQ(end_frames(ModelFile({.path = folder / "arm.xml"})), std::vector<std::string>{"flap"});
  EXPECT_EQ(end_frames(RobotModel(RobotDescription{})), tip_names(RobotDescription{}));
}

TEST_F(FramesTest, NamesWhatIsThereAndWhatCannotMove) {
  const auto file = model(kJoints);
  const auto message = [&](const std::string& name) {
    return message_of<InvalidArgument>(
        [&] { return Frames(file, std::vector<std::string>{name}).size(); });
  };
  EXPECT_EQ(message("hand"),
            "the model has no frame 'hand'; its sites are corner, tip, nose, its bodies are rail, "
            "wrist, drone");
  EXPECT_EQ(message("corner"), "the frame 'corner' cannot move: no joint moves its body");
}

TEST_F(FramesTest, PosesAreFreeIfNothingTouchesThatDoesNotAlwaysTouch) {
  const auto file = model(kArm);
  // rail, shoulder, elbow, near, far, flap, ball, brick: both objects stand on the floor, a little
  // too deep.
  std::vector<double> usual{0, 0.5, 1, 0.2,  0.2, 0,     0.5, 0, 0.049, 1,
                            0, 0,   0, -0.5, 0,   0.049, 1,   0, 0,     0};
  const ContactCheck check(file, usual);
  EXPECT_TRUE(check.is_free(usual));
  std::vector<double> pose = usual;
  pose[0] = 0.7;  // along the rail
  EXPECT_TRUE(check.is_free(pose));
  pose[6] = 0.7;  // The ball is where the arm hangs.
  pose[8] = 0.8;
  const AllocationCounter allocations;
  EXPECT_FALSE(check.is_free(pose));
  for (int i = 0; i < 1000; ++i) EXPECT_TRUE(check.is_free(usual));
  EXPECT_EQ(allocations.count(), 0);
}

}  // namespace
}  // namespace trifinger::test
