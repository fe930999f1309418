// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/model/kinematics.hpp"

#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <random>
#include <span>
#include <thread>
#include <utility>

#include "check_values.hpp"
#include "scenes.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/base/random.hpp"
#include "trifinger/model/robot_model.hpp"

namespace trifinger {
namespace {

using test::JacobianCheck;
using test::label;
using test::MixedCheck;
using test::TipCheck;

// The figures are printed to six decimals.
constexpr double kPrinted = 1e-9 + 0.5e-6;

struct Checks {
  Variant variant;
  std::span<const TipCheck> tips;
  const MixedCheck& mixed;
  std::span<const JacobianCheck> jacobians;
};

const Checks kChecks[] = {
    {Variant::kEdu, test::kEduTips, test::kEduMixed, test::kEduJacobians},
    {Variant::kPro, test::kProTips, test::kProMixed, test::kProJacobians},
    {Variant::kOne, test::kOneTips, test::kOneMixed, test::kOneJacobians},
};

JointValues repeated(const std::array<double, 3>& finger, int fingers) {
  return Eigen::Map<const Eigen::Vector3d>(finger.data()).replicate(fingers, 1);
}

void expect_near(const Eigen::Vector3d& actual, const std::array<double, 3>& expected,
                 double tolerance) {
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(actual[i], expected[static_cast<std::size_t>(i)], tolerance);
}

class RandomPoses {
 public:
  explicit RandomPoses(const RobotDescription& description) : figures_(figures(description)) {}

  // Returns every joint at a random place within its hard limits.
  JointValues next(int fingers) {
    JointValues position(3 * fingers);
    for (int i = 0; i < position.size(); ++i) {
      const auto j = static_cast<std::size_t>(i % 3);
      position[i] = std::uniform_real_distribution(figures_.hard_lower[j],
                                                   figures_.hard_upper[j])(generator_);
    }
    return position;
  }

