// SPDX-License-Identifier: BSD-3-Clause
// D'Claw as it is shipped, against the figures of the published model.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "support/soak.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::test {
namespace {

using testing::ElementsAre;

constexpr std::size_t kJoints = 9;
constexpr double kPi = std::numbers::pi;
constexpr std::array kTips{"FFtip", "MFtip", "THtip"};

using Action = JointAction<kJoints>;
using Applied = AppliedJointAction<kJoints>;
using Finger3 = std::array<double, 3>;

struct Observation {
  JointVector<kJoints> position{};
  JointVector<kJoints> velocity{};
  JointVector<kJoints> torque{};
  JointVector<kJoints + 1> joint_position{};
  JointVector<kJoints + 1> joint_velocity{};
};

RobotConfig config(const std::vector<std::string>& overrides = {}) {
  return load_robot_config(TRIFINGER_CONFIG_DIR "/dclaw.yml", overrides);
}

class DClaw : public testing::Test {
 protected:
  [[nodiscard]] const mjModel& model() const { return *robot_.model().mujoco(); }
  [[nodiscard]] int id(mjtObj type, const std::string& name) const {
    const int id = mj_name2id(&model(), type, name.c_str());
    EXPECT_GE(id, 0) << name;
    return id;
  }
  // Sets the three angles of every finger.
  void pose(const Finger3& angles) {
    for (std::size_t i = 0; i < kJoints; ++i) {
      robot_.model().set_position(i, angles[i % angles.size()], *data_);
    }
    mj_forward(&model(), data_.get());
  }
  [[nodiscard]] Observation observe() {
    Observation observation;
    EXPECT_EQ(robot_.get_latest_observation(&observation).state, DriverReport::State::kReady);
    return observation;
  }
  Applied apply(const Action& action) {
    Applied applied;
    const DriverReport report = robot_.apply_action(&action, &applied);
    EXPECT_EQ(report.state, DriverReport::State::kReady) << robot_.fault_text(report.fault_code);
    return applied;
  }

  SimulatedRobot robot_{config().simulation};
  SceneModel::Data data_{robot_.model().make_data()};
};

TEST_F(DClaw, HasNineMotorsAndAValveThatNoneDrives) {
  std::vector<std::string> names;
  for (const DrivenJoint& joint : robot_.model().joints()) names.push_back(joint.name);
  EXPECT_THAT(names, ElementsAre("FFJ10", "FFJ11", "FFJ12", "MFJ20", "MFJ21", "MFJ22", "THJ30",
                                 "THJ31", "THJ32"));
  ASSERT_EQ(robot_.model().model_joints().size(), kJoints + 1);
  EXPECT_EQ(robot_.model().model_joints().back().name, "valve");
  EXPECT_EQ(robot_.options().file->period(), std::chrono::microseconds(2500));
  EXPECT_EQ(robot_.options().file->substeps(), 1);
  for (const DrivenJoint& joint : robot_.model().joints()) EXPECT_EQ(joint.kp, 2.0) << joint.name;
  for (const double angle : {0, 3, 6}) {
    EXPECT_EQ(robot_.initial_position()[static_cast<std::size_t>(angle)], 0.0);
    EXPECT_NEAR(robot_.initial_position()[static_cast<std::size_t>(angle) + 1], -kPi / 3, 1e-6);
    EXPECT_NEAR(robot_.initial_position()[static_cast<std::size_t>(angle) + 2], kPi / 3, 1e-6);
  }
}

TEST_F(DClaw, HasItsTipsWhereThePublishedModelHasThem) {
  struct Check {
    Finger3 angles;
    std::array<Finger3, 3> tips;
  };
  const std::array checks{
      Check{{0, 0, 0},
            {{{0.030000, 0.051636, 0.106167},
              {0.030000, -0.052364, 0.106333},
              {-0.060000, -0.000364, 0.106250}}}},
      Check{{0, -kPi / 3, kPi / 3},
            {{{0.059180, 0.102842, 0.140086},
              {0.060438, -0.102724, 0.140413},
              {-0.118890, -0.000357, 0.140250}}}},
      Check{{0.2, -0.5, 0.9},
            {{{-0.002537, 0.073685, 0.124387},
              {0.065088, -0.034661, 0.124559},
              {-0.062974, -0.039510, 0.124567}}}},
      Check{{0.3, 0.4, -0.6},
            {{{-0.028163, 0.071737, 0.122157},
              {0.075882, -0.011341, 0.122290},
              {-0.048570, -0.060798, 0.122368}}}},
      Check{{-0.45, 0.8, 0.3},
            {{{0.028695, -0.081633, 0.183399},
              {-0.085833, 0.013924, 0.183246},
              {0.056460, 0.064813, 0.183165}}}},
      Check{{0, -1.0, 1.5},
            {{{0.040298, 0.069753, 0.146702},
              {0.040742, -0.070092, 0.146925},
              {-0.080784, -0.000316, 0.146813}}}},
      Check{{0.48, 0, 1.0},
            {{{-0.072508, 0.036573, 0.161081},
              {0.066743, 0.044612, 0.161068},
              {0.004017, -0.081759, 0.161270}}}},
      Check{{0, 1.57, -1.57},
            {{{-0.003694, -0.007322, 0.174207},
              {-0.005147, 0.005956, 0.174186},
              {0.008000, -0.000202, 0.174196}}}},
  };
  for (const Check& check : checks) {
    pose(check.angles);
    for (std::size_t finger = 0; finger < kTips.size(); ++finger) {
      const double* tip = data_->site_xpos + 3 * id(mjOBJ_SITE, kTips[finger]);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        EXPECT_NEAR(tip[axis], check.tips[finger][axis], 1e-6)
            << kTips[finger] << ' ' << axis << " at " << testing::PrintToString(check.angles);
      }
    }
  }
}

