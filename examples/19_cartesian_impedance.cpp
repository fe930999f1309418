// SPDX-License-Identifier: BSD-3-Clause
// An arm from a file moves its flange on a circle, as if it hung on a spring. A push moves it away,
// and it comes back.
//
// The transposed Jacobian turns the wrench of the spring into joint torques. The arm has a joint
// more than the flange needs: torques of the null space keep its elbow, and do not move the flange.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <numbers>
#include <string>
#include <vector>

#include "trifinger/control/impedance.hpp"
#include "trifinger/model/model_kinematics.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulation.hpp"

namespace {

// The arm comes from a file (panda.yml). C++ needs to know the number of its joints.
struct Arm : trifinger::JointRobot<7> {
  static constexpr std::string_view kType = "panda";
};
using Joints = Eigen::Vector<double, 7>;

constexpr double kRadius = 0.05;  // [m]
constexpr double kTurn = 4.0;     // time of one turn [s]
constexpr trifinger::control::ObjectGains kSpring{
    .stiffness = 4000, .damping = 150, .rotational_stiffness = 100, .rotational_damping = 6};
constexpr int kSteps = 12000, kPush = 9000, kLetGo = 9500;

// Where the flange should be at time t [s]: a circle that grows in its first turn.
trifinger::control::Motion desired(double t, const Eigen::Isometry3d& begin) {
  const double share = std::min(t / kTurn, 1.0);
  const double growth = share < 1.0 ? kRadius / kTurn : 0.0;
  const double rate = 2 * std::numbers::pi / kTurn;
  const Eigen::Vector3d ahead(std::cos(rate * t), std::sin(rate * t), 0);
  const Eigen::Vector3d aside(-ahead.y(), ahead.x(), 0);
  trifinger::control::Motion motion;
  motion.pose.position = begin.translation() + share * kRadius * ahead;
  motion.pose.orientation = Eigen::Quaterniond(begin.linear());
  motion.twist.linear = share * kRadius * rate * aside + growth * ahead;
  return motion;
}

double largest(const std::vector<double>& errors, int first, int last) {
  return *std::max_element(errors.begin() + first, errors.begin() + last);
}

}  // namespace

int main() {
  const auto config = std::filesystem::path(__FILE__).parent_path() / "panda.yml";
  const auto options = trifinger::load_robot_config(config.string()).simulation;
  const trifinger::Simulation simulation(options);
  auto robot = simulation.connect<Arm>();
  const std::vector<std::string> frames{"flange"};
  trifinger::ModelKinematics arm(trifinger::make_model(options), frames);
  const Eigen::Isometry3d begin = arm.pose(0);
  const Eigen::VectorXd home = arm.position();

  auto y = robot.latest_observation();
  std::vector<double> errors;
  for (int i = 0; i < kSteps; ++i) {
    const Joints position = Joints::Map(y.position.data());
    const Joints velocity = Joints::Map(y.velocity.data());
    arm.update(position);
    const Eigen::Isometry3d flange = arm.pose(0);
    if (i == kPush) {
      const Eigen::Vector3d there = flange.translation() + Eigen::Vector3d(0, 0, 0.3);
      simulation.robot().pull("flange",
                              {.target = {there.x(), there.y(), there.z()}, .stiffness = 5000});
    }
    if (i == kLetGo) simulation.robot().let_go();
    const trifinger::ModelKinematics::Jacobian& jacobian = arm.jacobian(0);
    const Eigen::Vector<double, 6> twist = jacobian * velocity;
    const trifinger::control::Motion motion = desired(1e-3 * i, begin);
    const auto [force, moment] = trifinger::control::object_impedance(
        motion, {flange.translation(), Eigen::Quaterniond(flange.linear())},
        {twist.head<3>(), twist.tail<3>()}, {}, kSpring);
    Arm::Action action;
    Joints::Map(action.torque.data()) =
        jacobian.topRows<3>().transpose() * force + jacobian.bottomRows<3>().transpose() * moment +
        arm.bias_torques(velocity) +
        arm.null_space_torques(0, 20 * (home - position) - 4 * velocity);
    y = robot.get_observation(robot.append_desired_action(action));
    errors.push_back((motion.pose.position - flange.translation()).norm());
  }

  double squares = 0;
  for (int i = 4000; i < kPush; ++i) squares += std::pow(errors[static_cast<std::size_t>(i)], 2);
  const double rms = std::sqrt(squares / (kPush - 4000));
  const double pushed = largest(errors, kPush, kLetGo + 200);
  const double back = largest(errors, kSteps - 1000, kSteps);
  std::cout << std::fixed << std::setprecision(2) << "on the circle within " << 1e3 * rms
            << " mm (rms); a push of 20 N moved it by " << 1e3 * pushed << " mm; back within "
            << 1e3 * back << " mm\n";
  return rms < 1e-3 && pushed > 3e-3 && back < 1.5e-3 ? EXIT_SUCCESS : EXIT_FAILURE;
}
