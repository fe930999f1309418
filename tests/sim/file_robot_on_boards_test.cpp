// SPDX-License-Identifier: BSD-3-Clause
// A robot from a file on emulated motor boards, and a TriFinger whose boards are named by its
// joints.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/regular_file.hpp"
#include "boards/board_robot.hpp"
#include "boards/calibration.hpp"
#include "boards/emulator.hpp"
#include "model/file_robots.hpp"
#include "sim/boards_config.hpp"
#include "sim/on_boards.hpp"
#include "sim/servo_plant.hpp"
#include "sim/simulated_plant.hpp"
#include "support/allocation_counter.hpp"
#include "support/config_message.hpp"
#include "support/folder.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::test {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;
using State = DriverReport::State;
using Action = JointAction<3>;
using Applied = AppliedJointAction<3>;
using Observation = JointObservation<3>;
using boards::BoardRobot;
using boards::BoardRobotOptions;
using boards::HomingMethod;

// The model of the arm.
std::string model_text() { return read_file(TRIFINGER_ROOT "/tests/robots/desk_arm.xml", 10'000); }

constexpr const char* kHead = R"(name: desk-arm
driver: boards
robot:
  mjcf: arm.xml
  initial_position: {shoulder: 0.3, elbow: -0.5, wrist: 0.2}
safety:
  every_joint: {safety_kd: 0.2, max_velocity: 4, braking: 10, default_kp: 30, default_kd: 1.5}
  shoulder: {soft_lower: -1.6, soft_upper: 1.6}
  elbow: {soft_lower: -2.2, soft_upper: 2.2}
  wrist: {soft_lower: -1.2, soft_upper: 1.2, default_kp: 8, default_kd: 0.2}
backend:
  mode: real_time
  period: 0.001
  history: 16384
  access: owner
  late_action: {policy: stop, max_repeats: 10}
  max_skipped_ticks: 5
  max_late_steps: 10
  max_measurement_age: 0.005
  max_rejected_actions: 10
  first_action_timeout: .inf
stop:
  damping_time: 0.1
)";

constexpr const char* kBoards = R"(boards:
  bus: emulated
  interfaces: [can0, can1]
  max_current: 4
  silent_after: 0.005
  receive_timeout: 0.01
  move_time: 1
  self_test: false
  serial: any
  homing: {max_travel: 6, max_time: 20}
  motors:
    every_joint: {torque_constant: 0.05, polarity: 1, homing: {method: end_stop}}
    shoulder: {interface: can0, motor: 0, gear_ratio: 20, homing: {torque: 1.2, home_position: 2}}
    elbow: {interface: can0, motor: 1, gear_ratio: 15, polarity: -1, homing: {torque: -0.8, home_position: -2.5}}
    wrist: {interface: can1, motor: 1, gear_ratio: 5, torque_constant: 0.04, homing: {torque: 0.3, home_position: 1.5}}
)";

// Returns `text` with `to` in the place of `from`, which it must have.
std::string changed(std::string text, const std::string& from, const std::string& to) {
  const std::size_t place = text.find(from);
  EXPECT_NE(place, std::string::npos) << from;
  return text.replace(place, from.size(), to);
}

// A folder with a robot.
class Robots {
 public:
  [[nodiscard]] RobotConfig load(const std::string& text,
                                 const std::string& model = model_text()) const {
    write(folder_ / "arm.xml", model);
    write(folder_ / "arm.yml", text);
    return load_robot_config((folder_ / "arm.yml").string());
  }
  // Returns the error for this text, from the name of the file on.
  [[nodiscard]] std::string message(const std::string& text,
                                    const std::string& model = model_text()) const {
    const std::string found = message_of([&] { static_cast<void>(load(text, model)); });
    const std::size_t name = found.find("arm.yml");
    return name == std::string::npos ? found : found.substr(name);
  }

 private:
  Folder folder_;
};

RobotConfig desk_arm() { return Robots().load(std::string(kHead) + kBoards); }

