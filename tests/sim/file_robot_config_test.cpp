// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "model/file_robots.hpp"
#include "support/config_message.hpp"
#include "support/folder.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/joint/read_limits.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::test {
namespace {

using std::chrono::microseconds;
using testing::HasSubstr;

constexpr const char* kHead = "name: arm\ndriver: simulation\nrobot: {mjcf: models/arm.xml}\n";

class FileRobotConfig : public testing::Test {
 protected:
  FileRobotConfig() {
    std::filesystem::create_directory(folder_ / "models");
    write(folder_ / "models" / "arm.xml", kArm);
  }
  [[nodiscard]] std::string path_of(const std::string& text) const {
    write(folder_ / "my.yml", text);
    return (folder_ / "my.yml").string();
  }
  [[nodiscard]] RobotConfig load(const std::string& text,
                                 const std::vector<std::string>& overrides = {}) const {
    return load_robot_config(path_of(text), overrides);
  }
  // Returns the error for the text, from the name of the file on.
  [[nodiscard]] std::string message(const std::string& text) const {
    std::string message = message_of([&] { (void)load(text); });
    const std::string folder = folder_.path().string() + "/";
    for (std::size_t at = 0; (at = message.find(folder)) != std::string::npos;) {
      message.erase(at, folder.size());
    }
    return message;
  }