TEST_F(DClaw, HasThePublishedMassesAndInertias) {
  struct Check {
    const char* body;
    double mass;
    Finger3 centre;
    Finger3 inertia;  // principal, the largest first
  };
  const std::array checks{
      Check{"claw", 0.110, {0, 0, 0}, {3.0938e-4, 1.5527e-4, 1.5527e-4}},
      Check{"FF_base", 0.093, {0.012, 0, 0.014}, {2.735e-5, 2.483e-5, 1.647e-5}},
      Check{"MFL1", 0.105, {0, 0, 0.05241}, {4.007e-5, 3.902e-5, 1.977e-5}},
      Check{"THL2", 0.105, {0, 0, 0.05241}, {4.181e-5, 3.727e-5, 1.977e-5}},
      Check{"FFL3", 0.032, {0, 0, 0.04044}, {1.619e-5, 1.350e-5, 5.27e-6}},
  };
  for (const Check& check : checks) {
    const int body = id(mjOBJ_BODY, check.body);
    EXPECT_NEAR(model().body_mass[body], check.mass, 1e-9) << check.body;
    Finger3 inertia{};
    std::copy_n(model().body_inertia + 3 * body, 3, inertia.begin());
    std::ranges::sort(inertia, std::greater());
    for (std::size_t axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(model().body_ipos[3 * body + static_cast<int>(axis)], check.centre[axis], 5e-6)
          << check.body;
      EXPECT_NEAR(inertia[axis], check.inertia[axis], 1e-8) << check.body;
    }
  }
  EXPECT_NEAR(model().body_subtreemass[id(mjOBJ_BODY, "claw")], 1.115, 1e-9);
}

TEST_F(DClaw, HasThePublishedJointsAndContacts) {
  for (const DrivenJoint& joint : robot_.model().joints()) {
    const int number = id(mjOBJ_JOINT, joint.name);
    const int dof = model().jnt_dofadr[number];
    EXPECT_EQ(model().dof_damping[dof], 0.1) << joint.name;
    EXPECT_EQ(model().dof_armature[dof], 0.001) << joint.name;
    EXPECT_EQ(model().dof_frictionloss[dof], 0.0) << joint.name;
    const bool is_top = joint.name.ends_with('0');
    EXPECT_THAT(*joint.range, is_top ? ElementsAre(-0.45, 1.35) : ElementsAre(-2.0, 2.0))
        << joint.name;
  }
  for (const char* const name : {"FFtip", "MFtip", "THtip", "valve_arm0", "valve_hub"}) {
    const int geom = id(mjOBJ_GEOM, name);
    EXPECT_EQ(model().geom_condim[geom], 4) << name;
    EXPECT_EQ(model().geom_margin[geom], 5e-4) << name;
    EXPECT_EQ(model().geom_friction[3 * geom], 0.2) << name;
    EXPECT_EQ(model().geom_friction[3 * geom + 1], 0.005) << name;
    EXPECT_EQ(model().geom_friction[3 * geom + 2], 1e-4) << name;
  }
  pose({0, 0, 0});
  for (const char* const name : {"valve_arm0", "valve_arm1", "valve_arm2"}) {
    const double* at = data_->geom_xpos + 3 * id(mjOBJ_GEOM, name);
    EXPECT_NEAR(at[2], 0.1021, 1e-6) << name;
    EXPECT_NEAR(std::hypot(at[0], at[1]), 0.0385, 1e-6) << name;
  }
  EXPECT_EQ(model().opt.cone, mjCONE_ELLIPTIC);
  EXPECT_EQ(model().opt.solver, mjSOL_NEWTON);
  EXPECT_EQ(model().opt.iterations, 50);
}

