// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/control/grasp_controller.hpp"

#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "random_grasps.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/control/trajectories.hpp"
#include "trifinger/model/robot_model.hpp"

namespace trifinger::control {
namespace {

constexpr Seconds kPeriod(1e-3);

// The controller in a loop with the physics. Its torques are one step old, and the safety layer
// damps.
class Bench {
 public:
  explicit Bench(const GraspControllerConfig& config = {})
      : robot_(description()),
        data_(mj_makeData(robot_.mujoco()), &mj_deleteData),
        controller_(description(), rigid_body(cube()), config) {
    mj_resetDataKeyframe(robot_.mujoco(), data_.get(), 0);
    place_cube(start_);
    torques_.setZero(kMaxJoints);
    desired_.pose = start_;
  }

  static RobotDescription description() {
    RobotDescription description;
    description.finger_height = 0.300;
    return description;
  }

  [[nodiscard]] Touches plan(double height) const {
    std::vector<Motion> trajectory(2, {.pose = start_});
    trajectory[1].pose.position.z() += height;
    return GraspPlanner(description()).plan(trajectory).value().touches;
  }

  void place_cube(const Pose& pose) const {
    const Eigen::Quaterniond& q = pose.orientation;
    Eigen::Map<Eigen::Vector<double, 7>>(data_->qpos + robot_.object("cube").position)
        << pose.position,
        q.w(), q.x(), q.y(), q.z();
  }

  [[nodiscard]] Motion cube_motion() const {
    const double* p = data_->qpos + robot_.object("cube").position;
    const double* v = data_->qvel + robot_.object("cube").velocity;
    Motion motion;
    motion.pose.position = Eigen::Vector3d::Map(p);
    motion.pose.orientation = Eigen::Quaterniond(p[3], p[4], p[5], p[6]);
    motion.twist.linear = Eigen::Vector3d::Map(v);
    motion.twist.angular = motion.pose.orientation * Eigen::Vector3d::Map(v + 3);
    return motion;
  }

  void step() {
    joints_ = {.position = Eigen::Map<const Eigen::VectorXd>(data_->qpos, kMaxJoints),
               .velocity = Eigen::Map<const Eigen::VectorXd>(data_->qvel, kMaxJoints),
               .torque = torques_};
    const VariantFigures& limits = figures(robot_.description());
    cube_ = cube_motion();
    torques_ = asked_ = controller_.update(kPeriod, joints_, cube_, desired_);
    for (int i = 0; i < kMaxJoints; ++i) {
      const double most = limits.actuator.torque_limit;
      const double damping = limits.safety_kd[static_cast<std::size_t>(i % kJointsPerFinger)];
      torques_[i] = std::clamp(std::clamp(torques_[i], -most, most) - damping * joints_.velocity[i],
                               -most, most);
    }
    Eigen::Map<Eigen::VectorXd>(data_->ctrl, kMaxJoints) = torques_;
    mj_step(robot_.mujoco(), data_.get());
  }

  // Runs until the phase is reached. Returns false if that takes more than ten seconds.
  [[nodiscard]] bool run_until(GraspPhase phase) {
    for (int i = 0; i < 10000 && this->phase() != phase; ++i) step();
    return this->phase() == phase;
  }

  void lead_to(const Pose& goal, Seconds duration) {
    const PoseTrajectory trajectory(desired_.pose, goal, duration);
    for (Seconds time{0}; time <= duration + kPeriod; time += kPeriod) {
      desired_ = trajectory.at(time);
      step();
    }
  }

  void run_for(Seconds duration) {
    for (Seconds time{0}; time < duration; time += kPeriod) step();
  }