  Folder folder_;
};

TEST_F(FileRobotConfig, TakesFromTheFileWhatItDoesNotSay) {
  const RobotConfig config = load(std::string(kHead) + kArmSafety);
  EXPECT_EQ(config.name, "arm");
  EXPECT_EQ(config.backend.period, microseconds(2000));
  EXPECT_EQ(config.backend.mode, BackendOptions::Mode::kRealTime);
  ASSERT_EQ(config.simulation.limits->size(), 4U);
  const JointLimit& shoulder = config.simulation.limits->at(0);
  EXPECT_EQ(shoulder.max_torque, 12.0);
  EXPECT_EQ(shoulder.hard_lower, -2.0);
  EXPECT_EQ(shoulder.soft_upper, 1.8);
  // What the configuration says goes before the file, for every joint, too.
  EXPECT_EQ(shoulder.default_kp, 20.0);
  // Nobody may ask for stiffer gains than the robot's own, unless the configuration allows it.
  EXPECT_EQ(shoulder.max_kp, 20.0);
  EXPECT_EQ(shoulder.continuous_torque, std::numeric_limits<double>::infinity());
  // A row of a joint goes before that of every joint.
  EXPECT_EQ(config.simulation.limits->at(2).safety_kd, 0.1);
  EXPECT_EQ(config.simulation.limits->at(3).max_torque, 15.0);
}

TEST_F(FileRobotConfig, AsksForAllThatIsMissingByName) {
  EXPECT_EQ(message(kHead),
            "my.yml:1:1: neither 'safety' nor the robot's file says all that the safety chain "
            "needs. Fill this in; 'every_joint' is for all joints that do not say otherwise:\n"
            "safety:\n"
            "  every_joint: {safety_kd: FILL_IN, max_velocity: FILL_IN, braking: FILL_IN}\n"
            "  shoulder: {soft_lower: FILL_IN, soft_upper: FILL_IN}  # its stops: -2 to 2 rad\n"
            "  elbow: {soft_lower: FILL_IN, soft_upper: FILL_IN, default_kp: FILL_IN, default_kd: "
            "FILL_IN}  # its stops: -2.5 to 2.5 rad\n"
            "  finger: {soft_lower: FILL_IN, soft_upper: FILL_IN}  # its stops: 0 to 1.5 rad\n"
            "  rail: {max_torque: FILL_IN, soft_lower: FILL_IN, soft_upper: FILL_IN, default_kp: "
            "FILL_IN}  # it has no stops: -.inf and .inf are possible\n");
}

TEST_F(FileRobotConfig, AcceptsTheTextItAskedForOnceItIsFilledIn) {
  const std::string asked = message(kHead);
  std::string text = asked.substr(asked.find("safety:"));
  EXPECT_THAT(message(kHead + text), HasSubstr("FILL_IN"));
  const auto fill = [&text](const std::string& key, const std::string& value) {
    const std::string place = key + ": FILL_IN";
    for (std::size_t at = 0; (at = text.find(place)) != std::string::npos;) {
      text.replace(at + key.size() + 2, place.size() - key.size() - 2, value);
    }
  };
  fill("soft_lower", "0.1");
  fill("soft_upper", "1.4");
  for (const char* const key :
       {"safety_kd", "max_velocity", "braking", "default_kp", "default_kd", "max_torque"}) {
    fill(key, "1");
  }
  EXPECT_EQ(message(kHead + text), "no error");
}

TEST_F(FileRobotConfig, RefusesJointsWithTheNameOfTheKeyForAllJoints) {
  // A joint with a motor, one without, and a tendon.
  for (const std::string joint : {"elbow", "flap", "finger"}) {
    std::string text = kArm;
    const auto rename = [&text](const std::string& from, const std::string& to) {
      for (std::size_t at = 0; (at = text.find(from)) != std::string::npos;) {
        text.replace(at, from.size(), to);
      }
    };
    for (const std::string key : {" name", " joint", " tendon"}) {
      rename(key + "=\"" + joint + "\"", key + "=\"every_joint\"");
    }
    write(folder_ / "models" / "arm.xml", text);
    EXPECT_EQ(message(std::string(kHead) + kArmSafety),
              "my.yml:3:15: no joint can be called 'every_joint', which is the key for all joints "
              "that do not say otherwise; give it another name")
        << joint;
  }
}

TEST(LimitsByName, HaveNoPlaceForAJointWithTheNameOfTheKeyForAllJoints) {
  const std::vector<NamedJoint> joints{{.name = "every_joint"}};
  const config::File file = config::File::parse("safety: {}", "text");
  EXPECT_THROW(static_cast<void>(read_limits_by_name(file.root(), joints)), InvalidArgument);
}

TEST_F(FileRobotConfig, LetsAJointTurnForEver) {
  const RobotConfig config = load(std::string(kHead) + kArmSafety,
                                  {"safety.rail.soft_lower=-.inf", "safety.rail.hard_lower=-.inf"});
  EXPECT_EQ(config.simulation.limits->at(3).soft_lower, -kLargestJointLimit);
}

TEST_F(FileRobotConfig, GivesJointsTheRotorsThatTheFileLacks) {
  const std::string head =
      "name: arm\ndriver: simulation\nrobot:\n  mjcf: models/arm.xml\n"
      "  armature: {every_joint: 0.02, elbow: 0.3}\n";
  const RobotConfig config = load(head + kArmSafety);
  const mjModel_& model = *config.simulation.file->mujoco();
  const std::vector<double> armature(model.dof_armature, model.dof_armature + model.nv);
  EXPECT_EQ(std::vector(armature.begin(), armature.begin() + 4),
            (std::vector{0.02, 0.02, 0.3, 0.02}));
  // Free bodies have no rotor.
  EXPECT_EQ(armature[6], 0.0);
}

TEST_F(FileRobotConfig, GivesItsRotorsInsteadOfThoseOfTheFilesActuators) {
  std::string text = kArm;
  for (const std::string motor : {R"(name="drive")", R"(name="servo")"}) {
    text.insert(text.find(motor), R"(armature="0.5" )");
  }
  write(folder_ / "models" / "arm.xml", text);
  const std::string head =
      "name: arm\ndriver: simulation\nrobot:\n  mjcf: models/arm.xml\n"
      "  armature: {elbow: 0.3}\n";
  const RobotConfig config = load(head + kArmSafety);
  const mjModel_& model = *config.simulation.file->mujoco();
  EXPECT_EQ(model.actuator_armature[1], 0.0);
  EXPECT_EQ(model.actuator_armature[0], 2.0);  // as it is at the joint, after a gear of 2
}

TEST_F(FileRobotConfig, ChecksUnitsByTheKindOfAJoint) {
  const std::string text = std::string(kHead) + kArmSafety;
  EXPECT_EQ(load(text, {"safety.rail.soft_lower=-0.5 m", "safety.rail.default_kp=90 N/m"})
                .simulation.limits->at(3)
                .default_kp,
            90.0);
  EXPECT_THAT(message_of([&] { (void)load(text, {"safety.rail.max_torque=10 Nm"}); }),
              HasSubstr("has the unit 'Nm', must be in 'N'"));
}

TEST_F(FileRobotConfig, NamesKeysThatNobodyKnows) {
  EXPECT_THAT(message(std::string(kHead) + kArmSafety + "  elbov: {soft_lower: 0}\n"),
              HasSubstr("safety.elbov"));
  EXPECT_THAT(message(std::string(kHead) + kArmSafety + "fingers: {height: 1}\n"),
              HasSubstr("fingers"));
  EXPECT_THAT(message("name: arm\ndriver: simulation\nrobot: {mjcf: none.xml}\n"),
              HasSubstr("my.yml:3:15: robot.mjcf is none.xml: there is no such file"));
  // Where the configuration names the file is where it says what is wrong with it.
  EXPECT_THAT(
      message("name: arm\ndriver: simulation\nrobot: {mjcf: models/arm.xml, joints: [knee]}\n"),
      testing::StartsWith("my.yml:3:15: models/arm.xml: no joint or fixed tendon 'knee' can be"));
}

TEST_F(FileRobotConfig, HasAPeriodOfItsOwn) {
  const std::string backend =
      "backend: {mode: non_real_time, period: 0.005, history: 64, access: owner, late_action: "
      "{policy: stop}, max_rejected_actions: 3, max_skipped_ticks: 1, max_late_steps: 1, "
      "max_measurement_age: .inf, first_action_timeout: 2}\n"
      "simulation: {object_period: 0.01}\n";
  const RobotConfig config = load(std::string(kHead) + kArmSafety + backend);
  EXPECT_EQ(config.backend.period, microseconds(5000));
  EXPECT_EQ(config.simulation.file->substeps(), 3);
  EXPECT_EQ(config.simulation.object_period, 2);
  EXPECT_EQ(config.backend.max_rejected_actions, 3U);
}

TEST_F(FileRobotConfig, MeansTheSameWhereverItsTextIsRead) {
  const RobotConfig config = load(std::string(kHead) + kArmSafety);
  const std::string& text = config.session.documents.at(0).text;
  const RobotConfig again = read_robot_config(config::File::parse(text, "configuration.yml"));
  EXPECT_TRUE(again.simulation.file->options().path.is_absolute());
  EXPECT_EQ(again.simulation.limits->size(), 4U);
  EXPECT_EQ(again.session.documents.at(0).text, text);
}

TEST_F(FileRobotConfig, IsNotTakenForATriFinger) {
  const std::string path = path_of(std::string(kHead) + kArmSafety);
  EXPECT_TRUE(is_from_file(load_config_file(path)));
  EXPECT_THAT([&] { (void)description_of(load_robot_config(path)); },
              testing::ThrowsMessage<InvalidArgument>(
                  "robot 'arm' is from a file; this is for a TriFinger or one of its fingers"));
  ::setenv("TRIFINGER_CONFIG_DIR", TRIFINGER_CONFIG_DIR, 1);
  EXPECT_FALSE(is_from_file(load_config_file("sim")));
  EXPECT_EQ(description_of(load_robot_config("sim")).objects.size(), 1U);
}

TEST_F(FileRobotConfig, HasWhatEverySimulatedRobotMayHave) {
  const std::string text = std::string(kHead) + kArmSafety +
                           "simulation: {seed: 7, object_period: 0.01, object_delay: 0.03, "
                           "object_position_noise: 0.001, object_orientation_noise: 0.02, "
                           "object_loss: 0.1, hand: true}\n"
                           "stop: {damping_time: 0.5, rest_position: [0.5, 1, 0.2, 0], "
                           "move_time: 4}\n";
  const SimulationOptions options = load(text).simulation;
  EXPECT_EQ(options.seed, 7U);
  EXPECT_EQ(options.object_period, 5);
  EXPECT_EQ(options.object_delay, 15);
  EXPECT_EQ(options.object_position_noise, 0.001);
  EXPECT_EQ(options.object_orientation_noise, 0.02);
  EXPECT_EQ(options.object_loss, 0.1);
  EXPECT_TRUE(options.has_hand);
  EXPECT_EQ(options.stop.damping_time, std::chrono::milliseconds(500));
  EXPECT_EQ(options.stop.rest_position, (std::vector{0.5, 1.0, 0.2, 0.0}));
  EXPECT_EQ(options.stop.move_time, std::chrono::seconds(4));
  EXPECT_THAT(
      message_of([&] { (void)load(text, {"stop.rest_position=[0, 0, 0.5, 1]"}); }),
      HasSubstr("stop.rest_position has 1 m for joint 3 (rail), must be within its soft limits"));
  EXPECT_THAT(message_of([&] { (void)load(text, {"stop.rest_position=[0, 0, 1]"}); }),
              HasSubstr("has 3 numbers, must have 4"));
  EXPECT_THAT(message_of([&] { (void)load(text, {"simulation.object_loss=2"}); }),
              HasSubstr("simulation.object_loss is 2, must be 0 to 1"));
}

}  // namespace
}  // namespace trifinger::test