 private:
  const VariantFigures& figures_;
  std::mt19937_64 generator_{1};
};

TEST(KinematicsDeathTest, fault_82_ThatWasMovedFromEndsTheProgramWithASentence) {
  Kinematics moved{RobotDescription{}};
  const Kinematics kinematics(std::move(moved));
  // NOLINTNEXTLINE(bugprone-use-after-move): this is what the test is about
  EXPECT_DEATH(static_cast<void>(moved.tip_positions()), "use the object that it was moved to");
}

TEST(TipPositions, AreThoseOfThePublishedDescriptionsForThreeFingers) {
  for (const Checks& checks : kChecks) {
    Kinematics kinematics({.variant = checks.variant});
    for (const TipCheck& check : checks.tips) {
      kinematics.update(repeated(check.position, 3));
      for (int finger = 0; finger < 3; ++finger) {
        SCOPED_TRACE(label(kinematics.description()));
        expect_near(kinematics.tip_position(finger),
                    check.tri_tips[static_cast<std::size_t>(finger)], kPrinted);
      }
    }
  }
}

TEST(TipPositions, AreThoseOfThePublishedDescriptionsForASingleFinger) {
  for (const Checks& checks : kChecks) {
    Kinematics kinematics({.variant = checks.variant, .arrangement = Arrangement::kSingleFinger});
    for (const TipCheck& check : checks.tips) {
      SCOPED_TRACE(label(kinematics.description()));
      kinematics.update(repeated(check.position, 1));
      expect_near(kinematics.tip_position(0), check.single_tip, kPrinted);
    }
  }
}

TEST(TipPositions, DependOnTheirOwnFingersJointsInTheOrderOfTheJointVector) {
  for (const Checks& checks : kChecks) {
    Kinematics kinematics({.variant = checks.variant});
    kinematics.update(Eigen::Map<const Eigen::Matrix<double, 9, 1>>(checks.mixed.position.data()));
    const TipPositions tips = kinematics.tip_positions();
    for (int finger = 0; finger < 3; ++finger) {
      SCOPED_TRACE(label(kinematics.description()));
      expect_near(tips.segment<3>(3 * finger), checks.mixed.tips[static_cast<std::size_t>(finger)],
                  kPrinted);
    }
  }
}

TEST(TipPositions, RiseWithTheFingers) {
  for (const Variant variant : test::kVariants) {
    const Kinematics standard({.variant = variant});
    const Kinematics raised(
        {.variant = variant, .finger_height = variant_figures(variant).finger_height + 0.017});
    const TipPositions difference = raised.tip_positions() - standard.tip_positions();
    for (int finger = 0; finger < 3; ++finger)
      expect_near(difference.segment<3>(3 * finger), {0, 0, 0.017}, 1e-12);
  }
}

TEST(TipPositions, TurnUpsideDownWithThePlatform) {
  for (const Variant variant : test::kVariants) {
    const RobotDescription turned{.variant = variant, .flipped = true};
    const TipPositions upright = Kinematics({.variant = variant}).tip_positions();
    const TipPositions flipped = Kinematics(turned).tip_positions();
    for (int finger = 0; finger < 3; ++finger) {
      const Eigen::Vector3d tip = upright.segment<3>(3 * finger);
      expect_near(flipped.segment<3>(3 * finger),
                  {-tip.x(), tip.y(), flip_height(turned) - tip.z()}, 1e-12);
    }
  }
}

TEST(TipPositions, OfAGivenPoseAreThoseThatAnUpdateFinds) {
  Random random{.seed = 1};
  for (const RobotDescription& description : test::all_robots()) {
    SCOPED_TRACE(test::label(description));
    Kinematics kinematics(description);
    for (int i = 0; i < 20; ++i) {
      JointValues position(kinematics.num_joints());
      for (double& value : position) value = random.uniform(-3.0, 3.0);
      const TipPositions given = kinematics.tip_positions(position);
      kinematics.update(position);
      EXPECT_LT((given - kinematics.tip_positions()).cwiseAbs().maxCoeff(), 1e-12);
    }
  }
}

TEST(FingerAzimuth, IsWhereTheStretchedFingerPoints) {
  for (const RobotDescription& description : test::all_robots()) {
    SCOPED_TRACE(test::label(description));
    const Kinematics kinematics(description);
    // When joint 1 lifts the finger, it points away from its base, on either side.
    const double sign = description.variant == Variant::kOne ? -1.0 : 1.0;
    for (int finger = 0; finger < kinematics.num_fingers(); ++finger) {
      JointValues hanging = JointValues::Zero(kinematics.num_joints());
      JointValues lifted = hanging;
      lifted[kJointsPerFinger * finger + 1] = sign * 0.5;
      const Eigen::Vector3d way =
          (kinematics.tip_positions(lifted) - kinematics.tip_positions(hanging))
              .segment<3>(3 * finger);
      const double azimuth = kinematics.finger_azimuth(finger);
      EXPECT_NEAR(std::atan2(way.y(), way.x()), std::remainder(azimuth, 2 * std::numbers::pi),
                  1e-9);
    }
  }
}

TEST(TipJacobians, AreThoseOfThePublishedDescriptions) {
  for (const Checks& checks : kChecks) {
    for (const JacobianCheck& check : checks.jacobians) {
      Kinematics tri({.variant = checks.variant});
      Kinematics single({.variant = checks.variant, .arrangement = Arrangement::kSingleFinger});
      tri.update(repeated(check.position, 3));
      single.update(repeated(check.position, 1));
      const TipJacobian finger0 = tri.tip_jacobian(0);
      const TipJacobian finger120 = tri.tip_jacobian(1);
      const TipJacobian alone = single.tip_jacobian(0);
      for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column) {
          SCOPED_TRACE(label(tri.description()));
          const std::size_t at =
              static_cast<std::size_t>(row) * 3 + static_cast<std::size_t>(column);
          EXPECT_NEAR(finger0(row, column), check.finger0[at], kPrinted);
          EXPECT_NEAR(finger120(row, 3 + column), check.finger120[at], kPrinted);
          EXPECT_NEAR(alone(row, column), check.single[at], kPrinted);
        }
      }
    }
  }
}

TEST(TipJacobians, AreTheDerivativesOfTheTipPositions) {
  constexpr double kStep = 1e-5;
  for (const RobotDescription& robot : test::all_robots()) {
    Kinematics kinematics(robot);
    RandomPoses poses(robot);
    for (int sample = 0; sample < 50; ++sample) {
      const JointValues position = poses.next(kinematics.num_fingers());
      for (int finger = 0; finger < kinematics.num_fingers(); ++finger) {
        kinematics.update(position);
        const TipJacobian jacobian = kinematics.tip_jacobian(finger);
        for (int joint = 0; joint < kinematics.num_joints(); ++joint) {
          JointValues moved = position;
          moved[joint] += kStep;
          kinematics.update(moved);
          const Eigen::Vector3d after = kinematics.tip_position(finger);
          moved[joint] -= 2 * kStep;
          kinematics.update(moved);
          const Eigen::Vector3d before = kinematics.tip_position(finger);
          EXPECT_LT((jacobian.col(joint) - (after - before) / (2 * kStep)).norm(), 1e-9)
              << label(robot);
        }
      }
    }
  }
}