  // Returns the tip forces that the torques of the last step make, in the frame of the cube: the
  // controller's last equation, solved for the forces. Only for a desired motion without
  // acceleration.
  [[nodiscard]] std::array<Eigen::Vector3d, kContacts> asked_forces() const {
    Kinematics kinematics(description());
    kinematics.update(joints_.position);
    const Eigen::MatrixXd jacobians = kinematics.tip_jacobians();
    const SafetyLimits limits = safety_limits(description());
    const Eigen::VectorXd acceleration =
        -jacobians.lu().solve(Eigen::VectorXd(kinematics.tip_accelerations(joints_.velocity)));
    const Eigen::VectorXd forces = jacobians.transpose().lu().solve(
        asked_ - kinematics.mass_matrix() * acceleration -
        kinematics.bias_torques(joints_.velocity) -
        joint_values(limits.safety_kd).cwiseProduct(joints_.velocity));
    std::array<Eigen::Vector3d, kContacts> in_cube;
    for (std::size_t k = 0; k < in_cube.size(); ++k)
      in_cube[k] = cube_.pose.orientation.conjugate() *
                   Eigen::Vector3d(forces.segment<3>(3 * static_cast<Eigen::Index>(k)));
    return in_cube;
  }

  // From now on the cube should rest at `pose`, however far away that is.
  void want(const Pose& pose) { desired_ = {.pose = pose}; }

  // Returns the normal force between each tip and the cube, from the physics.
  [[nodiscard]] Eigen::Vector3d normal_forces() const {
    Eigen::Vector3d forces = Eigen::Vector3d::Zero();
    for (int i = 0; i < data_->ncon; ++i) {
      for (int finger = 0; finger < kContacts; ++finger) {
        const int tip = robot_.tip_geoms()[static_cast<std::size_t>(finger)];
        const auto& geoms = data_->contact[i].geom;
        if (geoms[0] != tip && geoms[1] != tip) continue;
        std::array<mjtNum, 6> force{};
        mj_contactForce(robot_.mujoco(), data_.get(), i, force.data());
        forces[finger] += force[0];
      }
    }
    return forces;
  }

  [[nodiscard]] std::array<Eigen::Vector3d, kContacts> tips() const {
    std::array<Eigen::Vector3d, kContacts> tips;
    for (std::size_t k = 0; k < tips.size(); ++k)
      tips[k] = Eigen::Vector3d::Map(data_->site_xpos +
                                     static_cast<std::ptrdiff_t>(3 * robot_.tip_sites()[k]));
    return tips;
  }

  [[nodiscard]] GraspPhase phase() const { return controller_.state().phase; }
  [[nodiscard]] const GraspState& state() const { return controller_.state(); }
  [[nodiscard]] GraspController& controller() { return controller_; }
  [[nodiscard]] const Pose& start() const { return start_; }

