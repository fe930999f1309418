// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <mujoco/mujoco.h>
#include <time.h>

#include <array>
#include <chrono>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "harness.hpp"
#include "support/allocation_counter.hpp"
#include "trifinger/control/force_optimizer.hpp"
#include "trifinger/control/impedance.hpp"
#include "trifinger/control/pose_estimator.hpp"
#include "trifinger/control/trajectories.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/model/robot_model.hpp"

namespace trifinger::benchmarks {
namespace {

using Clock = std::chrono::steady_clock;
using namespace control;

constexpr int kCycles = 3000;  // A lift of 3 s.
constexpr Seconds kPeriod{1e-3};

// Three tips lift a cube by 10 cm; its pose comes at 100 Hz.
class Controller {
 public:
  Controller() {
    torques_.limits.setConstant(actuator(kinematics_.description()).torque_limit);
    const double tip_radius = figures(kinematics_.description()).tip_radius;
    for (int finger = 0; finger < kContacts; ++finger) {
      const double azimuth = std::numbers::pi / 2 * (1 - finger);
      const Eigen::Vector3d out(std::cos(azimuth), std::sin(azimuth), 0);
      const auto i = static_cast<std::size_t>(finger);
      contacts_[i] = 0.0325 * out;
      tips_[i] = (0.0325 + tip_radius) * out;
    }
    positions_.reserve(kCycles);
    for (int i = 0; i < kCycles; ++i) {
      const Motion motion = lift_.at(i * kPeriod);
      JointValues position(kinematics_.num_joints());
      for (int finger = 0; finger < kContacts; ++finger) {
        const auto tip = point_of_body(motion, tips_[static_cast<std::size_t>(finger)]);
        position.segment<3>(3 * finger) =
            kinematics_.inverse_kinematics(finger, tip.position).position;
      }
      positions_.push_back(position);
    }
  }

  [[nodiscard]] const JointValues& position(int i) const {
    return positions_[static_cast<std::size_t>(i)];
  }

  // The torques of cycle `i`.
  JointValues cycle(int i) {
    const JointValues& position = positions_[static_cast<std::size_t>(i)];
    const JointValues& before = positions_[static_cast<std::size_t>(i == 0 ? 0 : i - 1)];
    const JointValues velocity = (position - before) / kPeriod.count();
    kinematics_.update(position);
    const JointMatrix jacobians = kinematics_.tip_jacobians();
    torques_.jacobians = jacobians;
    torques_.bias = kinematics_.bias_torques(velocity);

    const Seconds time = i * kPeriod;
    const Motion desired = lift_.at(time);
    if (i % 10 == 0) (void)estimator_.update(time, desired.pose, desired);
    const Motion object = estimator_.predict(time, desired);
    const Wrench wrench = object_impedance(desired, object.pose, object.twist, body_);

    Grasp grasp;
    for (std::size_t finger = 0; finger < grasp.size(); ++finger) {
      grasp[finger].position = point_of_body(object, contacts_[finger]).position;
      grasp[finger].normal = object.pose.orientation * -contacts_[finger];
      grasp[finger].min_normal_force = 0.9;
    }
    const ForceDistribution found = optimizer_.solve(grasp, object.pose.position, wrench, torques_);
    ++cycles_;
    exact_ += found ? 1 : 0;

    JointValues forces = found.forces;
    const JointValues tip_velocities = jacobians * velocity;
    for (int finger = 0; finger < kContacts; ++finger) {
      forces.segment<3>(3 * finger) +=
          tip_impedance(point_of_body(desired, tips_[static_cast<std::size_t>(finger)]),
                        kinematics_.tip_position(finger), tip_velocities.segment<3>(3 * finger));
    }
    return jacobians.transpose() * forces + torques_.bias;
  }

  [[nodiscard]] int cycles() const noexcept { return cycles_; }
  // Those whose wrench was the one wanted.
  [[nodiscard]] int exact() const noexcept { return exact_; }

 private:
  Kinematics kinematics_{RobotDescription{.finger_height = 0.3}};
  RigidBody body_{rigid_body(cube())};
  std::array<Eigen::Vector3d, kContacts> contacts_;  // In the frame of the cube.
  std::array<Eigen::Vector3d, kContacts> tips_;      // Likewise.
  PoseTrajectory lift_{Pose{.position = {0, 0, 0.0325}}, Pose{.position = {0, 0, 0.1325}},
                       kCycles * kPeriod};
  std::vector<JointValues> positions_;
  TorqueLimits torques_;
  PoseEstimator estimator_;
  ForceOptimizer optimizer_;
  int cycles_{0};
  int exact_{0};
};

// MuJoCo's part of it, as short as it can be written: kinematics and the Jacobians of the tips.
class Bare {
 public:
  double cycle(const JointValues& position) {
    const mjModel* model = model_.mujoco();
    Eigen::Map<Eigen::VectorXd>(data_->qpos, position.size()) = position;
    mj_kinematics(model, data_.get());
    mj_comPos(model, data_.get());
    for (const int site : model_.tip_sites())
      mj_jacSite(model, data_.get(), jacobian_.data(), nullptr, site);
    return jacobian_[0];
  }

 private:
  RobotModel model_{{.finger_height = 0.3, .boundary = false, .objects = {}}};
  std::unique_ptr<mjData, decltype(&mj_deleteData)> data_{mj_makeData(model_.mujoco()),
                                                          &mj_deleteData};
  std::array<double, 3 * kMaxJoints> jacobian_{};
};

double microseconds(Clock::duration time) {
  return std::chrono::duration<double, std::micro>(time).count();
}

// What this thread has had of its processor: others that were given it in between do not count.
double processor_microseconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e6 * static_cast<double>(time.tv_sec) + 1e-3 * static_cast<double>(time.tv_nsec);
}

}  // namespace

std::vector<Row> control_rows(const Effort& effort) {
  Controller controller;
  Bare bare;
  Samples slowest;
  std::size_t allocations = 0;
  double sum = 0;  // Looked at, so that no compiler leaves out what made it.
  const auto full = [&] {
    Samples times;
    Samples processor_times;
    for (int i = 0; i < kCycles; ++i) {
      const test::AllocationCounter counter;
      const double processor_begin = processor_microseconds();
      const auto begin = Clock::now();
      sum += controller.cycle(i)[0];
      const auto end = Clock::now();
      const double processor_end = processor_microseconds();
      allocations += counter.count();
      processor_times.add(processor_end - processor_begin);
      times.add(microseconds(end - begin));
    }
    slowest.add(processor_times.quantile(0.999));
    return times.median();
  };
  const auto kinematics_alone = [&] {
    Samples times;
    for (int i = 0; i < kCycles; ++i) {
      const auto begin = Clock::now();
      sum += bare.cycle(controller.position(i));
      times.add(microseconds(Clock::now() - begin));
    }
    return times.median();
  };
  const Paired paired = alternate(effort.rounds, full, kinematics_alone);
  Row row = make_row("control cycle, lifting a cube: p50", "us", paired,
                     "bare mj_kinematics, mj_comPos and mj_jacSite", "<= 15 us, 0 allocations",
                     paired.measure.median() <= 15.0 && allocations == 0 && std::isfinite(sum));
  row.remark = fmt::format("{} allocations, {} % of the wrenches exact", allocations,
                           100 * controller.exact() / controller.cycles());
  return {row, make_row("the same: p99.9, processor time", "us", slowest, "<= 40 us",
                        slowest.median() <= 40.0)};
}

}  // namespace trifinger::benchmarks
