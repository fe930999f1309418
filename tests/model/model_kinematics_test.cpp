// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/model/model_kinematics.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "file_robots.hpp"
#include "support/allocation_counter.hpp"
#include "support/folder.hpp"
#include "support/message_of.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/random.hpp"
#include "trifinger/model/model_file.hpp"
#include "trifinger/model/robot_model.hpp"

namespace trifinger::test {
namespace {

using testing::HasSubstr;

// A gripper: a finger follows the other one, a third follows that, and a spring pulls.
constexpr const char* kGripper = R"(<mujoco model="gripper">
  <compiler angle="radian"/>
  <worldbody>
    <body name="palm" pos="0 0 0.5">
      <joint name="lift" type="slide" axis="0 0 1" range="-0.2 0.2"/><geom size="0.05"/>
      <body name="left" pos="0.05 0 0">
        <joint name="left" axis="0 1 0" range="-1 1" ref="0.1" stiffness="0.3" armature="0.01"/>
        <geom type="capsule" fromto="0 0 0 0.02 0 0.1" size="0.01"/>
      </body>
      <body name="right" pos="-0.05 0 0">
        <joint name="right" axis="0 1 0" ref="-0.2"/>
        <geom type="capsule" fromto="0 0 0 0 0.03 0.1" size="0.01"/>
        <body name="end" pos="0 0 0.1" euler="0.2 0.1 0">
          <joint name="end" axis="0 1 0"/><geom size="0.02" pos="0.01 0 0.02"/>
          <site name="pad" pos="0.02 0.01 0.03" euler="0.5 -0.3 0.2"/>
        </body>
      </body>
    </body>
  </worldbody>
  <equality>
    <joint joint1="end" joint2="right" polycoef="0.05 -0.5 0 0 0"/>
    <joint joint1="right" joint2="left" polycoef="0.1 -1.5 0 0 0"/>
  </equality>
</mujoco>
)";

// Six hinges, in lengths like those of an arm on a table.
constexpr const char* kSixHinges = R"(<mujoco model="six">
  <compiler angle="radian"/>
  <default><geom type="capsule" size="0.03"/><joint range="-2.9 2.9"/></default>
  <worldbody>
    <body name="1" pos="0 0 0.16"><joint name="1" axis="0 0 1"/><geom size="0.05" fromto="0 0 -0.1 0 0 0"/>
    <body name="2" pos="0 0.138 0"><joint name="2" axis="0 1 0" range="-3 1"/><geom fromto="0 0 0 0 0 0.425"/>
    <body name="3" pos="0 -0.131 0.425"><joint name="3" axis="0 1 0" range="-2.8 2.8"/><geom fromto="0 0 0 0 0 0.392"/>
    <body name="4" pos="0 0 0.392"><joint name="4" axis="0 1 0"/><geom fromto="0 0 0 0 0.1 0"/>
    <body name="5" pos="0 0.127 0"><joint name="5" axis="0 0 1"/><geom fromto="0 0 0 0 0 0.08"/>
    <body name="6" pos="0 0 0.1"><joint name="6" axis="0 1 0"/><geom fromto="0 0 0 0 0.05 0"/>
      <site name="tool0" pos="0 0.1 0" euler="-1.5708 0 0"/>
    </body></body></body></body></body></body>
  </worldbody>
</mujoco>
)";

class ModelKinematicsTest : public testing::Test {
 protected:
  [[nodiscard]] std::shared_ptr<const ModelFile> model(const char* text) const {
    write(folder_ / "robot.xml", text);
    return std::make_shared<const ModelFile>(ModelFileOptions{.path = folder_ / "robot.xml"});
  }

  static Eigen::VectorXd draw(const ModelKinematics& kinematics, Random& random) {
    Eigen::VectorXd position(kinematics.num_joints());
    for (Eigen::Index i = 0; i < position.size(); ++i) {
      const auto& [lower, upper] = kinematics.ranges()[static_cast<std::size_t>(i)];
      position[i] = random.uniform(std::max(lower, -1.0), std::min(upper, 1.0));
    }
    return position;
  }

  Folder folder_;
};

// What MuJoCo says of a pose of the driven joints.
class Judge {
 public:
  explicit Judge(std::shared_ptr<const SceneModel> model)
      : model_(std::move(model)), data_(model_->make_data()) {
    model_->reset(*data_);
    std::fill_n(data_->qvel, mujoco().nv, 0.0);
  }

