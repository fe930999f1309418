// SPDX-License-Identifier: BSD-3-Clause
// The self-test and the homing of a TriFingerEdu on emulated boards, with the simulation as what
// they move: fingers that fall, swing, and lie on the table and on each other.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <memory>
#include <numeric>
#include <optional>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "boards/board_robot.hpp"
#include "boards/emulator.hpp"
#include "sim/boards_config.hpp"
#include "sim/on_boards.hpp"
#include "sim/simulated_plant.hpp"
#include "support/soak.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger {
namespace {

using namespace std::chrono_literals;
using State = DriverReport::State;

constexpr std::size_t kJoints = TriFinger::kJoints;

// The simulated robot, with cables that may lead to wrong motors.
class Fingers final : public boards::Plant {
 public:
  explicit Fingers(SimulationOptions options) : plant_(std::move(options)) {
    std::iota(joint_of_motor.begin(), joint_of_motor.end(), 0U);
    sign_of_motor.fill(1.0);
  }
  [[nodiscard]] std::span<const double> position() const noexcept override {
    return plant_.position();
  }
  [[nodiscard]] std::span<const double> velocity() const noexcept override {
    return plant_.velocity();
  }
  [[nodiscard]] std::span<const double> tip_force() const noexcept override {
    return plant_.tip_force();
  }
  void step(std::span<const double> torque) noexcept override {
    JointVector<kJoints> at_joints{};
    for (std::size_t i = 0; i < kJoints; ++i) {
      at_joints[joint_of_motor[i]] += sign_of_motor[i] * torque[i];
    }
    plant_.step(at_joints);
  }
  [[nodiscard]] bool has_diverged() const noexcept { return plant_.has_diverged(); }

  std::array<std::size_t, kJoints> joint_of_motor{};
  JointVector<kJoints> sign_of_motor{};

 private:
  SimulatedPlant plant_;
};

RobotConfig config_of_tests() {
  // Without any friction, fingers that were let go fling about until they hook into each other.
  return load_robot_config(TRIFINGER_CONFIG_DIR "/trifinger_edu_emulated.yml",
                           {"joints.friction=0.01"});
}

// Where the fingers are, and for how long they fall before the motors are switched on [ms].
struct Start {
  JointVector<kJoints> pose{};
  int fall{0};
};

// The pose is the initial one, changed by at most `spread` [rad].
Start any_start(std::mt19937& random, double spread) {
  const boards::BoardRobotOptions options = config_of_tests().boards->options;
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Start start;
  std::ranges::copy(options.initial_position, start.pose.begin());
  for (std::size_t i = 0; i < kJoints; ++i) {
    const JointLimit& limit = options.limits[i];
    start.pose[i] =
        std::clamp(start.pose[i] + spread * uniform(random), limit.soft_lower, limit.soft_upper);
  }
  start.fall = static_cast<int>(1000.0 * (1.0 + uniform(random)));
  return start;
}

struct Robot : test::OnBoards {
  Robot(const Start& start_from, bool self_test, const JointVector<kJoints>& home_correction = {}) {
    const RobotConfig config = config_of_tests();
    auto simulation = config.simulation;
    boards::BoardRobotOptions options = config.boards->options;
    simulation.initial_position.emplace(start_from.pose.begin(), start_from.pose.end());
    plant.emplace(simulation);
    switch_on(options, *plant);
    for (int i = 0; i < start_from.fall; ++i) pass();
    options.self_test = self_test;
    for (std::size_t i = 0; i < kJoints; ++i) {
      options.motors[i].homing.home_position += home_correction[i];
    }
    start(options);
  }

  std::optional<Fingers> plant;
};

// How far the measured angles are from the true ones.
JointVector<kJoints> errors_of(Robot& robot) {
  robot.pass();
  TriFinger::Observation observation;
  EXPECT_EQ(robot.driver->get_latest_observation(&observation).state, State::kReady);
  const auto truth = robot.plant->position();
  JointVector<kJoints> errors{};
  for (std::size_t i = 0; i < kJoints; ++i) errors[i] = observation.position[i] - truth[i];
  return errors;
}

// The calibration: one homing tells where the homes are.
JointVector<kJoints> calibrated() {
  std::mt19937 random(1);
  Robot robot(any_start(random, 0.0), false);
  EXPECT_EQ(robot.prepare().state, State::kReady);
  JointVector<kJoints> correction = errors_of(robot);
  for (double& error : correction) error = -error;
  return correction;
}

// A finger whose lower link leans on the table or on the wall does not move when it is pushed.
TEST(EmulatedRobot, TakesNeitherTableNorWallForEndStops) {
  const JointVector<kJoints> correction = calibrated();
  for (const JointVector<kJoints>& pose :
       {JointVector<kJoints>{-0.278, -0.096, 0.924, -0.214, 0.293, -1.073, -0.181, 0.393, -1.122},
        JointVector<kJoints>{-0.65, 0.78, -1.62, -0.06, 0.92, 1.55, -0.07, 0.95, -1.4}}) {
    Robot robot({.pose = pose}, false, correction);
    const DriverReport report = robot.prepare();
    ASSERT_EQ(report.state, State::kReady) << robot.driver->fault_text(report.fault_code);
    for (const double error : errors_of(robot)) EXPECT_NEAR(error, 0.0, 0.005);
  }
}

TEST(EmulatedRobot, HomesFromAnyPoseWithAndWithoutItsTest) {
  const JointVector<kJoints> correction = calibrated();
  for (trifinger::test::Rounds rounds(2, 10min); rounds.next();) {
    SCOPED_TRACE(rounds.index());
    std::mt19937 random(static_cast<unsigned>(rounds.index()));
    Robot robot(any_start(random, 0.3), rounds.index() % 2 == 0, correction);
    const DriverReport report = robot.prepare();
    ASSERT_EQ(report.state, State::kReady) << robot.driver->fault_text(report.fault_code);
    for (const double error : errors_of(robot)) EXPECT_NEAR(error, 0.0, 0.005);
  }
}

TEST(EmulatedRobot, fault_50_FindsExchangedAndReversedMotorsInAnyPose) {
  for (trifinger::test::Rounds rounds(3, 10min); rounds.next();) {
    SCOPED_TRACE(rounds.index());
    std::mt19937 random(static_cast<unsigned>(rounds.index()));
    Robot robot(any_start(random, 0.3), true);
    std::uniform_int_distribution<std::size_t> any_joint(0, kJoints - 1);
    const std::size_t one = any_joint(random);
    std::size_t other = any_joint(random);
    const bool is_exchanged = rounds.index() % 2 == 0;
    if (is_exchanged) {
      while (other == one) other = any_joint(random);
      std::swap(robot.plant->joint_of_motor[one], robot.plant->joint_of_motor[other]);
    } else {
      robot.plant->sign_of_motor[one] = -1.0;
    }
    const DriverReport report = robot.prepare();
    ASSERT_EQ(report.state, State::kFault);
    const std::optional<boards::WiringFinding> found = robot.driver->report(one).wiring;
    ASSERT_TRUE(found.has_value()) << robot.driver->fault_text(report.fault_code);
    EXPECT_FALSE(found->is_good(one)) << robot.driver->fault_text(report.fault_code);
    EXPECT_FALSE(robot.driver->is_homed());
  }
}

}  // namespace
}  // namespace trifinger