// The robot and what its boards move.
struct ArmOnBoards : test::OnBoards {
  explicit ArmOnBoards(const RobotConfig& config) : ArmOnBoards(config, config.boards->options) {}
  ArmOnBoards(const RobotConfig& config, const BoardRobotOptions& options)
      : plant(config.simulation) {
    switch_on(options, plant);
    start(options);
  }

  DriverReport step(const void* action) {
    pass();
    const DriverReport measured = driver->get_latest_observation(&observation);
    if (measured.state != State::kReady) return measured;
    return driver->apply_action(action, &applied);
  }
  void stop() {
    for (TimeIndex i = 0; driver->stop(i).state == State::kBusy; ++i) pass();
  }
  // Steps until there is a fault, at most 2 s. Returns its text.
  std::string fault_of(const Action& action) {
    for (int i = 0; i < 2000; ++i) {
      const DriverReport report = step(&action);
      if (report.state == State::kFault) return std::string(driver->fault_text(report.fault_code));
    }
    return "no fault";
  }

  SimulatedPlant plant;
  Observation observation{};
  Applied applied{};
};

testing::AssertionResult is_prepared(ArmOnBoards& robot) {
  const DriverReport report = robot.prepare();
  if (report.state == State::kReady) return testing::AssertionSuccess();
  return testing::AssertionFailure()
         << (report.state == State::kBusy ? "it takes too long"
                                          : robot.driver->fault_text(report.fault_code));
}

void expect_true_positions(const ArmOnBoards& robot, double tolerance = 0.03) {
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(robot.observation.position[i], robot.plant.position()[i], tolerance) << i;
  }
}

// The emulator has the same options as the driver, so both would share an error in them.
TEST(FileRobotOnBoards, HasTheMotorsOfItsConfiguration) {
  const RobotConfig config = desk_arm();
  const BoardRobotOptions& options = config.boards->options;
  EXPECT_EQ(config.boards->bus, boards::BusKind::kEmulated);
  EXPECT_THAT(options.names, testing::ElementsAre("shoulder", "elbow", "wrist"));
  EXPECT_THAT(options.initial_position, testing::ElementsAre(0.3, -0.5, 0.2));
  ASSERT_EQ(options.motors.size(), 3U);
  const boards::BoardMotor& elbow = options.motors[1];
  EXPECT_EQ(elbow.place, (boards::Terminal{.board = 0, .number = 1}));
  EXPECT_EQ(elbow.polarity, -1.0);
  EXPECT_EQ(elbow.gear_ratio, 15.0);
  EXPECT_EQ(elbow.torque_constant, 0.05);
  EXPECT_EQ(elbow.homing.method, HomingMethod::kEndStop);
  EXPECT_EQ(elbow.homing.torque, -0.8);
  EXPECT_EQ(elbow.homing.home_position, -2.5);
  const boards::BoardMotor& wrist = options.motors[2];
  EXPECT_EQ(wrist.place, (boards::Terminal{.board = 1, .number = 1}));
  EXPECT_EQ(wrist.polarity, 1.0);
  EXPECT_EQ(wrist.torque_constant, 0.04);
}

TEST(FileRobotOnBoards, HasTheElementsOfTheSimulatedOne) {
  const RobotConfig config = desk_arm();
  const ArmOnBoards robot(config);
  const RobotTypes simulated = robot_types_of(config.simulation);
  EXPECT_EQ(robot.driver->description().type, "desk_arm");
  EXPECT_EQ(robot.driver->description().observation, simulated.observation);
  EXPECT_EQ(robot.driver->description().applied_action, simulated.applied_action);
  EXPECT_EQ(robot.driver->wear_description().type, "desk_arm_wear");
}