TEST(TipJacobians, TellHowTheTipsTurn) {
  for (const RobotDescription& robot : test::all_robots()) {
    Kinematics kinematics(robot);
    RandomPoses poses(robot);
    for (int sample = 0; sample < 50; ++sample) {
      kinematics.update(poses.next(kinematics.num_fingers()));
      for (int finger = 0; finger < kinematics.num_fingers(); ++finger) {
        const TipJacobian turning = kinematics.tip_rotation_jacobian(finger);
        const TipJacobian moving = kinematics.tip_jacobian(finger);
        for (int joint = 0; joint < kinematics.num_joints(); ++joint) {
          const bool is_own = joint / kJointsPerFinger == finger;
          // A joint turns a tip about its own axis, which has length 1 and is across the motion.
          EXPECT_NEAR(turning.col(joint).norm(), is_own ? 1 : 0, 1e-12) << label(robot);
          EXPECT_NEAR(turning.col(joint).dot(moving.col(joint)), 0, 1e-12) << label(robot);
        }
      }
    }
  }
}

TEST(TipJacobians, LieBelowEachOtherInOneMatrix) {
  for (const RobotDescription& robot : test::all_robots()) {
    const Kinematics kinematics(robot);
    const JointMatrix all = kinematics.tip_jacobians();
    ASSERT_EQ(all.rows(), 3 * kinematics.num_fingers());
    for (int finger = 0; finger < kinematics.num_fingers(); ++finger)
      EXPECT_EQ(all.middleRows<3>(3 * finger), kinematics.tip_jacobian(finger));
  }
}

struct DynamicsCheck {
  RobotDescription robot;
  std::array<double, 3> hold_at_pose, hold_at_zero;
  std::array<double, 3> position;
  std::array<double, 6> mass;  // 00 01 02 11 12 22
};

const DynamicsCheck kDynamics[] = {
    {{.variant = Variant::kOne},
     {-0.054936, -0.133095, -0.026742},
     {-0.054936, 0, 0},
     {0, -0.9, -1.7},
     {1.972122e-3, 3.509305e-4, 0, 2.809658e-3, -4.866625e-4, 5.65e-4}},
    {{.variant = Variant::kOne, .arrangement = Arrangement::kSingleFinger},
     {-0.054936, -0.131231, -0.006474},
     {-0.054936, 0, 0},
     {0, -0.9, -1.7},
     {1.170971e-3, 3.509305e-4, 0, 2.006502e-3, -8.493409e-5, 1.039e-4}},
    {{.variant = Variant::kEdu},
     {0.072124, 0.109728, -0.030488},
     {0.072124, 0, 0},
     {0, 0.9, -1.7},
     {2.178030e-3, 3.845569e-4, -1.867188e-4, 2.819678e-3, 5.300305e-4, 6.193414e-4}},
    {{.variant = Variant::kPro},
     {-0.218749, 0.234337, -0.026142},
     {-0.218749, -0.000337, -0.000006},
     {0, 0.9, -1.7},
     {3.957752e-3, -1.469125e-3, 2.198430e-4, 4.920565e-3, 3.551826e-4, 4.318493e-4}},
};

TEST(GravityTorques, AreThoseOfThePublishedInertias) {
  for (const DynamicsCheck& check : kDynamics) {
    SCOPED_TRACE(label(check.robot));
    Kinematics kinematics(check.robot);
    kinematics.update(repeated(check.position, kinematics.num_fingers()));
    expect_near(kinematics.gravity_torques().head<3>(), check.hold_at_pose, kPrinted);
    kinematics.update(repeated({0, 0, 0}, kinematics.num_fingers()));
    expect_near(kinematics.gravity_torques().head<3>(), check.hold_at_zero, kPrinted);
  }
}

TEST(GravityTorques, AreOppositeWhenThePlatformIsFlipped) {
  for (const Variant variant : test::kVariants) {
    const JointValues upright = Kinematics({.variant = variant}).gravity_torques();
    const JointValues flipped = Kinematics({.variant = variant, .flipped = true}).gravity_torques();
    EXPECT_LT((upright + flipped).norm(), 1e-12);
  }
}

