// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/robot_config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "model/export.hpp"
#include "sim/robot_cameras.hpp"
#include "sim/robots.hpp"
#include "support/config_message.hpp"
#include "support/folder.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::test {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::StartsWith;
using testing::ThrowsMessage;

class RobotConfigFile : public testing::Test {
 protected:
  RobotConfigFile() { ::setenv("TRIFINGER_CONFIG_DIR", TRIFINGER_CONFIG_DIR, 1); }

  // Returns the path of a file that extends the documented one.
  [[nodiscard]] std::string extended(const std::string& text) const {
    const auto base = std::filesystem::path(TRIFINGER_CONFIG_DIR) / "trifinger_edu.yml";
    std::filesystem::copy_file(base, folder_ / "trifinger_edu.yml",
                               std::filesystem::copy_options::overwrite_existing);
    std::ofstream(folder_ / "my.yml") << "extends: trifinger_edu.yml\n" << text;
    return (folder_ / "my.yml").string();
  }
  // Returns the error for the text, from the name of the file on.
  [[nodiscard]] std::string message(const std::string& text) const {
    return shortened(message_of([&] { (void)load_robot_config(extended(text)); }));
  }
  // Returns the error for an override.
  [[nodiscard]] static std::string message_of_override(const std::string& override) {
    return message_of([&] { (void)load_robot_config("sim", {override}); });
  }
  [[nodiscard]] std::string shortened(std::string message) const {
    const std::string folder = folder_.path().string() + "/";
    if (message.starts_with(folder)) message.erase(0, folder.size());
    return message;
  }

  Folder folder_;
};

void run_ten_steps(const RobotConfig& config) {
  const Simulation simulation(config.simulation, config.session);
  const RobotTypes& types = simulation.robot().description();
  UntypedFrontend frontend = simulation.connect_untyped();
  std::vector<std::byte> element(types.observation.size());
  frontend.latest_observation(element.data(), kForever);
  CountedObservation observation(simulation.robot().limits().size());
  read_element(element.data(), observation);
  EXPECT_THAT(observation.position,
              testing::Pointwise(testing::DoubleEq(), simulation.robot().initial_position()));
  std::vector<std::byte> hold(types.action.size());
  write_element(hold_position(observation), hold.data());
  for (int i = 0; i < 10; ++i) {
    const TimeIndex t = frontend.append_desired_action(hold.data(), kForever);
    frontend.get(Series::kObservation, t, element.data(), kForever);
  }
  EXPECT_FALSE(frontend.fault());
}

TEST_F(RobotConfigFile, EveryOneThatComesWithTheProgramRuns) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(TRIFINGER_CONFIG_DIR)) {
    if (entry.path().extension() != ".yml") continue;
    ++count;
    SCOPED_TRACE(entry.path().filename());
    EXPECT_THAT(config_names(), Contains(entry.path().stem().string()));
    EXPECT_EQ(find_config(entry.path().stem().string()), entry.path());
    run_ten_steps(load_robot_config(entry.path().string()));
  }
  EXPECT_EQ(count, static_cast<int>(config_names().size()));
  EXPECT_GT(count, 0);
}

TEST_F(RobotConfigFile, ExtendsOneThatComesWithTheProgramByName) {
  for (const std::string& name : config_names()) {
    SCOPED_TRACE(name);
    const RobotConfig shipped = load_robot_config(name, {"name=mine"});
    for (const std::string& written : {name, name + ".yml"}) {
      std::ofstream(folder_ / "mine.yml") << "extends: " << written << "\nname: mine\n";
      const RobotConfig mine = load_robot_config((folder_ / "mine.yml").string());
      EXPECT_EQ(mine.name, "mine");
      EXPECT_EQ(mine.session.documents, shipped.session.documents);
    }
  }
  std::ofstream(folder_ / "mine.yml") << "extends: trifinger_deu\n";
  EXPECT_THAT(message_of([&] { (void)load_robot_config((folder_ / "mine.yml").string()); }),
              AllOf(HasSubstr("there is no such file in " + folder_.path().string()),
                    HasSubstr(std::filesystem::path(TRIFINGER_CONFIG_DIR).string()),
                    HasSubstr("did you mean 'trifinger_edu'?")));
}

