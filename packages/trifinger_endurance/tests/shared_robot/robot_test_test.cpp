// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/robot_test.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "shared_robot/robot_preparation.hpp"
#include "sim/servo_plant.hpp"
#include "support/session_folder.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::apps {
namespace {

// Tests a simulated robot whose session begins at `pose`, and whose cube lies at `cube`.
RobotTestReport test_at(const std::string& pose, const std::string& cube, const KnownRobot& known) {
  const test::SessionFolder folder;
  RobotConfig config =
      load_robot_config("sim", {"fingers.initial_position=" + pose, "objects.0.position=" + cube});
  config.backend.mode = BackendOptions::Mode::kNonRealTime;
  SimulatedRobot driver(config.simulation);
  SessionHost host = SessionHost::named("robot-test", config.session);
  Backend backend(driver, host, config.backend);
  const BackendThread loop(backend);
  EXPECT_TRUE(wait_until_free("robot-test", {}).is_fit);
  UntypedFrontend robot("robot-test");
  return test_robot(robot, SelfTest::kJoints, [] {}, known);
}

// What the model says of the weight, and the weight of joint 4 is heavier by `more` [Nm].
KnownRobot weights(double more = 0.0) {
  const auto weight = weight_of(make_model(load_robot_config("sim").simulation));
  return {.weight =
              [=](const std::vector<double>& position) {
                std::vector<double> torque(position.size());
                weight(position, torque);
                torque[4] += more;
                return torque;
              },
          .initial_position = {}};
}

KnownRobot known(double more = 0.0) {
  KnownRobot robot = weights(more);
  robot.initial_position = {0, 0.9, -1.7, 0, 0.9, -1.7, 0, 0.9, -1.7};
  return robot;
}

constexpr const char* kAside = "[0.1, 0.1, 0.0325]";

// The tips lie on the table, and the fingers lean on each other: after a fault.
TEST(RobotTest, FingersThatHaveFallenAreTestedWhereTheyAreFree) {
  constexpr const char* kFallen = "[-0.19, 0.13, -0.95, -0.28, 0.29, -1.06, -0.27, 0.10, -0.92]";
  EXPECT_THAT(test_at(kFallen, kAside, weights()).problem, ::testing::HasSubstr("joint"));
  EXPECT_EQ(test_at(kFallen, kAside, known()).problem, "");
}

TEST(RobotTest, ACubeInTheWayOfATipIsNoFaultOfTheJoint) {
  constexpr const char* kBelowATip = "[-0.06, 0.056, 0.0325]";
  constexpr const char* kInitial = "[0, 0.9, -1.7]";
  EXPECT_THAT(test_at(kInitial, kBelowATip, weights()).problem, ::testing::HasSubstr("joint"));
  EXPECT_EQ(test_at(kInitial, kBelowATip, known()).problem, "");
}

TEST(RobotTest, AJointThatIsWrongEverywhereIsFound) {
  EXPECT_THAT(test_at("[0, 0.9, -1.7]", kAside, known(0.15)).problem,
              ::testing::HasSubstr("joint 4 is not where it seems"));
}

}  // namespace
}  // namespace trifinger::apps