TEST(MassMatrix, IsThatOfThePublishedInertias) {
  for (const DynamicsCheck& check : kDynamics) {
    SCOPED_TRACE(label(check.robot));
    RobotDescription robot = check.robot;
    robot.actuator = actuator(robot);
    robot.actuator->rotor_inertia = 0;  // The published figures have no rotor inertia.
    Kinematics kinematics(robot);
    kinematics.update(repeated(check.position, kinematics.num_fingers()));
    JointMatrix mass = kinematics.mass_matrix();
    if (robot.variant == Variant::kEdu) {
      // Our lower link is not infinitely thin: it has 2e-6 about its own axis. Joint 0 feels this
      // part of it.
      const double lean = std::sin(check.position[1] + check.position[2]);
      mass(0, 0) -= 2e-6 * lean * lean;
    }
    // The figures are printed to seven digits.
    const auto expect = [&](int row, int column, double printed) {
      EXPECT_NEAR(mass(row, column), printed, 0.5e-6 * std::abs(printed) + 1e-9);
    };
    expect(0, 0, check.mass[0]);
    expect(0, 1, check.mass[1]);
    expect(0, 2, check.mass[2]);
    expect(1, 1, check.mass[3]);
    expect(1, 2, check.mass[4]);
    expect(2, 2, check.mass[5]);
  }
}

TEST(MassMatrix, IsSymmetricPositiveAndCarriesTheRotorsOnItsDiagonal) {
  for (const RobotDescription& robot : test::all_robots()) {
    RobotDescription bare = robot;
    bare.actuator = actuator(robot);
    bare.actuator->rotor_inertia = 0;
    Kinematics kinematics(robot);
    Kinematics without_rotors(bare);
    RandomPoses poses(robot);
    const double rotor = reflected_inertia(actuator(robot));
    for (int sample = 0; sample < 50; ++sample) {
      const JointValues position = poses.next(kinematics.num_fingers());
      kinematics.update(position);
      without_rotors.update(position);
      const JointMatrix mass = kinematics.mass_matrix();
      const JointMatrix links = without_rotors.mass_matrix();
      EXPECT_LT((mass - mass.transpose()).norm(), 1e-15);
      EXPECT_LT((mass - links - rotor * JointMatrix::Identity(mass.rows(), mass.cols())).norm(),
                1e-12);
      EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(links).eigenvalues()[0], 0);
    }
  }
}

// Potential energy of all bodies [J], from the centres of mass in MuJoCo.
class PotentialEnergy {
 public:
  explicit PotentialEnergy(const RobotDescription& robot)
      : model_(robot), data_(mj_makeData(model_.mujoco()), mj_deleteData) {}

  double operator()(const JointValues& position) {
    const mjModel* model = model_.mujoco();
    Eigen::Map<Eigen::VectorXd>(data_->qpos, position.size()) = position;
    mj_kinematics(model, data_.get());
    double energy = 0;
    for (int body = 1; body < model->nbody; ++body)
      energy -= model->body_mass[body] * model->opt.gravity[2] * data_->xipos[3 * body + 2];
    return energy;
  }

 private:
  RobotModel model_;
  std::unique_ptr<mjData, decltype(&mj_deleteData)> data_;
};

TEST(GravityTorques, AreTheDerivativesOfThePotentialEnergy) {
  constexpr double kStep = 1e-5;
  for (RobotDescription robot : test::all_robots()) {
    robot.objects.clear();
    Kinematics kinematics(robot);
    PotentialEnergy energy(robot);
    RandomPoses poses(robot);
    for (int sample = 0; sample < 50; ++sample) {
      const JointValues position = poses.next(kinematics.num_fingers());
      kinematics.update(position);
      const JointValues torques = kinematics.gravity_torques();
      for (int joint = 0; joint < kinematics.num_joints(); ++joint) {
        JointValues before = position;
        JointValues after = position;
        before[joint] -= kStep;
        after[joint] += kStep;
        EXPECT_NEAR(torques[joint], (energy(after) - energy(before)) / (2 * kStep), 1e-8)
            << label(robot);
      }
    }
  }
}