TEST_F(RobotConfigFile, HasTheCamerasOfItsModel) {
  const RobotConfig config = load_robot_config("sim_cameras", {"cameras.size=270"});
  const camera::Calibration calibration = camera_calibration(config, "sim");
  ASSERT_EQ(calibration.cameras.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    const camera::Camera& camera = calibration.cameras[i];
    EXPECT_EQ(camera.name, camera_figures()[i].name);
    EXPECT_EQ(camera.format.width, 270);
    // It looks at the middle of the table, from half a metre.
    const auto seen = camera.project({0, 0, 0});
    ASSERT_TRUE(seen);
    EXPECT_NEAR(seen->x(), 145, 10);
    EXPECT_NEAR(seen->y(), 139, 10);
    EXPECT_NEAR(camera.pose.translation().norm(), 0.53, 0.01);
  }
  // The document is read again as it was written.
  const config::File file = config::File::parse(camera_document(calibration).text, "cameras.yml");
  const camera::Calibration again = camera::read_calibration(file.root());
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_TRUE(again.cameras[i].pose.isApprox(calibration.cameras[i].pose, 1e-12));
    EXPECT_EQ(again.cameras[i].lens.cy, calibration.cameras[i].lens.cy);
  }
  // The file says what is so without it.
  EXPECT_EQ(load_robot_config("sim_cameras").cameras->simulated.look, camera::RenderingOptions{});
  // Those of a flipped platform turn with it, and see its ceiling as before.
  const RobotConfig flipped = load_robot_config("sim_cameras", {"platform=flipped"});
  const RobotDescription& description = flipped.simulation.description;
  const camera::Camera camera = calibration_of_figures(description).cameras[0];
  const auto seen = camera.project({0, 0, flip_height(description)});
  ASSERT_TRUE(seen);
  EXPECT_NEAR(seen->x(), 290, 20);
  EXPECT_THROW((void)camera_calibration(load_robot_config("sim"), "sim"), InvalidArgument);
}

TEST_F(RobotConfigFile, DiffersInWhatAControllerNotices) {
  const auto parsed = [](const std::string& name, const std::vector<std::string>& overrides = {}) {
    return config::File::load(find_config(name), overrides, config_folders());
  };
  const auto lines = [](const config::File& robot, const config::File& other) {
    std::vector<std::string> found;
    for (const ConfigDifference& one : differences(robot, other)) {
      found.push_back(one.key + ": " + one.value.value_or("none") + ", " +
                      one.other.value_or("none"));
    }
    return found;
  };
  const config::File sim = parsed("sim");
  // Other ways to write equal values, and keys that make no difference.
  EXPECT_THAT(lines(sim, parsed("trifinger_edu", {"name=other", "fingers.height=0.2830 m",
                                                  R"(objects=[{"name": "cube", "type": "cube"}])",
                                                  "safety.max_torque=[0.36, 0.36, 0.36]",
                                                  "fingers.initial_position=[0, 0.8, -1.6]",
                                                  "backend.mode=non_real_time", "simulation.seed=7",
                                                  "simulation.object_position_noise=0.001"})),
              testing::IsEmpty());
  EXPECT_THAT(
      lines(parsed("sim", {"boundary=false", "objects.0.mass=0.2", "backend.period=0.002"}), sim),
      testing::ElementsAre("backend.period: 0.002, 0.001", "boundary: false, true",
                           "object 'cube': box of 0.065 x 0.065 x 0.065 m and 0.2 kg, "
                           "box of 0.065 x 0.065 x 0.065 m and 0.094 kg"));
  // A file of another version may lack a key, or have one more.
  const config::File other =
      config::File::parse("contact: {tip_friction: 1, stiffness: 3}\n", "other.yml");
  EXPECT_THAT(lines(sim, other), testing::IsSupersetOf({"contact.stiffness: none, 3",
                                                        "contact.floor_friction: 0.5, none"}));
}

TEST_F(RobotConfigFile, GoesAlongWithTheSessionsInOnePiece) {
  const RobotConfig config = load_robot_config("sim", {"fingers.height=0.31"});
  ASSERT_EQ(config.session.documents.size(), 1U);
  const Document& document = config.session.documents[0];
  EXPECT_EQ(document.name, "configuration.yml");
  // The document that is read back describes an equal robot, without any base file or override.
  std::ofstream(folder_ / "copy.yml") << document.text;
  const RobotConfig copy = load_robot_config((folder_ / "copy.yml").string());
  EXPECT_EQ(copy.session.documents, config.session.documents);
  EXPECT_EQ(copy.simulation.description.finger_height, 0.31);

  const Simulation simulation(config.simulation, config.session);
  const std::vector<Document> documents = simulation.connect().session().documents();
  ASSERT_EQ(documents.size(), 4U);
  EXPECT_EQ(documents[0], document);
  EXPECT_EQ(documents[1].name, "model.xml");
  EXPECT_EQ(documents[1].text, export_mjcf(simulation.robot().options().description));
  EXPECT_EQ(documents[2].name, "robot.urdf");
  EXPECT_EQ(documents[3].name, "frames.txt");
}