TEST(FileRobotOnBoards, StartsHomesAndFollowsActions) {
  const RobotConfig config = desk_arm();
  ArmOnBoards robot(config);
  ASSERT_TRUE(is_prepared(robot));
  EXPECT_TRUE(robot.driver->is_homed());
  Action action = Action::of_position({0.3, -0.5, 0.2});
  ASSERT_EQ(robot.step(&action).state, State::kReady);
  expect_true_positions(robot);
  for (int i = 0; i < 2000; ++i) {
    const double way = std::min(i / 1500.0, 1.0);
    action = Action::of_position({0.3 - 0.8 * way, -0.5 + 1.2 * way, 0.2 - 0.6 * way});
    const DriverReport report = robot.step(&action);
    ASSERT_EQ(report.state, State::kReady) << robot.driver->fault_text(report.fault_code);
  }
  expect_true_positions(robot);
  EXPECT_NEAR(robot.observation.position[0], -0.5, 0.1);
  EXPECT_NEAR(robot.observation.position[1], 0.7, 0.1);
  EXPECT_NEAR(robot.observation.position[2], -0.4, 0.1);
  // Each joint has a drive of its own between current and torque.
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(robot.observation.torque[i], robot.applied.torque[i], 0.05) << i;
  }
}

TEST(FileRobotOnBoards, PassesItsSelfTestWhereItHasMoreFrictionThanAFinger) {
  const RobotConfig config = Robots().load(
      std::string(kHead) + kBoards,
      changed(model_text(), "\"shoulder\" axis", "\"shoulder\" frictionloss=\"0.2\" axis"));
  BoardRobotOptions options = config.boards->options;
  options.weight = weight_of(make_model(config.simulation));
  ArmOnBoards robot(config, options);
  robot.driver->set_preparation({.test = true});
  ASSERT_TRUE(is_prepared(robot));
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(problem_of(robot.driver->report(i), options.motors[i].angle_per_revolution(), ""),
              "");
  }
  EXPECT_NEAR(robot.driver->report(0).sweep->friction, 0.2, 0.05);
}

TEST(FileRobotOnBoards, MayNotMixEndStopsWithOtherHomes) {
  const std::string text =
      changed(std::string(kHead) + kBoards, "homing: {torque: -0.8, home_position: -2.5}",
              "homing: {method: here, torque: 0.1, home_position: -0.5}");
  EXPECT_THAT(Robots().message(text),
              HasSubstr("joint 0 and joint 1 (elbow) find their homes in different ways"));
}

TEST(FileRobotOnBoards, MayFindTheHomeOfEachJointAtItsEndStopInAnotherWay) {
  const std::string text = changed(std::string(kHead) + kBoards, "home_position: 1.5}",
                                   "home_position: 1.5, method: released_end_stop}");
  ArmOnBoards robot(Robots().load(text));
  DriverReport report = DriverReport::busy();
  for (TimeIndex step = 0; report.state == State::kBusy; ++step) {
    robot.pass();
    report = robot.driver->prepare(step);
  }
  ASSERT_EQ(report.state, State::kReady) << robot.driver->fault_text(report.fault_code);
  const Action action = Action::of_position({0.3, -0.5, 0.2});
  ASSERT_EQ(robot.step(&action).state, State::kReady);
  EXPECT_NEAR(robot.observation.position[0], robot.plant.position()[0], 0.03);
  EXPECT_NEAR(robot.observation.position[2], robot.plant.position()[2], 0.05);
  EXPECT_NEAR(robot.observation.position[1], robot.plant.position()[1], 0.03);
}