  [[nodiscard]] const mjModel& mujoco() const { return *model_->mujoco(); }
  [[nodiscard]] mjData& data() { return *data_; }

  void pose(const Eigen::VectorXd& position) {
    for (Eigen::Index i = 0; i < position.size(); ++i) {
      model_->set_position(static_cast<std::size_t>(i), position[i], *data_);
    }
    mj_fwdPosition(&mujoco(), data_.get());
  }

  [[nodiscard]] Eigen::Isometry3d site(const std::string& name) {
    const int id = mj_name2id(&mujoco(), mjOBJ_SITE, name.c_str());
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = Eigen::Map<const Eigen::Vector3d>(data_->site_xpos + 3 * id);
    pose.linear() =
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(data_->site_xmat + 9 * id);
    return pose;
  }

  // Moves the driven joints, and those that follow them, with these velocities.
  void move(const Eigen::VectorXd& position, const Eigen::VectorXd& velocity) {
    constexpr double kStep = 1e-6;
    pose(position - kStep * velocity);
    const std::vector<double> before(data_->qpos, data_->qpos + mujoco().nq);
    pose(position + kStep * velocity);
    mj_differentiatePos(&mujoco(), data_->qvel, 2 * kStep, before.data(), data_->qpos);
    pose(position);
    mj_fwdVelocity(&mujoco(), data_.get());
  }

  [[nodiscard]] double kinetic_energy() {
    mj_energyVel(&mujoco(), data_.get());
    return data_->energy[1];
  }

  [[nodiscard]] double potential_energy() {
    mj_energyPos(&mujoco(), data_.get());
    return data_->energy[0];
  }

 private:
  std::shared_ptr<const SceneModel> model_;
  SceneModel::Data data_;
};

TEST_F(ModelKinematicsTest, FollowersGoWhereTheirEqualitySays) {
  const auto file = model(kGripper);
  ASSERT_EQ(file->joint_names(), (std::vector<std::string>{"lift", "left"}));
  Judge judge(file);
  judge.pose(Eigen::Vector2d(0.1, 0.5));
  const auto at = [&](const char* name) {
    return judge.data().qpos[mj_name2id(&judge.mujoco(), mjOBJ_JOINT, name)];
  };
  EXPECT_NEAR(at("right"), -0.2 + 0.1 - 1.5 * (0.5 - 0.1), 1e-12);
  EXPECT_NEAR(at("end"), 0.05 - 0.5 * (at("right") + 0.2), 1e-12);
  mj_fwdPosition(&judge.mujoco(), &judge.data());
  for (int i = 0; i < judge.data().ne; ++i) EXPECT_NEAR(judge.data().efc_pos[i], 0.0, 1e-12);
}

struct Robot {
  const char* text;
  const char* site;
};

TEST_F(ModelKinematicsTest, PosesVelocitiesAndTorquesAreThoseOfMujoco) {
  Random random{.seed = 3};
  for (const auto& [text, site] : {Robot{kGripper, "pad"}, Robot{kSixHinges, "tool0"}}) {
    const auto file = model(text);
    const std::vector<std::string> names{site};
    ModelKinematics kinematics(file, names);
    Judge judge(file);
    for (int pose = 0; pose < 50; ++pose) {
      const Eigen::VectorXd position = draw(kinematics, random);
      const auto joints = position.size();
      Eigen::VectorXd velocity(joints);
      for (double& number : velocity) number = random.uniform(-1.0, 1.0);
      kinematics.update(position);
      judge.pose(position);
      const Eigen::Isometry3d seen = kinematics.pose(0);
      EXPECT_TRUE(seen.isApprox(judge.site(site), 1e-12));
      const ModelKinematics::Jacobian jacobian = kinematics.jacobian(0);
      const Eigen::VectorXd weight = kinematics.gravity_torques();
      const Eigen::MatrixXd mass = kinematics.mass_matrix();
      for (Eigen::Index i = 0; i < joints; ++i) {
        constexpr double kStep = 1e-5;
        Eigen::VectorXd moved = position;
        moved[i] += kStep;
        judge.pose(moved);
        const Eigen::Isometry3d after = judge.site(site);
        const double energy = judge.potential_energy();
        moved[i] -= 2 * kStep;
        judge.pose(moved);
        const Eigen::Isometry3d before = judge.site(site);
        EXPECT_NEAR(weight[i], (energy - judge.potential_energy()) / (2 * kStep), 1e-6);
        const Eigen::Vector3d linear = (after.translation() - before.translation()) / (2 * kStep);
        const Eigen::AngleAxisd turn(after.linear() * before.linear().transpose());
        EXPECT_LT((jacobian.col(i).head<3>() - linear).norm(), 1e-8);
        EXPECT_LT((jacobian.col(i).tail<3>() - turn.angle() / (2 * kStep) * turn.axis()).norm(),
                  1e-6);
      }
      // A motion has the energy that MuJoCo says, and needs the torques that change it.
      judge.move(position, velocity);
      EXPECT_NEAR(0.5 * velocity.dot(mass * velocity), judge.kinetic_energy(), 1e-8);
    }
  }
}