TEST_F(RobotConfigFile, SaysTheSameAsTheFiguresOfTheRobot) {
  // Limits are written twice: in the model, for programs without a file, and in the files.
  const auto expect_same = [](const SimulationOptions& options) {
    const std::vector<JointLimit> of_figures = default_limits(options.description);
    for (std::size_t i = 0; i < of_figures.size(); ++i) {
      for (const JointLimitField& field : JointLimit::fields()) {
        EXPECT_EQ((*options.limits)[i].*field.value, of_figures[i].*field.value) << field.name;
      }
    }
    EXPECT_EQ(*options.description.finger_height, figures(options.description).finger_height);
    // The models are equal to the last byte: the files repeat the defaults of the physics.
    RobotDescription of_defaults = options.description;
    of_defaults.actuator.reset();
    of_defaults.stops = {};
    of_defaults.contact = {};
    EXPECT_EQ(export_mjcf(options.description), export_mjcf(of_defaults));
    for (std::size_t i = 0; i < options.initial_position->size(); ++i) {
      EXPECT_EQ((*options.initial_position)[i],
                figures(options.description).initial_position[i % kJointsPerFinger]);
    }
  };
  for (const std::string& name : config_names()) {
    SCOPED_TRACE(name);
    const SimulationOptions simulation = load_robot_config(name).simulation;
    // Robots for a skill differ in what the skill needs.
    const std::set<std::string> for_skills{"catch",      "pushing", "sim_balance",
                                           "sim_cuboid", "throw",   "throw_far"};
    if (for_skills.contains(name)) continue;
    // Those from a file have their limits there alone.
    if (simulation.file == nullptr) expect_same(simulation);
  }
}

TEST_F(RobotConfigFile, FillsEveryOption) {
  const RobotConfig config =
      load_robot_config("trifinger_pro", {"name=mine",
                                          "fingers.height=0.3",
                                          "fingers.soft_tips=false",
                                          "platform=flipped",
                                          "boundary=false",
                                          "contact.tip_friction=0.7",
                                          "contact.tip_torsional_friction=0.01",
                                          "contact.floor_friction=0.4",
                                          "contact.friction.tip_object=0.8",
                                          "contact.friction.object_boundary=0.2",
                                          "contact.time_constant=0.004",
                                          "contact.tip_time_constant=0.01",
                                          "contact.tip_damping_ratio=0.8",
                                          "joints.rotor_inertia=5e-6",
                                          "joints.damping=0.002",
                                          "joints.friction=0.01",
                                          "joints.stop_margin=0.1",
                                          "joints.stop_time_constant=0.005",
                                          "backend.mode=non_real_time",
                                          "backend.period=0.002",
                                          "backend.history=1024",
                                          "backend.late_action.max_repeats=7",
                                          "backend.max_skipped_ticks=8",
                                          "backend.max_late_steps=11",
                                          "backend.max_measurement_age=0.25",
                                          "backend.max_rejected_actions=9",
                                          "backend.first_action_timeout=1.5",
                                          "simulation.seed=42",
                                          "simulation.object_period=0.02",
                                          "simulation.object_delay=0.03",
                                          "simulation.object_position_noise=0.001",
                                          "simulation.object_orientation_noise=0.02"});
  EXPECT_EQ(config.name, "mine");
  EXPECT_EQ(config.backend.mode, BackendOptions::Mode::kNonRealTime);
  EXPECT_EQ(config.backend.period, std::chrono::milliseconds(2));
  EXPECT_EQ(config.backend.max_action_repeats, 7U);
  EXPECT_EQ(config.backend.max_skipped_ticks, 8U);
  EXPECT_EQ(config.backend.max_late_steps, 11U);
  EXPECT_EQ(config.backend.max_measurement_age, std::chrono::milliseconds(250));
  EXPECT_EQ(config.backend.max_rejected_actions, 9U);
  EXPECT_EQ(config.backend.first_action_timeout, std::chrono::milliseconds(1500));
  EXPECT_EQ(config.session.history, 1024U);
  const auto& options = config.simulation;
  EXPECT_EQ(options.description.variant, Variant::kPro);
  EXPECT_EQ(options.description.finger_height, 0.3);
  EXPECT_FALSE(options.description.soft_tips);
  EXPECT_TRUE(options.description.flipped);
  EXPECT_FALSE(options.description.boundary);
  EXPECT_EQ(options.description.contact.tip_friction, 0.7);
  EXPECT_EQ(options.description.contact.tip_torsional_friction, 0.01);
  EXPECT_EQ(options.description.contact.floor_friction, 0.4);
  EXPECT_EQ(options.description.contact.friction,
            (OfSurfacePairs<std::optional<double>>{{SurfacePair::kTipObject, 0.8},
                                                   {SurfacePair::kObjectBoundary, 0.2}}));
  EXPECT_EQ(options.description.contact.time_constant, 0.004);
  EXPECT_EQ(options.description.contact.tip_time_constant, 0.01);
  EXPECT_EQ(options.description.contact.tip_damping_ratio, 0.8);
  const ActuatorParameters drive = actuator(options.description);
  EXPECT_EQ(drive.rotor_inertia, 5e-6);
  EXPECT_EQ(drive.damping, 0.002);
  EXPECT_EQ(drive.friction, 0.01);
  EXPECT_EQ(drive.torque_limit, 0.396);
  EXPECT_EQ(options.description.stops.margin, 0.1);
  EXPECT_EQ(options.description.stops.time_constant, 0.005);
  EXPECT_TRUE(options.description.objects.empty());
  EXPECT_EQ((*options.limits)[8].max_torque, 0.396);
  EXPECT_EQ(options.period, std::chrono::milliseconds(2));
  EXPECT_EQ(options.seed, 42U);
  EXPECT_EQ(options.object_period, 10);
  EXPECT_EQ(options.object_delay, 15);
  EXPECT_EQ(options.object_position_noise, 0.001);
  EXPECT_EQ(options.object_orientation_noise, 0.02);
}

