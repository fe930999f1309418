// SPDX-License-Identifier: BSD-3-Clause
#include "model/export.hpp"

#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <Eigen/Core>
#include <clocale>
#include <memory>

#include "scenes.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/model/kinematics.hpp"

namespace trifinger {
namespace {

using test::label;

// MuJoCo writes six digits.
constexpr double kMjcfDigits = 2e-6;

struct Opened {
  SceneModel::Compiled model;
  std::unique_ptr<mjData, void (*)(mjData*)> data{nullptr, mj_deleteData};
};

Opened open(const std::string& text) {
  char error[500] = "";
  mjSpec* spec = mj_parseXMLString(text.c_str(), nullptr, error, sizeof(error));
  EXPECT_NE(spec, nullptr) << error;
  Opened opened;
  if (spec == nullptr) return opened;
  opened.model.reset(mj_compile(spec, nullptr));
  EXPECT_NE(opened.model, nullptr) << mjs_getError(spec);
  mj_deleteSpec(spec);
  if (opened.model) opened.data.reset(mj_makeData(opened.model.get()));
  return opened;
}

void set_joints(const Opened& opened, const RobotDescription& robot, const JointValues& position) {
  const std::vector<std::string> names = joint_names(robot);
  for (int i = 0; i < position.size(); ++i) {
    const int joint =
        mj_name2id(opened.model.get(), mjOBJ_JOINT, names[static_cast<std::size_t>(i)].c_str());
    ASSERT_GE(joint, 0) << names[static_cast<std::size_t>(i)];
    opened.data->qpos[opened.model->jnt_qposadr[joint]] = position[i];
  }
  mj_forward(opened.model.get(), opened.data.get());
}

JointValues some_pose(const RobotDescription& robot) {
  JointValues position(num_joints(robot));
  for (int i = 0; i < position.size(); ++i)
    position[i] =
        figures(robot).initial_position[static_cast<std::size_t>(i % 3)] + 0.07 * (i % 4) - 0.1;
  return position;
}

TEST(ExportMjcf, ReadsBackAsTheSameRobot) {
  for (const RobotDescription& robot : test::all_robots()) {
    SCOPED_TRACE(label(robot));
    const Opened opened = open(export_mjcf(robot));
    ASSERT_NE(opened.data, nullptr);
    const RobotModel model(robot, Detail::kPictures);
    EXPECT_EQ(opened.model->nq, model.mujoco()->nq);
    EXPECT_EQ(opened.model->nu, model.mujoco()->nu);
    EXPECT_EQ(opened.model->ngeom, model.mujoco()->ngeom);
    EXPECT_EQ(opened.model->ncam, model.mujoco()->ncam);
    EXPECT_EQ(opened.model->nkey, model.mujoco()->nkey);
    EXPECT_NEAR(mj_getTotalmass(opened.model.get()), mj_getTotalmass(model.mujoco()), 1e-5);
    // MuJoCo Warp refuses this flag, so files do not have it.
    EXPECT_EQ(opened.model->opt.disableflags & mjDSBL_AUTORESET, 0);
    EXPECT_EQ(opened.model->opt.disableflags | mjDSBL_AUTORESET, model.mujoco()->opt.disableflags);
    EXPECT_EQ(opened.model->opt.cone, model.mujoco()->opt.cone);
    EXPECT_EQ(opened.model->opt.integrator, model.mujoco()->opt.integrator);
    for (int geom = 0; geom < opened.model->ngeom; ++geom) {
      EXPECT_EQ(opened.model->geom_contype[geom], model.mujoco()->geom_contype[geom]);
      EXPECT_EQ(opened.model->geom_conaffinity[geom], model.mujoco()->geom_conaffinity[geom]);
    }

    Kinematics kinematics(robot);
    const JointValues position = some_pose(robot);
    kinematics.update(position);
    set_joints(opened, robot, position);
    const std::vector<std::string> tips = tip_names(robot);
    for (int finger = 0; finger < num_fingers(robot); ++finger) {
      const int site = mj_name2id(opened.model.get(), mjOBJ_SITE,
                                  tips[static_cast<std::size_t>(finger)].c_str());
      const Eigen::Vector3d tip = Eigen::Map<Eigen::Vector3d>(opened.data->site_xpos + 3 * site);
      EXPECT_LT((tip - kinematics.tip_position(finger)).norm(), kMjcfDigits);
    }
  }
}

TEST(ExportMjcf, CamerasLookWhereTheCalibrationSays) {
  const Opened opened = open(export_mjcf({}));
  ASSERT_NE(opened.data, nullptr);
  mj_forward(opened.model.get(), opened.data.get());
  for (const CameraFigures& camera : camera_figures()) {
    const int id = mj_name2id(opened.model.get(), mjOBJ_CAMERA, std::string(camera.name).c_str());
    ASSERT_GE(id, 0);
    const double* axes = opened.data->cam_xmat + 9 * id;
    for (std::size_t row = 0; row < 3; ++row) {
      EXPECT_NEAR(opened.data->cam_xpos[3 * static_cast<std::size_t>(id) + row],
                  camera.position[row], kMjcfDigits);
      EXPECT_NEAR(axes[3 * row], camera.rotation[3 * row], kMjcfDigits);
      EXPECT_NEAR(axes[3 * row + 1], -camera.rotation[3 * row + 1], kMjcfDigits);
      EXPECT_NEAR(axes[3 * row + 2], -camera.rotation[3 * row + 2], kMjcfDigits);
    }
    EXPECT_NEAR(opened.model->cam_fovy[id], 49.2, 0.2);
  }
}

TEST(ExportUrdf, ReadsBackWithTheSameTipsMassesAndGravityTorques) {
  for (RobotDescription robot : test::all_robots()) {
    SCOPED_TRACE(label(robot));
    robot.objects.clear();
    const Opened opened = open(export_urdf(robot));
    ASSERT_NE(opened.data, nullptr);
    Kinematics kinematics(robot);
    const JointValues position = some_pose(robot);
    kinematics.update(position);
    set_joints(opened, robot, position);
    EXPECT_EQ(opened.model->nq, num_joints(robot));
    EXPECT_NEAR(mj_getTotalmass(opened.model.get()), mj_getTotalmass(RobotModel(robot).mujoco()),
                1e-12);
    const std::vector<std::string> tips = tip_names(robot);
    for (int finger = 0; finger < num_fingers(robot); ++finger) {
      const int body = mj_name2id(opened.model.get(), mjOBJ_BODY,
                                  tips[static_cast<std::size_t>(finger)].c_str());
      ASSERT_GE(body, 0);
      const Eigen::Vector3d tip = Eigen::Map<Eigen::Vector3d>(opened.data->xpos + 3 * body);
      EXPECT_LT((tip - kinematics.tip_position(finger)).norm(), 1e-12);
    }
    const std::vector<std::string> names = joint_names(robot);
    const JointValues gravity = kinematics.gravity_torques();
    for (int i = 0; i < num_joints(robot); ++i) {
      const int joint =
          mj_name2id(opened.model.get(), mjOBJ_JOINT, names[static_cast<std::size_t>(i)].c_str());
      EXPECT_NEAR(opened.data->qfrc_bias[opened.model->jnt_dofadr[joint]], gravity[i], 1e-9);
    }
  }
}

TEST(ExportUrdf, LimitsPositionAndEffortByTheFigures) {
  for (const RobotDescription& robot : test::all_robots()) {
    const Opened opened = open(export_urdf(robot));
    ASSERT_NE(opened.data, nullptr);
    for (int i = 0; i < num_joints(robot); ++i) {
      const auto j = static_cast<std::size_t>(i % 3);
      const int joint = mj_name2id(opened.model.get(), mjOBJ_JOINT,
                                   joint_names(robot)[static_cast<std::size_t>(i)].c_str());
      EXPECT_DOUBLE_EQ(opened.model->jnt_range[2 * joint], figures(robot).hard_lower[j]);
      EXPECT_DOUBLE_EQ(opened.model->jnt_range[2 * joint + 1], figures(robot).hard_upper[j]);
      EXPECT_DOUBLE_EQ(opened.model->jnt_actfrcrange[2 * joint + 1], actuator(robot).torque_limit);
    }
  }
  EXPECT_NE(export_urdf({}).find("velocity=\"43.56"), std::string::npos);
}

TEST(ExportUrdf, HasTheCamerasAsFramesWithTheLookAlongZ) {
  const Opened opened = open(export_urdf({}));
  ASSERT_NE(opened.data, nullptr);
  mj_forward(opened.model.get(), opened.data.get());
  for (const CameraFigures& camera : camera_figures()) {
    const std::string frame = std::string(camera.name) + "_optical_frame";
    const int body = mj_name2id(opened.model.get(), mjOBJ_BODY, frame.c_str());
    ASSERT_GE(body, 0) << frame;
    for (std::size_t i = 0; i < 9; ++i)
      EXPECT_NEAR(opened.data->xmat[9 * static_cast<std::size_t>(body) + i], camera.rotation[i],
                  1e-9);
  }
  EXPECT_EQ(export_urdf({.cameras = false}).find("optical"), std::string::npos);
}

TEST(Exports, RefuseWhatCannotBeBuilt) {
  EXPECT_THROW((void)export_mjcf({.finger_height = 3}), InvalidArgument);
  EXPECT_THROW((void)export_urdf({.finger_height = 3}), InvalidArgument);
}

}  // namespace
}  // namespace trifinger