TEST_F(ModelKinematicsTest, TorquesOfAChainAreThoseOfMujoco) {
  const auto file = model(kSixHinges);
  ModelKinematics kinematics(file);
  Judge judge(file);
  Random random{.seed = 4};
  for (int pose = 0; pose < 50; ++pose) {
    const Eigen::VectorXd position = draw(kinematics, random);
    const Eigen::VectorXd velocity = draw(kinematics, random);
    judge.move(position, velocity);
    std::fill_n(judge.data().qacc, judge.mujoco().nv, 0.0);
    mj_rne(&judge.mujoco(), &judge.data(), 0, judge.data().qfrc_inverse);
    kinematics.update(position);
    const Eigen::Map<const Eigen::VectorXd> expected(judge.data().qfrc_inverse, 6);
    EXPECT_LT((kinematics.bias_torques(velocity) - expected).norm(), 1e-9);
    // The power of what has no acceleration only lifts weight.
    const Eigen::VectorXd bias = kinematics.bias_torques(velocity);
    judge.move(position, Eigen::VectorXd::Zero(6));
    mj_rne(&judge.mujoco(), &judge.data(), 0, judge.data().qfrc_inverse);
    EXPECT_LT((kinematics.gravity_torques() - expected).norm(), 1e-9);
    EXPECT_GT((bias - kinematics.gravity_torques()).norm(), 0.0);
  }
}

TEST_F(ModelKinematicsTest, TorquesOfTheNullSpaceDoNotMoveTheFrame) {
  ModelKinematics kinematics(std::make_shared<const RobotModel>(RobotDescription{}));
  Random random{.seed = 6};
  for (int pose = 0; pose < 20; ++pose) {
    const Eigen::VectorXd position = draw(kinematics, random);
    const Eigen::VectorXd torques = draw(kinematics, random);
    kinematics.update(position);
    const Eigen::VectorXd free = kinematics.null_space_torques(0, torques);
    const Eigen::VectorXd acceleration = kinematics.mass_matrix().ldlt().solve(free);
    EXPECT_LT((kinematics.jacobian(0) * acceleration).norm(), 1e-4);
    // The other fingers are not concerned.
    EXPECT_LT((free - torques).tail<6>().norm(), 1e-6);
    // What is free stays as it is.
    EXPECT_LT((kinematics.null_space_torques(0, free) - free).norm(), 1e-4);
  }
}

TEST_F(ModelKinematicsTest, AllocateNothingInALoop) {
  const auto file = model(kGripper);
  const std::vector<std::string> names{"pad"};
  ModelKinematics kinematics(file, names);
  const Eigen::VectorXd position = Eigen::Vector2d(0.1, 0.3);
  const AllocationCounter allocations;
  double sum = 0.0;
  for (int i = 0; i < 3; ++i) {
    kinematics.update(position);
    sum += kinematics.pose(0).translation().z() + kinematics.jacobian(0)(0, 1);
    sum += kinematics.gravity_torques()[0] + kinematics.bias_torques(position)[1];
    sum += kinematics.mass_matrix()(0, 0) + kinematics.null_space_torques(0, position)[0];
  }
  EXPECT_EQ(allocations.count(), 0);
  EXPECT_TRUE(std::isfinite(sum));
}