TEST(FileRobotOnBoards, NamesTheJointsOfAFault) {
  const RobotConfig config = desk_arm();
  const Action hold = Action::of_position({0.3, -0.5, 0.2});
  {
    ArmOnBoards robot(config);
    ASSERT_TRUE(is_prepared(robot));
    robot.emulator->set_power(0, false, robot.clock.now());
    EXPECT_EQ(robot.fault_of(hold),
              "board 0 (can0, joints shoulder and elbow): no measurements come; check its supply "
              "and its cable, then recover");
    robot.stop();
    EXPECT_EQ(robot.driver->wear().faults, 1U);
    robot.emulator->set_power(true, robot.clock.now());
    ASSERT_TRUE(is_prepared(robot));
    EXPECT_EQ(robot.driver->wear().homings, 2U);
  }
  {
    ArmOnBoards robot(config);
    ASSERT_TRUE(is_prepared(robot));
    robot.emulator->add(boards::parse_fault("joint 1 jumps by 4 rad"), robot.clock.now());
    EXPECT_EQ(robot.fault_of(hold), "joint 1 (elbow) is beyond its hard limit");
  }
  BoardRobotOptions options = config.boards->options;
  options.max_travel = 0.3;
  ArmOnBoards robot(config, options);
  const DriverReport report = robot.prepare();
  ASSERT_EQ(report.state, State::kFault);
  EXPECT_THAT(std::string(robot.driver->fault_text(report.fault_code)),
              AllOf(HasSubstr("joint 2 (wrist)"), HasSubstr("did not find its end stop")));
}

TEST(FileRobotOnBoards, KeepsItsRunningHours) {
  const RobotConfig config = desk_arm();
  std::vector<std::byte> kept;
  for (std::uint64_t start = 1; start <= 2; ++start) {
    ArmOnBoards robot(config);
    robot.driver->continue_wear(kept);
    ASSERT_TRUE(is_prepared(robot));
    const boards::Wear& wear = robot.driver->wear();
    EXPECT_EQ(wear.starts, start);
    EXPECT_EQ(wear.homings, start);
    // Each joint turns its motor to the end stop and back, by its own gear.
    const double elbow = static_cast<double>(start) * 15.0 * 2.0 / (2.0 * 3.1416);
    EXPECT_GT(wear.revolutions[1], elbow);
    EXPECT_LT(wear.revolutions[1], 6.0 * elbow);
    kept = robot.driver->wear_bytes();
    ASSERT_EQ(kept.size(), robot.driver->wear_description().element.size());
  }
}

TEST(FileRobotOnBoards, DoesNotAllocateInTheLoop) {
  const RobotConfig config = desk_arm();
  BoardRobotOptions options = config.boards->options;
  options.weight = weight_of(make_model(config.simulation));
  ArmOnBoards robot(config, options);
  robot.pass();
  static_cast<void>(robot.driver->prepare(0));
  const AllocationCounter counter;
  DriverReport report = DriverReport::busy();
  for (TimeIndex step = 1; step < 60'000 && report.state == State::kBusy; ++step) {
    robot.pass();
    report = robot.driver->prepare(step);
  }
  Action action = Action::of_position({0.3, -0.5, 0.2});
  for (int i = 0; i < 100; ++i) static_cast<void>(robot.step(&action));
  static_cast<void>(robot.driver->hold(&robot.observation, &action));
  robot.stop();
  EXPECT_EQ(counter.count(), 0U);
  EXPECT_EQ(report.state, State::kReady);
}

TEST(FileRobotOnBoards, CarriesItsWeightByItsModelLikeATriFinger) {
  const RobotConfig trifinger =
      load_robot_config(TRIFINGER_CONFIG_DIR "/trifinger_edu_emulated.yml");
  const auto weight = weight_of(make_model(trifinger.simulation));
  Kinematics kinematics(trifinger.simulation.description);
  for (int pose = 0; pose < 20; ++pose) {
    std::vector<double> position;
    for (int i = 0; i < 9; ++i) position.push_back(1.2 * std::sin(pose + 0.7 * i));
    std::vector<double> torque(9);
    weight(position, torque);
    kinematics.update(JointValues::Map(position.data(), 9));
    const JointValues expected = kinematics.gravity_torques();
    for (int i = 0; i < 9; ++i) {
      EXPECT_NEAR(torque[static_cast<std::size_t>(i)], expected[i], 1e-12);
    }
  }
}