TEST(BiasTorques, AreThoseOfLagrangesEquations) {
  constexpr double kStep = 1e-5;
  std::mt19937_64 generator(3);
  std::uniform_real_distribution<double> speed(-5, 5);
  for (const RobotDescription& robot : test::all_robots()) {
    Kinematics kinematics(robot);
    RandomPoses poses(robot);
    const int joints = kinematics.num_joints();
    for (int sample = 0; sample < 30; ++sample) {
      const JointValues position = poses.next(kinematics.num_fingers());
      const JointValues velocity =
          JointValues::NullaryExpr(joints, [&](Eigen::Index) { return speed(generator); });
      const auto mass_at = [&](const JointValues& pose) {
        kinematics.update(pose);
        return kinematics.mass_matrix();
      };
      // d/dt (M v) at constant v, minus the derivative of the kinetic energy with respect to the
      // pose.
      JointValues expected =
          (mass_at(position + kStep * velocity) - mass_at(position - kStep * velocity)) /
          (2 * kStep) * velocity;
      for (int joint = 0; joint < joints; ++joint) {
        JointValues before = position;
        JointValues after = position;
        before[joint] -= kStep;
        after[joint] += kStep;
        expected[joint] -=
            velocity.dot((mass_at(after) - mass_at(before)) * velocity) / (4 * kStep);
      }
      kinematics.update(position);
      expected += kinematics.gravity_torques();
      EXPECT_LT((kinematics.bias_torques(velocity) - expected).norm(), 1e-8) << label(robot);
    }
  }
}

TEST(TipAccelerations, AreTheChangeOfTheVelocitiesOfTips) {
  constexpr double kStep = 1e-5;
  std::mt19937_64 generator(5);
  std::uniform_real_distribution<double> speed(-5, 5);
  for (const RobotDescription& robot : test::all_robots()) {
    Kinematics kinematics(robot);
    RandomPoses poses(robot);
    for (int sample = 0; sample < 30; ++sample) {
      const JointValues position = poses.next(kinematics.num_fingers());
      const JointValues velocity = JointValues::NullaryExpr(
          kinematics.num_joints(), [&](Eigen::Index) { return speed(generator); });
      const auto tip_velocity_at = [&](const JointValues& pose) {
        kinematics.update(pose);
        return JointValues(kinematics.tip_jacobians() * velocity);
      };
      const JointValues expected = (tip_velocity_at(position + kStep * velocity) -
                                    tip_velocity_at(position - kStep * velocity)) /
                                   (2 * kStep);
      kinematics.update(position);
      EXPECT_LT((kinematics.tip_accelerations(velocity) - expected).norm(), 1e-7) << label(robot);
    }
  }
}

TEST(BiasTorques, KeepTheEnergyOfAFreeMotion) {
  constexpr double kStep = 1e-4;
  for (RobotDescription robot : test::all_robots()) {
    robot.objects.clear();
    Kinematics kinematics(robot);
    PotentialEnergy potential(robot);
    const auto acceleration = [&](const JointValues& position, const JointValues& velocity) {
      kinematics.update(position);
      return JointValues(-kinematics.mass_matrix().llt().solve(kinematics.bias_torques(velocity)));
    };
    const auto energy = [&](const JointValues& position, const JointValues& velocity) {
      kinematics.update(position);
      return velocity.dot(kinematics.mass_matrix() * velocity) / 2 + potential(position);
    };
    JointValues position = repeated({0.2, 0.5, -1.2}, kinematics.num_fingers());
    JointValues velocity = repeated({2, -1, 3}, kinematics.num_fingers());
    const double before = energy(position, velocity);
    for (int i = 0; i < 1000; ++i) {  // Fourth-order Runge-Kutta method.
      const JointValues a1 = acceleration(position, velocity);
      const JointValues v2 = velocity + kStep / 2 * a1;
      const JointValues a2 = acceleration(position + kStep / 2 * velocity, v2);
      const JointValues v3 = velocity + kStep / 2 * a2;
      const JointValues a3 = acceleration(position + kStep / 2 * v2, v3);
      const JointValues v4 = velocity + kStep * a3;
      const JointValues a4 = acceleration(position + kStep * v3, v4);
      position += kStep / 6 * (velocity + 2 * v2 + 2 * v3 + v4);
      velocity += kStep / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    }
    EXPECT_NEAR(energy(position, velocity), before, 1e-9) << label(robot);
  }
}