TEST_F(DClaw, NeedsThePublishedTorqueAgainstGravity) {
  pose({0, -kPi / 3, kPi / 3});
  for (std::size_t i = 0; i < kJoints; ++i) {
    const double torque = robot_.model().torque_of(i, data_->qfrc_bias);
    if (i % 3 == 1) {
      EXPECT_NEAR(torque, -0.0652, 2e-4) << i;
    } else {
      EXPECT_LT(std::abs(torque), 4e-4) << i;
    }
  }
  // Two fingers are turned by angles that are only nearly 60 degrees.
  EXPECT_LT(std::abs(robot_.model().torque_of(0, data_->qfrc_bias)), 2e-4);
}

TEST_F(DClaw, SagsAsPublished) {
  ASSERT_EQ(robot_.prepare(0).state, DriverReport::State::kReady);
  JointVector<kJoints> target{};
  std::ranges::copy(robot_.initial_position(), target.begin());
  for (int step = 0; step < 4000; ++step) {
    (void)observe();
    (void)apply(Action::of_position(target));
  }
  const Observation y = observe();
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_NEAR(y.position[i] - target[i], i % 3 == 1 ? 0.032 : 0.0, 5e-4) << i;
  }
}

TEST_F(DClaw, FollowsAStepAsPublished) {
  ASSERT_EQ(robot_.prepare(0).state, DriverReport::State::kReady);
  JointVector<kJoints> target{};
  std::ranges::copy(robot_.initial_position(), target.begin());
  target[0] += 0.3;
  constexpr int kSteps = 39;  // 97.5 ms
  for (int step = 0; step < kSteps; ++step) {
    (void)observe();
    (void)apply(Action::of_position(target));
  }
  EXPECT_NEAR(observe().position[0] / 0.3, 0.86, 0.025);
}

TEST_F(DClaw, TurnsItsValve) {
  ASSERT_EQ(robot_.prepare(0).state, DriverReport::State::kReady);
  EXPECT_EQ(observe().joint_position[kJoints], 0.0);
  // The fingers reach between the arms and push them to the same side.
  const auto move_to = [this](const Finger3& angles) {
    JointVector<kJoints> target{};
    for (std::size_t i = 0; i < kJoints; ++i) target[i] = angles[i % angles.size()];
    for (int step = 0; step < 400; ++step) {
      (void)observe();
      (void)apply(Action::of_position(target));
    }
  };
  move_to({0, 0, 0});
  EXPECT_NEAR(observe().joint_position[kJoints], 0.0, 1e-3);
  move_to({0.7, 0, 0});
  EXPECT_GT(std::abs(observe().joint_position[kJoints]), 0.1);
}

// Numbers like those of a hostile user.
TEST_F(DClaw, IsHeldByTheSafetyChainUnderHostileActions) {
  const std::int64_t steps = repetitions(100'000, 1'000'000);
  std::mt19937 random(1);
  int way = 0;
  ASSERT_EQ(robot_.prepare(0).state, DriverReport::State::kReady);
  JointVector<kJoints> least{};
  JointVector<kJoints> most{};
  for (std::int64_t step = 0; step < steps; ++step) {
    if (random() % 100 == 0) way = static_cast<int>(random() % 4);
    Action action;
    for (std::size_t i = 0; i < kJoints; ++i) {
      switch (way) {
        case 0:
          action.torque[i] = random() % 2 == 0 ? 1e9 : -1e9;
          break;
        case 1:
          action.torque[i] = i % 2 == 0 ? 1e9 : -1e9;
          break;
        case 2:
          action.torque[i] = std::uniform_real_distribution(-10.0, 10.0)(random);
          action.position[i] = std::numeric_limits<double>::quiet_NaN();
          action.position_kp[i] = std::uniform_real_distribution(-1.0, 10.0)(random);
          break;
        default:
          action.position[i] = std::uniform_real_distribution(-4.0, 4.0)(random);
      }
    }
    const Observation y = observe();
    for (std::size_t i = 0; i < kJoints; ++i) {
      least[i] = std::min(least[i], y.position[i]);
      most[i] = std::max(most[i], y.position[i]);
    }
    const Applied applied = apply(action);
    for (std::size_t i = 0; i < kJoints; ++i) {
      ASSERT_LE(std::abs(applied.torque[i]), robot_.limits()[i].max_torque);
    }
    if (testing::Test::HasFailure()) FAIL() << "in step " << step;
  }
  RecordProperty("least", testing::PrintToString(least));
  RecordProperty("most", testing::PrintToString(most));
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_GT(least[i], robot_.limits()[i].hard_lower) << i;
    EXPECT_LT(most[i], robot_.limits()[i].hard_upper) << i;
  }
}

}  // namespace
}  // namespace trifinger::test