TEST(FileRobotOnBoards, ShowsNoAnglesOfJointsThatNobodyMeasures) {
  const std::string head =
      changed(kHead, "  mjcf: arm.xml\n", "  mjcf: arm.xml\n  joints: [shoulder, wrist]\n");
  std::string text = changed(changed(head, ", elbow: -0.5", ""),
                             "  elbow: {soft_lower: -2.2, soft_upper: 2.2}\n", "");
  const std::string elbow =
      "    elbow: {interface: can0, motor: 1, gear_ratio: 15, polarity: -1, "
      "homing: {torque: -0.8, home_position: -2.5}}\n";
  text += changed(kBoards, elbow, "");
  ArmOnBoards robot(Robots().load(text));
  std::vector<double> element(robot.driver->description().observation.size() / sizeof(double));
  ASSERT_EQ(element.size(), 3U * 2U + 2U * 3U);
  robot.pass();
  static_cast<void>(robot.driver->get_latest_observation(element.data()));
  EXPECT_EQ(element[6], element[0]);  // the shoulder
  EXPECT_TRUE(std::isnan(element[7]));
  EXPECT_EQ(element[8], element[1]);
  EXPECT_TRUE(std::isnan(element[10]));
}

TEST(FileRobotOnBoards, MayHaveAPeriodOfSomeMilliseconds) {
  const Robots robots;
  const RobotConfig config =
      robots.load(changed(kHead, "period: 0.001", "period: 0.004") + std::string(kBoards));
  EXPECT_EQ(config.simulation.file->period(), 4ms);
  const SimulatedPlant plant(config.simulation);
  EXPECT_EQ(plant.options().file->period(), 1ms);
}

// ---- what makes no sense ----

TEST(FileRobotOnBoards, IsRefusedWithThePlaceAndWhatIsAllowed) {
  const Robots robots;
  const auto with = [&](const std::string& from, const std::string& to) {
    return robots.message(kHead + changed(kBoards, from, to));
  };
  EXPECT_EQ(with("interface: can1", "interface: can2"),
            "arm.yml:38:24: boards.motors.wrist.interface is 'can2', must be 'can0' or 'can1'; did "
            "you mean "
            "'can0'?");
  EXPECT_EQ(with("motor: 1, gear_ratio: 5", "motor: 2, gear_ratio: 5"),
            "arm.yml:38:37: boards.motors.wrist.motor is 2, must be 0 to 1");
  EXPECT_EQ(with("polarity: -1", "polarity: 2"),
            "arm.yml:37:66: boards.motors.elbow.polarity is '2', must be '1' or '-1'");
  EXPECT_THAT(with("gear_ratio: 20, ", ""),
              AllOf(HasSubstr("arm.yml:36"), HasSubstr("boards.motors.shoulder.gear_ratio")));
  EXPECT_THAT(with("gear_ratio: 20", "gear_ration: 20"),
              AllOf(HasSubstr("arm.yml:36"), HasSubstr("gear_ration")));
  EXPECT_THAT(with("    wrist:", "    wirst:"),
              AllOf(HasSubstr("arm.yml:3"), HasSubstr("boards.motors.wrist")));
  EXPECT_THAT(with("method: end_stop", "method: touch"),
              AllOf(HasSubstr("arm.yml:35"), HasSubstr("'end_stop_index', 'end_stop'")));
  EXPECT_THAT(with("torque: 0.3", "torque: 1.5"),
              HasSubstr("homing.torque is 1.5 Nm for wrist, must be at most its "
                        "safety.max_torque (1 Nm)"));
  EXPECT_THAT(with("motor: 1, gear_ratio: 15", "motor: 0, gear_ratio: 15"),
              HasSubstr("joints 0 and 1 are on the same motor"));
  EXPECT_THAT(robots.message(kHead), HasSubstr("boards"));
  EXPECT_THAT(robots.message(changed(kHead, "driver: boards", "driver: can") + kBoards),
              HasSubstr("must be 'simulation', 'boards' or 'dynamixel'"));
  EXPECT_THAT(robots.message(changed(kHead, "period: 0.001", "period: 0.0005") + kBoards),
              AllOf(HasSubstr("arm.yml:2"), HasSubstr("whole number of milliseconds")));
  const std::string backend = std::string(kHead).substr(std::string(kHead).find("backend:"));
  EXPECT_THAT(robots.message(changed(kHead, backend, "") + kBoards), HasSubstr("backend"));
}