TEST_F(RobotConfigFile, ReadsObjects) {
  const RobotConfig config = load_robot_config(
      extended("objects:\n"
               "  - {name: box, type: cuboid, size: [0.02, 0.08, 0.03], mass: "
               "0.02, position: [0.1, 0, 0.1]}\n"
               "  - {name: pen, type: stick, size: [0.14, 0.01]}\n"
               "  - {name: ball, type: ball, size: [0.05]}\n"
               "  - {name: dice, type: cube, size: [0.04], orientation: [1, 0, 0, 1], "
               "velocity: [0.1, 0, 2], angular_velocity: [1, 2, 3], "
               "colours: [red, red, blue, cyan, magenta, green]}\n"));
  const auto& objects = config.simulation.description.objects;
  ASSERT_EQ(objects.size(), 4U);
  EXPECT_EQ(objects[0].size, (Triple{0.02, 0.08, 0.03}));
  EXPECT_EQ(objects[0].mass, 0.02);
  EXPECT_EQ(objects[0].position, (Triple{0.1, 0, 0.1}));
  EXPECT_EQ(objects[1].shape, ObjectShape::kStick);
  EXPECT_EQ(objects[1].size[0], 0.14);
  EXPECT_EQ(objects[1].mass, stick().mass);
  EXPECT_EQ(objects[2].shape, ObjectShape::kBall);
  EXPECT_EQ(objects[2].size[0], 0.05);
  EXPECT_FALSE(objects[2].position);
  EXPECT_EQ(objects[3].size, (Triple{0.04, 0.04, 0.04}));
  EXPECT_EQ(objects[3].orientation, (std::array<double, 4>{1, 0, 0, 1}));
  EXPECT_EQ(objects[3].velocity, (Triple{0.1, 0, 2}));
  EXPECT_EQ(objects[3].angular_velocity, (Triple{1, 2, 3}));
  EXPECT_EQ(objects[3].colours, (BoxColours{"red", "red", "blue", "cyan", "magenta", "green"}));
  EXPECT_EQ(objects[0].velocity, Triple{});
  EXPECT_EQ(objects[0].colours, competition_colours());
}

TEST_F(RobotConfigFile, WaitsForTheFirstActionForEverUnlessTold) {
  EXPECT_EQ(load_robot_config("sim").backend.first_action_timeout, kForever);
}

// --- Mistakes: one sentence each, with its location.

TEST_F(RobotConfigFile, NamesAnUnknownKey) {
  EXPECT_EQ(message("boundry: true\n"),
            "my.yml:2:1: boundry is not a known key; did you mean 'boundary'?");
}

