// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/model/robot_description.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <string>
#include <vector>

#include "scenes.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string refusal(const RobotDescription& description) {
  try {
    validate(description);
  } catch (const InvalidArgument& error) {
    return error.what();
  }
  return "accepted";
}

TEST(VariantFigures, PutSoftLimitsInsideHardLimitsAndTheInitialPoseInsideBoth) {
  for (const Variant variant : test::kVariants) {
    for (const Arrangement arrangement : test::kArrangements) {
      const VariantFigures& figures = variant_figures(variant, arrangement);
      for (std::size_t j = 0; j < 3; ++j) {
        SCOPED_TRACE(std::string(figures.name) + " joint " + std::to_string(j));
        EXPECT_LE(figures.hard_lower[j], figures.soft_lower[j]);
        EXPECT_LT(figures.soft_lower[j], figures.soft_upper[j]);
        EXPECT_LE(figures.soft_upper[j], figures.hard_upper[j]);
        EXPECT_LE(figures.soft_lower[j], figures.initial_position[j]);
        EXPECT_LE(figures.initial_position[j], figures.soft_upper[j]);
      }
    }
  }
}

TEST(VariantFigures, AreFoundByName) {
  for (const Variant variant : test::kVariants)
    EXPECT_EQ(variant_from_name(variant_figures(variant).name), variant);
  EXPECT_THROW((void)variant_from_name("fingerpro"), InvalidArgument);
}

TEST(JointNames, GoFromBaseToTipFingerByFinger) {
  EXPECT_THAT(joint_names({}),
              ElementsAre("finger_base_to_upper_joint_0", "finger_upper_to_middle_joint_0",
                          "finger_middle_to_lower_joint_0", "finger_base_to_upper_joint_120",
                          "finger_upper_to_middle_joint_120", "finger_middle_to_lower_joint_120",
                          "finger_base_to_upper_joint_240", "finger_upper_to_middle_joint_240",
                          "finger_middle_to_lower_joint_240"));
  EXPECT_THAT(joint_names({.arrangement = Arrangement::kSingleFinger}),
              ElementsAre("finger_base_to_upper_joint", "finger_upper_to_middle_joint",
                          "finger_middle_to_lower_joint"));
}

TEST(AvailableTorque, FallsToZeroAtTheNoLoadSpeed) {
  const ActuatorParameters actuator;
  EXPECT_EQ(available_torque(actuator, 1.0, 0.0), actuator.torque_limit);
  EXPECT_EQ(available_torque(actuator, 0.1, 0.0), 0.1);
  EXPECT_NEAR(available_torque(actuator, 0.36, 0.95 * actuator.no_load_speed),
              0.05 * actuator.stall_torque, 1e-12);
  EXPECT_EQ(available_torque(actuator, 0.36, actuator.no_load_speed), 0.0);
  EXPECT_EQ(available_torque(actuator, 0.36, 2 * actuator.no_load_speed), 0.0);
}

TEST(AvailableTorque, BrakesWithFullTorqueAtAnySpeed) {
  const ActuatorParameters actuator;
  EXPECT_EQ(available_torque(actuator, -5.0, 100.0), -actuator.torque_limit);
  EXPECT_EQ(available_torque(actuator, 5.0, -100.0), actuator.torque_limit);
}

TEST(AvailableTorque, IsTheSameInBothDirections) {
  const ActuatorParameters actuator;
  for (double velocity = -60; velocity <= 60; velocity += 0.7)
    for (const double torque : {-1.0, -0.3, 0.0, 0.2, 0.5})
      EXPECT_EQ(available_torque(actuator, torque, velocity),
                -available_torque(actuator, -torque, -velocity));
}

TEST(ActuatorParameters, ReflectTheRotorThroughTheSquareOfTheGear) {
  EXPECT_NEAR(reflected_inertia({}), 3.645e-4, 1e-12);
}