TEST(FileRobotOnBoards, IsToldKeysThatItsConfigurationHas) {
  const BoardRobotOptions arm = desk_arm().boards->options;
  EXPECT_EQ(arm.key_text("gear_ratio", 1), "boards.motors.elbow.gear_ratio");
  EXPECT_EQ(arm.key_text("homing.method"), "homing.method of each joint in boards.motors");
  const RobotConfig trifinger =
      load_robot_config(TRIFINGER_CONFIG_DIR "/trifinger_edu_emulated.yml");
  EXPECT_EQ(trifinger.boards->options.key_text("gear_ratio", 1), "boards.gear_ratio");
  EXPECT_EQ(trifinger.boards->options.key_text("homing.method"), "boards.homing.method");
}

TEST(FileRobotOnBoards, CannotSlide) {
  const std::string model =
      changed(model_text(), "name=\"wrist\" axis", "name=\"wrist\" type=\"slide\" axis");
  EXPECT_THAT(Robots().message(std::string(kHead) + kBoards, model),
              AllOf(HasSubstr("arm.yml:2"), HasSubstr("boards cannot drive wrist: it slides"),
                    HasSubstr("a board measures how far its motor turns")));
}

TEST(FileRobotOnBoards, HasACalibrationWithTheDriveOfEachJoint) {
  const RobotConfig config = desk_arm();
  BoardRobotOptions options = config.boards->options;
  options.motors[2].homing.method = HomingMethod::kReleasedEndStop;
  const auto calibration = boards::Calibration::of("desk-arm", "7", options, {1.9, -2.4, 1.4});
  EXPECT_THAT(calibration.text(),
              AllOf(HasSubstr("method: [end_stop, end_stop, released_end_stop]\n"),
                    HasSubstr("gear_ratio: [20, 15, 5]\n")));
  const Folder folder;
  boards::write_calibration(folder / "desk-arm.yml", calibration);
  const auto read = boards::read_calibration(folder / "desk-arm.yml");
  boards::calibrate(options, "desk-arm", read);
  EXPECT_EQ(options.motors[1].homing.home_position, -2.4);
  options.motors[1].gear_ratio = 16.0;
  EXPECT_THROW(boards::calibrate(options, "desk-arm", read), InvalidArgument);

  const RobotConfig trifinger =
      load_robot_config(TRIFINGER_CONFIG_DIR "/trifinger_edu_emulated.yml");
  EXPECT_THAT(boards::Calibration::of("t", "any", trifinger.boards->options, {}).text(),
              AllOf(HasSubstr("method: end_stop\n"), HasSubstr("gear_ratio: 9\n")));
}

// ---- a TriFinger, in two ways ----

// The section "boards" by the names of joints that says what `options` say.
std::string by_name(const BoardRobotOptions& options, const std::vector<std::string>& names) {
  std::string text =
      "interfaces: [can0, can1, can2, can3, can4, can5]\n"
      "tips: [[0, 0], [2, 0], [4, 0]]\ntip_zero: 0.05\ntip_scale: 5\n"
      "max_current: 2\nsilent_after: 0.1\nreceive_timeout: 0.1\nmove_time: 3\n"
      "self_test: false\nserial: any\nhoming: {max_travel: 8, max_time: 20}\nmotors:\n"
      "  every_joint: {gear_ratio: 9, torque_constant: 0.02, polarity: 1, "
      "homing: {method: end_stop}}\n";
  for (std::size_t i = 0; i < names.size(); ++i) {
    const boards::BoardMotor& motor = options.motors[i];
    text += "  " + names[i] + ": {interface: can" + std::to_string(motor.place.board) +
            ", motor: " + std::to_string(motor.place.number) +
            ", homing: {torque: " + std::to_string(motor.homing.torque) +
            ", home_position: " + std::to_string(motor.homing.home_position) + "}}\n";
  }
  return text;
}