 private:
  Pose start_{.position = {0.005, -0.005, test::kCubeHalfWidth}};
  RobotModel robot_;
  std::unique_ptr<mjData, decltype(&mj_deleteData)> data_;
  GraspController controller_;
  JointState joints_;
  Motion cube_;
  JointValues asked_;
  JointValues torques_;  // Torques after the safety checks.
  Motion desired_;
};

double distance(const Pose& a, const Pose& b) { return (a.position - b.position).norm(); }

TEST(GraspController, DoesNotTouchOnItsApproach) {
  Bench bench;
  bench.controller().grasp(bench.plan(0.05), bench.start());
  bench.step();
  const Pose before = bench.cube_motion().pose;
  ASSERT_TRUE(bench.run_until(GraspPhase::kClose));
  EXPECT_LT(distance(bench.cube_motion().pose, before), 1e-4);
  EXPECT_EQ(bench.normal_forces(), Eigen::Vector3d::Zero());
}

TEST(GraspController, ComesFromAboveAndFromTheSide) {
  Bench bench;
  const Touches touches = bench.plan(0.05);
  bench.controller().grasp(touches, bench.start());
  const double radius = figures(Bench::description()).tip_radius;
  Eigen::Vector3d to_above = Eigen::Vector3d::Constant(1.0);
  Eigen::Vector3d to_beside = to_above;
  bench.step();
  while (bench.phase() == GraspPhase::kApproach) {
    const auto tips = bench.tips();
    for (std::size_t k = 0; k < tips.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      const Approach approach = approach_to(touches[k], bench.start(), radius);
      to_above[i] = std::min(to_above[i], (tips[k] - approach.above).norm());
      to_beside[i] = std::min(to_beside[i], (tips[k] - approach.beside).norm());
    }
    bench.step();
  }
  EXPECT_EQ(bench.phase(), GraspPhase::kClose);
  EXPECT_LT(to_above.maxCoeff(), 3e-3);
  EXPECT_LT(to_beside.maxCoeff(), 3e-3);
}

TEST(GraspController, LiftsTurnsAndPutsBack) {
  Bench bench;
  bench.controller().grasp(bench.plan(0.05), bench.start());
  ASSERT_TRUE(bench.run_until(GraspPhase::kHold));
  Pose goal = bench.start();
  goal.position += Eigen::Vector3d(-0.01, 0.01, 0.05);
  goal.orientation = Eigen::AngleAxisd(0.15, Eigen::Vector3d::UnitZ()) * goal.orientation;
  bench.lead_to(goal, Seconds(1.5));
  bench.run_for(Seconds(2));
  EXPECT_EQ(bench.phase(), GraspPhase::kHold);
  const Pose held = bench.cube_motion().pose;
  EXPECT_LT(distance(held, goal), 2e-3);
  EXPECT_LT(rotation_error(goal.orientation, held.orientation).norm(), 0.05);

  bench.lead_to(bench.start(), Seconds(1.5));
  bench.controller().release();
  ASSERT_TRUE(bench.run_until(GraspPhase::kIdle));
  bench.run_for(Seconds(0.5));
  EXPECT_LT(distance(bench.cube_motion().pose, bench.start()), 4e-3);
  EXPECT_EQ(bench.normal_forces(), Eigen::Vector3d::Zero());
}

TEST(GraspController, FeelsWhatItsTipsPressWith) {
  Bench bench;
  bench.controller().grasp(bench.plan(0.05), bench.start());
  ASSERT_TRUE(bench.run_until(GraspPhase::kHold));
  bench.lead_to({bench.start().position + Eigen::Vector3d(0, 0, 0.04), bench.start().orientation},
                Seconds(1));
  bench.run_for(Seconds(1));
  const Eigen::Vector3d pressed = bench.normal_forces();
  EXPECT_GT(pressed.minCoeff(), 0.5);
  EXPECT_LT((bench.state().normal_forces - pressed).cwiseAbs().maxCoeff(), 0.05);
  EXPECT_EQ(bench.state().wanted.status, ForceStatus::kExact);
  // Together the tips carry the cube by friction.
  EXPECT_GT(bench.state().tangential_forces.sum(), cube().mass * 9.81 * 0.9);
}

// No tip may slip along its face, whatever motion of the cube is wanted.
TEST(GraspController, NeverPressesAcrossMoreThanItsShareOfWhatItPressesAlong) {
  test::Random random(3);
  for (const double slip_friction : {0.5, 0.55, 0.7}) {
    Bench bench({.slip_friction = slip_friction});
    const Touches touches = bench.plan(0.05);
    bench.controller().grasp(touches, bench.start());
    ASSERT_TRUE(bench.run_until(GraspPhase::kHold));
    bench.lead_to({bench.start().position + Eigen::Vector3d(0, 0, 0.02)}, Seconds(0.5));
    int cut_off = 0;
    for (int i = 0; i < 60; ++i) {
      // Want another pose for a step, so that the tips are pulled sideways. Then want the first one
      // again.
      const Pose place{bench.start().position + Eigen::Vector3d(0, 0, 0.02)};
      bench.want({place.position + random.numbers<3>(0.012),
                  rotation_from_vector(random.numbers<3>(0.2))});
      bench.step();
      ASSERT_EQ(bench.phase(), GraspPhase::kHold);
      const auto forces = bench.asked_forces();
      for (std::size_t k = 0; k < forces.size(); ++k) {
        const double along = forces[k].dot(touches[k].normal);
        const double across = (forces[k] - along * touches[k].normal).norm();
        EXPECT_GT(along, 0.0);
        EXPECT_LE(across, slip_friction * along * (1 + 1e-9));
        if (across > slip_friction * along * (1 - 1e-9)) ++cut_off;
      }
      bench.want(place);
      for (int rest = 0; rest < 20; ++rest) bench.step();
    }
    EXPECT_GT(cut_off, 30) << "the tips were hardly pulled across";
  }
}

TEST(GraspController, MakesUpForTheDampingThatItIsGiven) {
  const RigidBody body = rigid_body(cube());
  SafetyLimits limits = safety_limits({});
  test::Random random(4);
  const JointState joints{joint_values(std::array{0.0, 0.9, -1.7, 0.0, 0.9, -1.7, 0.0, 0.9, -1.7}),
                          random.numbers<9>(2.0), JointValues::Zero(9)};
  GraspController usual({}, body);
  const JointValues torques = usual.update(kPeriod, joints, {}, {});
  const JointValues more = random.numbers<9>(0.05).cwiseAbs();
  for (std::size_t i = 0; i < limits.safety_kd.size(); ++i) {
    limits.safety_kd[i] += more[static_cast<Eigen::Index>(i)];
    limits.max_torque[i] = 0.5;
  }
  GraspController damped({}, body, {.limits = limits});
  const JointValues change = damped.update(kPeriod, joints, {}, {}) - torques;
  EXPECT_LT((change - more.cwiseProduct(joints.velocity)).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_DOUBLE_EQ(damped.state().torque_share, (torques + change).cwiseAbs().maxCoeff() / 0.5);
}

TEST(GraspController, SaysThatThereIsNothingToGrasp) {
  Bench bench;
  const Touches touches = bench.plan(0.05);
  bench.place_cube({.position = {0.13, 0.13, test::kCubeHalfWidth}});
  bench.controller().grasp(touches, bench.start());
  ASSERT_TRUE(bench.run_until(GraspPhase::kLost));
  bench.controller().release();
  EXPECT_TRUE(bench.run_until(GraspPhase::kIdle));
}

TEST(GraspController, NoticesThatTheObjectIsGone) {
  Bench bench;
  bench.controller().grasp(bench.plan(0.05), bench.start());
  ASSERT_TRUE(bench.run_until(GraspPhase::kHold));
  bench.run_for(Seconds(0.5));
  bench.place_cube({.position = {0.13, 0.13, test::kCubeHalfWidth}});
  ASSERT_TRUE(bench.run_until(GraspPhase::kLost));
  bench.run_for(Seconds(0.2));
  EXPECT_LE(bench.state().torque_share, 1.0);
}

// The tips grasp an object again after it slipped away.
TEST(GraspController, GraspsAgain) {
  Bench bench;
  const Touches touches = bench.plan(0.05);
  bench.controller().grasp(touches, bench.start());
  ASSERT_TRUE(bench.run_until(GraspPhase::kHold));
  bench.controller().release();
  ASSERT_TRUE(bench.run_until(GraspPhase::kIdle));
  bench.place_cube(bench.start());
  bench.controller().grasp(touches, bench.start());
  EXPECT_TRUE(bench.run_until(GraspPhase::kHold));
}

TEST(GraspController, DoesNotAllocate) {
  Bench bench;
  bench.controller().grasp(bench.plan(0.05), bench.start());
  bench.step();
  const trifinger::test::AllocationCounter allocations;
  EXPECT_TRUE(bench.run_until(GraspPhase::kHold));
  bench.run_for(Seconds(0.1));
  bench.controller().release();
  EXPECT_TRUE(bench.run_until(GraspPhase::kIdle));
  EXPECT_EQ(allocations.count(), 0U);
}

TEST(GraspController, NeedsThreeFingersAndSoundFigures) {
  const RigidBody body = rigid_body(cube());
  EXPECT_THROW(GraspController({.arrangement = Arrangement::kSingleFinger}, body), InvalidArgument);
  EXPECT_THROW(GraspController({}, body, {.friction = 0.0}), InvalidArgument);
  EXPECT_THROW(GraspController({}, body, {.min_normal_force = 6.0}), InvalidArgument);
  EXPECT_THROW(GraspController({}, body, {.roll_time = Seconds(-1)}), InvalidArgument);
  SafetyLimits limits = safety_limits({});
  limits.safety_kd[0] = -0.1;
  EXPECT_THROW(GraspController({}, body, {.limits = limits}), InvalidArgument);
}

}  // namespace
}  // namespace trifinger::control