TEST(CameraFigures, LookAtTheTableWhereTheCalibrationSaysTheyDo) {
  constexpr double kHits[3][2] = {{0.0047, 0.0015}, {-0.0016, 0.0069}, {-0.0066, 0.0077}};
  constexpr double kPositions[3][3] = {
      {0.24998, 0.24582, 0.38930}, {-0.00169, -0.26687, 0.46216}, {-0.25001, 0.24745, 0.38901}};
  for (std::size_t i = 0; i < 3; ++i) {
    const CameraFigures& camera = camera_figures()[i];
    SCOPED_TRACE(camera.name);
    // The table is printed to 0.1 mm. The stored rotation itself is accurate to 1e-5.
    const double scale = -camera.position[2] / camera.rotation[8];
    EXPECT_NEAR(camera.position[0] + scale * camera.rotation[2], kHits[i][0], 1e-4);
    EXPECT_NEAR(camera.position[1] + scale * camera.rotation[5], kHits[i][1], 1e-4);
    for (std::size_t axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(camera.position[axis], kPositions[i][axis], 3e-5);
  }
}

TEST(CameraFigures, AreProperRotations) {
  for (const CameraFigures& camera : camera_figures()) {
    const Eigen::Matrix3d rotation =
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(camera.rotation.data());
    EXPECT_LT((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
    EXPECT_NEAR(rotation.determinant(), 1, 1e-12);
  }
}

TEST(Validate, AcceptsEveryRobotAsItComes) {
  for (const RobotDescription& robot : test::all_robots()) EXPECT_EQ(refusal(robot), "accepted");
}

TEST(Validate, NamesTheValueFoundAndTheValueAllowed) {
  EXPECT_THAT(refusal({.finger_height = 0.05}),
              AllOf(HasSubstr("finger_height"), HasSubstr("0.05"), HasSubstr("0.2 to 0.6")));
  EXPECT_THAT(refusal({.finger_height = std::nan("")}), HasSubstr("finger_height"));
  EXPECT_THAT(refusal({.actuator = ActuatorParameters{.damping = -1}}), HasSubstr("damping"));
  EXPECT_THAT(refusal({.contact = {.tip_friction = 0}}), HasSubstr("tip_friction"));
  EXPECT_THAT(refusal({.contact = {.friction = {{SurfacePair::kTipLink, -1}}}}),
              HasSubstr("contact.friction.tip_link is -1"));
  EXPECT_THAT(refusal({.contact = {.time_constant = 0.001}}), HasSubstr("time_constant"));
  EXPECT_THAT(refusal({.stops = {.margin = -0.1}}), HasSubstr("stops.margin"));
}

TEST(Validate, RefusesObjectsThatCannotBe) {
  ObjectDescription weightless = cube("feather");
  weightless.mass = 0;
  EXPECT_THAT(refusal({.objects = {weightless}}), AllOf(HasSubstr("feather"), HasSubstr("mass")));
  ObjectDescription flat = cube("sheet");
  flat.size[1] = 0;
  EXPECT_THAT(refusal({.objects = {flat}}), AllOf(HasSubstr("sheet"), HasSubstr("size")));
  ObjectDescription pink = cube();
  pink.colours[2] = "pink";
  EXPECT_THAT(refusal({.objects = {pink}}), AllOf(HasSubstr("'pink'"), HasSubstr("magenta")));
  ObjectDescription stub = stick("stub");
  stub.size = {0.01, 0.02, 0};
  EXPECT_THAT(refusal({.objects = {stub}}), AllOf(HasSubstr("stub"), HasSubstr("diameter")));
}

TEST(Validate, TakesColoursInHexadecimalDigitsAndNothingLikeThem) {
  ObjectDescription die = cube("die");
  die.colours.fill("#0a7DcF");
  EXPECT_EQ(refusal({.objects = {die}}), "accepted");
  for (const std::string& wrong :
       std::vector<std::string>{"#0a7dc", "#0a7dcff", "0a7dcf0", "#0a7dcg", "#-10203", ""}) {
    die.colours[3] = wrong;
    EXPECT_THAT(refusal({.objects = {die}}), HasSubstr("'" + wrong + "'"));
  }
}

TEST(Validate, RefusesNamesThatAreTakenOrNone) {
  EXPECT_THAT(refusal({.objects = {cube("a"), ball("a")}}), HasSubstr("'a'"));
  for (const char* const name : {"", "a-b", "a b"}) {
    EXPECT_THAT(refusal({.objects = {cube(name)}}), HasSubstr("names are letters, digits and '_'"));
  }
  EXPECT_THAT(refusal({.objects = {cube("finger_upper_link_0")}}), HasSubstr("taken"));
}

TEST(Validate, WantsPositionsForMoreThanFourObjects) {
  RobotDescription robot{.objects = {cube("a"), cube("b"), cube("c"), cube("d"), cube("e")}};
  EXPECT_THAT(refusal(robot), AllOf(HasSubstr("'e'"), HasSubstr("position")));
  robot.objects[4].position = {{0.3, 0.3, 0.0325}};
  EXPECT_EQ(refusal(robot), "accepted");
}

}  // namespace
}  // namespace trifinger