TEST_F(RobotConfigFile, fault_59_NamesAMissingKey) {
  EXPECT_EQ(message("robot:\n  variant: pro\n"), "my.yml:3:3: robot.arrangement is missing");
}

TEST_F(RobotConfigFile, NamesMalformedYaml) {
  EXPECT_THAT(message("robot: [1, 2\n"), StartsWith("my.yml:"));
}

TEST_F(RobotConfigFile, NamesAValueThatIsNoChoice) {
  EXPECT_EQ(message("platform: sideways\n"),
            "my.yml:2:11: platform is 'sideways', must be 'upright' or 'flipped'");
}

TEST_F(RobotConfigFile, fault_59_NamesReversedLimits) {
  EXPECT_THAT(message_of_override("safety.soft_lower=2"),
              AllOf(StartsWith("--set safety.soft_lower"), HasSubstr("2 rad"),
                    HasSubstr("soft_upper (1 rad)")));
}

TEST_F(RobotConfigFile, OfAnOlderVersionIsTheSameRobot) {
  // This file has no section for joints, and only the old keys for contacts.
  const std::string path = extended(
      "contact: {tip_friction: 1.0, tip_torsional_friction: 0.005, floor_friction: 0.5}\n");
  std::stringstream base;
  base << std::ifstream(folder_ / "trifinger_edu.yml").rdbuf();
  const std::string without =
      std::regex_replace(base.str(), std::regex("\njoints:\n(  [^\n]*\n)+"), "\n");
  ASSERT_LT(without.size(), base.str().size());
  std::ofstream(folder_ / "trifinger_edu.yml") << without;
  const auto description = [](const std::string& name) {
    return load_robot_config(name).simulation.description;
  };
  EXPECT_EQ(export_mjcf(description(path)), export_mjcf(description("trifinger_edu")));
}

TEST_F(RobotConfigFile, NamesWhatCannotBeOfContactsAndJoints) {
  EXPECT_EQ(message_of_override("contact.friction.tip_object=9"),
            "--set contact.friction.tip_object: contact.friction.tip_object is 9, must be 0.001 to "
            "5");
  EXPECT_THAT(message_of_override("contact.friction.object_tip=1"),
              HasSubstr("contact.friction.object_tip is not a known key"));
  EXPECT_THAT(message_of_override("contact.time_constant=0.001"),
              HasSubstr("contact.time_constant is 0.001 s, must be 0.002 to 0.1 s"));
  EXPECT_THAT(message_of_override("joints.rotor_inertia=1"),
              HasSubstr("joints.rotor_inertia is 1 kgm^2, must be 0 to 0.001 kgm^2"));
  EXPECT_THAT(message_of_override("joints.stop_margin=-1"), HasSubstr("must be 0 to 1 rad"));
  EXPECT_THAT(message_of_override("objects.0.velocity=[0, 0, 20]"),
              HasSubstr("must be -10 to 10 m/s"));
}

TEST_F(RobotConfigFile, NamesAPeriodThatThePhysicsCannotKeep) {
  EXPECT_EQ(message_of_override("backend.period=0.0015"),
            "--set backend.period: backend.period is 0.0015 s, must be a whole number of "
            "milliseconds in a simulation");
}

TEST_F(RobotConfigFile, NamesATimeThatIsNoWholeNumberOfSteps) {
  EXPECT_EQ(message_of_override("simulation.object_period=0.0025"),
            "--set simulation.object_period: simulation.object_period is 0.0025 s, must be a whole "
            "number of steps of 0.001 s");
  EXPECT_EQ(message_of_override("simulation.object_delay=0.0004"),
            "--set simulation.object_delay: simulation.object_delay is 0.0004 s, must be a whole "
            "number of steps of 0.001 s");
}

TEST_F(RobotConfigFile, NamesAValueOutOfRange) {
  EXPECT_EQ(message_of_override("fingers.height=3"),
            "--set fingers.height: fingers.height is 3 m, must be 0.2 to 0.6 m");
}

TEST_F(RobotConfigFile, NamesAnInitialPositionBeyondTheSoftLimits) {
  EXPECT_EQ(
      message_of_override("fingers.initial_position=[0, 0.9, 1, 0, 0.9, 1, 0, 1.7, 1]"),
      "--set fingers.initial_position: fingers.initial_position has 1.7 rad for joint 7, must "
      "be within its soft limits, -1.2 to 1.6 rad");
  EXPECT_EQ(message_of_override("fingers.initial_position=[0, 0.9]"),
            "--set fingers.initial_position: fingers.initial_position has 2 angles, must have 3 or "
            "9");
}