TEST(TriFingerOnBoards, DoesTheSameWithTheListsOfItsConfigurationAndWithTheNamesOfItsJoints) {
  const RobotConfig config = load_robot_config(TRIFINGER_CONFIG_DIR "/trifinger_edu_emulated.yml",
                                               {"joints.friction=0.01"});
  const BoardRobotOptions& listed = config.boards->options;
  CountedDriverOptions robot = listed;
  robot.names = make_model(config.simulation)->joint_names();
  const std::vector<FieldDescription> tips{
      {.name = "tip_force", .type = ScalarType::kFloat64, .shape = {3}, .unit = "N", .offset = 0}};
  robot.types = describe_counted("trifinger", std::vector<JointKind>(9), tips);
  const config::File file = config::File::parse(by_name(listed, robot.names), "names");
  const BoardRobotOptions named = boards::read_board_options(file.root(), robot);
  file.reject_unknown_keys();

  ArmOnBoards one(config, listed);
  ArmOnBoards other(config, named);
  EXPECT_EQ(one.driver->description().observation, other.driver->description().observation);
  EXPECT_EQ(one.driver->description().applied_action, other.driver->description().applied_action);
  EXPECT_EQ(one.driver->wear_description().element, other.driver->wear_description().element);
  const auto expect_same = [](const auto& a, const auto& b) {
    return std::memcmp(&a, &b, sizeof(a)) == 0;
  };
  DriverReport report = DriverReport::busy();
  for (TimeIndex step = 0; report.state == State::kBusy; ++step) {
    one.pass();
    other.pass();
    report = one.driver->prepare(step);
    ASSERT_EQ(report.state, other.driver->prepare(step).state) << step;
  }
  ASSERT_EQ(report.state, State::kReady) << one.driver->fault_text(report.fault_code);
  for (TimeIndex step = 0; step < 1500; ++step) {
    TriFinger::Action action;
    for (std::size_t i = 0; i < 9; ++i) {
      action.torque[i] = 0.05 * std::sin(0.01 * static_cast<double>(step) + static_cast<double>(i));
      if (step % 500 > 250) action.position[i] = i % 3 == 2 ? -1.6 : 0.4;
    }
    if (step == 700) action.torque[4] = kNotGiven;
    TriFinger::Observation seen_by_one;
    TriFinger::Observation seen_by_other;
    TriFinger::AppliedAction applied_by_one;
    TriFinger::AppliedAction applied_by_other;
    one.pass();
    other.pass();
    report = one.driver->get_latest_observation(&seen_by_one);
    ASSERT_EQ(report.state, other.driver->get_latest_observation(&seen_by_other).state);
    ASSERT_TRUE(expect_same(seen_by_one, seen_by_other)) << step;
    report = one.driver->apply_action(&action, &applied_by_one);
    const DriverReport again = other.driver->apply_action(&action, &applied_by_other);
    ASSERT_EQ(report.action_rejected, again.action_rejected);
    ASSERT_EQ(report.action_rejected, step == 700);
    ASSERT_TRUE(expect_same(applied_by_one, applied_by_other)) << step;
  }
  one.stop();
  other.stop();
  EXPECT_EQ(one.driver->wear_bytes(), other.driver->wear_bytes());
  EXPECT_THAT(std::string(one.driver->rejection_text()), HasSubstr("torque of joint 4 is"));
  EXPECT_THAT(std::string(other.driver->rejection_text()),
              HasSubstr("torque of joint 4 (" + robot.names[4] + ") is"));
}

}  // namespace
}  // namespace trifinger::test