TEST_F(ModelKinematicsTest, InverseKinematicsFindsPosesThatThereAre) {
  const auto file = model(kSixHinges);
  const std::vector<std::string> names{"tool0"};
  ModelKinematics kinematics(file, names);
  Judge judge(file);
  Random random{.seed = 5};
  constexpr int kCount = 200;
  int reached = 0;
  const Eigen::VectorXd near = Eigen::VectorXd::Zero(6);
  for (int i = 0; i < kCount; ++i) {
    Eigen::VectorXd there(6);
    for (Eigen::Index joint = 0; joint < 6; ++joint) {
      const auto& [lower, upper] = kinematics.ranges()[static_cast<std::size_t>(joint)];
      there[joint] = random.uniform(lower, upper);
    }
    judge.pose(there);
    const Eigen::Isometry3d goal = judge.site("tool0");
    const JointSolution found = kinematics.inverse_kinematics(
        0, goal.translation(), Eigen::Quaterniond(goal.linear()), near);
    for (Eigen::Index joint = 0; joint < 6; ++joint) {
      const auto& [lower, upper] = kinematics.ranges()[static_cast<std::size_t>(joint)];
      EXPECT_GE(found.position[joint], lower);
      EXPECT_LE(found.position[joint], upper);
    }
    judge.pose(found.position);
    const Eigen::Isometry3d is = judge.site("tool0");
    const bool is_there =
        (is.translation() - goal.translation()).norm() <= 1e-6 &&
        Eigen::AngleAxisd(is.linear().transpose() * goal.linear()).angle() <= 2e-6;
    EXPECT_EQ(found.is_reached, is_there);
    reached += is_there ? 1 : 0;
  }
  EXPECT_GE(reached, kCount * 99 / 100);
}

TEST_F(ModelKinematicsTest, InverseKinematicsComesAsNearAsItCan) {
  const auto file = model(kSixHinges);
  const std::vector<std::string> names{"tool0"};
  ModelKinematics kinematics(file, names);
  const Eigen::VectorXd near = Eigen::VectorXd::Constant(6, 0.1);
  kinematics.update(near);
  const Eigen::Vector3d before = kinematics.pose(0).translation();
  const JointSolution found =
      kinematics.inverse_kinematics(0, {3.0, 0.0, 0.16}, std::nullopt, near);
  EXPECT_FALSE(found.is_reached);
  EXPECT_TRUE(found.position.allFinite());
  kinematics.update(found.position);
  // All is stretched towards it.
  EXPECT_NEAR(found.distance,
              (Eigen::Vector3d(3.0, 0.0, 0.16) - kinematics.pose(0).translation()).norm(), 1e-9);
  EXPECT_GT(kinematics.pose(0).translation().x(), 0.85);
  // A point alone is reached by whatever orientation, and the pose of before is kept.
  kinematics.update(near);
  EXPECT_TRUE(kinematics.inverse_kinematics(0, {0.4, 0.2, 0.3}, std::nullopt, near).is_reached);
  EXPECT_TRUE(kinematics.pose(0).translation().isApprox(before, 1e-15));
}

TEST_F(ModelKinematicsTest, JointsThatDoNotMoveAFrameStay) {
  const auto robot = std::make_shared<const RobotModel>(RobotDescription{});
  ModelKinematics kinematics(robot);
  ASSERT_EQ(kinematics.frames(), tip_names(RobotDescription{}));
  kinematics.update(Eigen::VectorXd::Constant(9, 0.2));
  const Eigen::Vector3d goal = kinematics.pose(1).translation();
  const Eigen::VectorXd near = Eigen::VectorXd::LinSpaced(9, 0.3, 0.5);
  const JointSolution found = kinematics.inverse_kinematics(1, goal, std::nullopt, near);
  EXPECT_TRUE(found.is_reached);
  EXPECT_EQ(found.position.head<3>(), near.head<3>());
  EXPECT_EQ(found.position.tail<3>(), near.tail<3>());
}

TEST_F(ModelKinematicsTest, SayWhatIsWrong) {
  ModelKinematics kinematics(model(kSixHinges));
  const auto message = [&](const Eigen::VectorXd& near) {
    return message_of<InvalidArgument>(
        [&] { (void)kinematics.inverse_kinematics(0, {0, 0, 0}, std::nullopt, near); });
  };
  EXPECT_THAT(message(Eigen::VectorXd::Zero(5)), HasSubstr("6 finite positions"));
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message(Eigen::VectorXd::Constant(6, kNan)), HasSubstr("6 finite positions"));
  EXPECT_THAT(message_of<InvalidArgument>([&] { (void)kinematics.frame("hand"); }),
              HasSubstr("there is no frame 'hand'"));
}

}  // namespace
}  // namespace trifinger::test