TEST_F(RobotConfigFile, HasNoOrderlyStopUnlessItSaysSo) {
  const RobotConfig config = load_robot_config("sim");
  const auto& options = config.simulation;
  EXPECT_EQ(options.stop.damping_time, Nanoseconds::zero());
  EXPECT_FALSE(options.stop.rest_position.has_value());
}

TEST_F(RobotConfigFile, SaysHowTheRobotComesToRest) {
  const RobotConfig config = load_robot_config(
      extended("stop: {damping_time: 0.5, rest_position: [0, 0.9, -1.7], move_time: 4}\n"));
  const auto& stop = config.simulation.stop;
  EXPECT_EQ(stop.damping_time, std::chrono::milliseconds(500));
  EXPECT_EQ(stop.rest_position, (std::vector{0.0, 0.9, -1.7, 0.0, 0.9, -1.7, 0.0, 0.9, -1.7}));
  EXPECT_EQ(stop.move_time, std::chrono::seconds(4));
}

TEST_F(RobotConfigFile, NamesAnOrderlyStopThatCannotBe) {
  EXPECT_EQ(
      message("stop: {damping_time: 0.5, rest_position: [0, 2, 0], move_time: 4}\n"),
      "my.yml:2:42: stop.rest_position has 2 rad for joint 1, must be within its soft limits, "
      "-1.2 to 1.6 rad");
  EXPECT_THAT(message("stop: {damping_time: 0.5, rest_position: [0, 0, 0], move_time: 0.1}\n"),
              AllOf(HasSubstr("stop.move_time is 0.1 s, must be at least "),
                    HasSubstr("or the joints cannot follow")));
  EXPECT_THAT(message("stop: {damping_time: 0.5, rest_position: [0, 0, 0]}\n"),
              HasSubstr("move_time"));
  EXPECT_THAT(message("stop: {damping_time: 3}\n"), HasSubstr("must be 0 to 2 s"));
}

TEST_F(RobotConfigFile, NamesObjectsThatDoNotGoTogether) {
  EXPECT_EQ(message("objects:\n  - {name: a, type: cube}\n  - {name: a, type: ball}\n"),
            "my.yml:3:3: Two objects are called 'a'; names must differ.");
  EXPECT_EQ(message("objects:\n  - {name: a, type: stick, size: [0.01, 0.02]}\n"),
            "my.yml:3:3: object 'a': a stick of length 0.01 m must be longer than its diameter of "
            "0.02 m.");
  EXPECT_EQ(message("objects:\n  - {name: a, type: ball, orientation: [0, 0, 0, 0]}\n"),
            "my.yml:3:3: object 'a': its orientation is zero; a quaternion w x y z is needed.");
  EXPECT_EQ(message("objects:\n  - {name: a, type: cuboid, size: [0.01]}\n"),
            "my.yml:3:35: objects.0.size has 1 lengths, must have 3");
  const std::string colours = "colours: [red, green, blue, cyan, magenta, pink]}\n";
  EXPECT_THAT(message("objects:\n  - {name: a, type: ball, " + colours),
              HasSubstr("objects.0.colours is for a cube or a cuboid"));
  EXPECT_THAT(message("objects:\n  - {name: a, type: cube, " + colours),
              HasSubstr("object 'a': its faces cannot be 'pink', only red, green"));
}

TEST_F(RobotConfigFile, StopsAtALateActionIfToldSo) {
  const RobotConfig config = load_robot_config("sim", {"backend.late_action.policy=stop"});
  EXPECT_EQ(config.backend.max_action_repeats, 0U);
  EXPECT_EQ(load_robot_config("sim").backend.max_action_repeats, 100U);
}

TEST_F(RobotConfigFile, NamesTheConfigurationsThereAre) {
  EXPECT_THAT([] { (void)load_robot_config("trifinger_max"); },
              ThrowsMessage<InvalidArgument>(AllOf(HasSubstr("'trifinger_max'"), HasSubstr("sim"),
                                                   HasSubstr("trifinger_pro"))));
}

TEST_F(RobotConfigFile, NamesAFileThatIsNotThere) {
  EXPECT_THAT([] { (void)load_robot_config("./nowhere.yml"); },
              ThrowsMessage<SystemError>(HasSubstr("nowhere.yml")));
}

}  // namespace
}  // namespace trifinger::test