TEST(InverseKinematics, FindsThePoseThatItIsNear) {
  for (const RobotDescription& robot : test::all_robots()) {
    Kinematics kinematics(robot);
    RandomPoses poses(robot);
    for (int sample = 0; sample < 300; ++sample) {
      const JointValues position = poses.next(kinematics.num_fingers());
      kinematics.update(position);
      const TipPositions tips = kinematics.tip_positions();
      for (int finger = 0; finger < kinematics.num_fingers(); ++finger) {
        const Eigen::Vector3d wanted = position.segment<3>(3 * finger);
        const FingerPose found =
            kinematics.inverse_kinematics(finger, tips.segment<3>(3 * finger), wanted);
        ASSERT_EQ(found.reach, Reach::kYes) << label(robot) << ' ' << wanted.transpose();
        // Near a stretched finger, a rounding error of the tip becomes its square root in the knee.
        EXPECT_LT((found.position - wanted).norm(), 1e-6)
            << label(robot) << ' ' << wanted.transpose();
      }
    }
  }
}

TEST(InverseKinematics, BringsTheTipToEveryPointThatItCallsReachable) {
  for (const RobotDescription& robot : test::all_robots()) {
    Kinematics kinematics(robot);
    std::mt19937_64 generator(2);
    std::uniform_real_distribution<double> aside(-0.3, 0.3);
    std::uniform_real_distribution<double> up(0, 0.6);
    int reached = 0;
    for (int sample = 0; sample < 1000; ++sample) {
      const Eigen::Vector3d tip(aside(generator), aside(generator), up(generator));
      const int finger = sample % kinematics.num_fingers();
      const FingerPose found = kinematics.inverse_kinematics(finger, tip);
      for (int joint = 0; joint < 3; ++joint) {
        const auto j = static_cast<std::size_t>(joint);
        EXPECT_GE(found.position[joint], figures(robot).hard_lower[j] - 1e-12);
        EXPECT_LE(found.position[joint], figures(robot).hard_upper[j] + 1e-12);
      }
      JointValues position = found.position.replicate(kinematics.num_fingers(), 1);
      kinematics.update(position);
      const double error = (kinematics.tip_position(finger) - tip).norm();
      if (found) {
        ++reached;
        EXPECT_LT(error, 1e-7) << label(robot);
      } else {
        EXPECT_GT(error, 1e-7) << label(robot) << ": reached what it called out of reach";
      }
    }
    EXPECT_GT(reached, 100) << label(robot);
  }
}

TEST(InverseKinematics, SaysWhyAPointIsOutOfReach) {
  Kinematics kinematics;
  EXPECT_EQ(kinematics.inverse_kinematics(0, {0, 1, 0.1}).reach, Reach::kTooFar);
  // The point lies on the joint-0 axis: the tip of an Edu finger is always 59 mm away from it.
  EXPECT_EQ(kinematics.inverse_kinematics(0, {0, 0.1, 0.283}).reach, Reach::kTooClose);
  // The point lies above the finger base.
  EXPECT_EQ(kinematics.inverse_kinematics(0, {0, 0.05, 0.55}).reach, Reach::kOutsideLimits);
}

TEST(InverseKinematics, StretchesTowardsAPointThatIsTooFar) {
  Kinematics kinematics;
  const FingerPose found = kinematics.inverse_kinematics(0, {-0.05945, 0.0455 + 0.3, 0.0});
  EXPECT_EQ(found.reach, Reach::kTooFar);
  EXPECT_NEAR(found.position[2], 0, 1e-9);
  EXPECT_NEAR(found.position[1], std::atan2(0.3, 0.283), 1e-9);
}

TEST(InverseKinematics, AnswersNonsenseWithTheInitialPose) {
  Kinematics kinematics;
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity(), 1e300}) {
    const FingerPose found = kinematics.inverse_kinematics(1, {bad, 0, 0.1});
    EXPECT_FALSE(found);
    EXPECT_TRUE(found.position.allFinite());
  }
}

TEST(Kinematics, DoesNotAllocateOnceItExists) {
  for (const RobotDescription& robot : test::all_robots()) {
    Kinematics kinematics(robot);
    const JointValues position = JointValues::Constant(kinematics.num_joints(), 0.3);
    const test::AllocationCounter allocations;
    kinematics.update(position);
    (void)kinematics.tip_positions();
    (void)kinematics.tip_jacobian(0);
    (void)kinematics.tip_jacobians();
    (void)kinematics.tip_rotation_jacobian(0);
    (void)kinematics.gravity_torques();
    (void)kinematics.bias_torques(position);
    (void)kinematics.mass_matrix();
    (void)kinematics.inverse_kinematics(0, {0.02, 0.03, 0.05});
    EXPECT_EQ(allocations.count(), 0U) << label(robot);
  }
}

}  // namespace
}  // namespace trifinger
