// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/file_robot.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "model/file_robots.hpp"
#include "sim/enemy.hpp"
#include "support/allocation_counter.hpp"
#include "support/folder.hpp"
#include "support/message_of.hpp"
#include "support/soak.hpp"
#include "trifinger/sim/any_robot_config.hpp"
#include "trifinger/sim/file_simulation.hpp"

namespace trifinger::test {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::size_t kJoints = 4;       // shoulder, elbow, finger, rail
constexpr std::size_t kModelJoints = 6;  // rail, shoulder, elbow, near, far, flap

using Action = JointAction<kJoints>;
using Applied = AppliedJointAction<kJoints>;

// What this robot measures, as a struct.
struct Observation {
  JointVector<kJoints> position{};
  JointVector<kJoints> velocity{};
  JointVector<kJoints> torque{};
  JointVector<kModelJoints> joint_position{};
  JointVector<kModelJoints> joint_velocity{};
};

class FileRobotTest : public testing::Test {
 protected:
  FileRobotTest() { write(folder_ / "arm.xml", kArm); }

  [[nodiscard]] FileRobotConfig config(const std::string& robot = "",
                                       const std::string& more = "") const {
    write(folder_ / "arm.yml",
          "name: arm\ndriver: simulation\nrobot:\n  mjcf: arm.xml\n" + robot + kArmSafety + more);
    return std::get<FileRobotConfig>(load_any_robot_config((folder_ / "arm.yml").string()));
  }

  Folder folder_;
};

// One step of a robot whose session has begun.
Observation observe(FileRobot& robot) {
  Observation observation;
  EXPECT_EQ(robot.get_latest_observation(&observation).state, DriverReport::State::kReady);
  return observation;
}
Applied apply(FileRobot& robot, const Action& action) {
  Applied applied;
  const DriverReport report = robot.apply_action(&action, &applied);
  EXPECT_EQ(report.state, DriverReport::State::kReady) << robot.fault_text(report.fault_code);
  return applied;
}

TEST_F(FileRobotTest, HasTheElementsOfARobotWithThatManyJoints) {
  const FileRobot robot(config().robot);
  const RobotTypes& types = robot.description();
  EXPECT_EQ(types.type, "some_arm");
  EXPECT_EQ(types.action.size(), sizeof(Action));
  EXPECT_EQ(types.applied_action.size(), sizeof(Applied));
  EXPECT_EQ(types.observation.size(), sizeof(Observation));
  EXPECT_EQ(types.observation.text(),
            "position float64[4] rad or m\n"
            "velocity float64[4] rad/s or m/s\n"
            "torque float64[4] Nm or N\n"
            "joint_position float64[6] rad or m\n"
            "joint_velocity float64[6] rad/s or m/s\n");
}

TEST_F(FileRobotTest, BeginsInTheFirstKeyFrameOrWhereItIsTold) {
  FileRobot robot(config().robot);
  EXPECT_THAT(robot.initial_position(), ElementsAre(0.5, 1.0, 0.2, 0.0));
  EXPECT_THAT(observe(robot).joint_position, ElementsAre(0.0, 0.5, 1.0, 0.2, 0.2, 0.0));

  const FileRobot other(config("  initial_position: {elbow: -1, finger: 0.7, flap: 0.3}\n").robot);
  EXPECT_THAT(other.initial_position(), ElementsAre(0.5, -1.0, testing::DoubleEq(0.7), 0.0));
  EXPECT_THAT(message_of<Error>(
                  [&] { return FileRobot(config("  initial_position: {elbow: 2.3}\n").robot); }),
              HasSubstr("elbow begins at 2.3, its soft limits are -2.2 and 2.2"));
  EXPECT_THAT(message_of<Error>([&] { return config("  initial_position: {knee: 1}\n"); }),
              HasSubstr("knee"));
  EXPECT_THAT(message_of<Error>([&] { return FileRobot(config("  keyframe: down\n").robot); }),
              HasSubstr("no key frame 'down'"));
}

TEST_F(FileRobotTest, HasNoMoreJointsThanAnElementHas) {
  std::string bodies;
  for (std::size_t i = 0; i <= kMaxCountedJoints; ++i) {
    bodies += "<body pos='" + std::to_string(i) + " 0 0'><joint/><geom size='0.1'/></body>";
  }
  write(folder_ / "many.xml", "<mujoco><worldbody>" + bodies + "</worldbody></mujoco>");
  FileRobotOptions options;
  options.model = std::make_shared<const ModelFile>(ModelFileOptions{.path = folder_ / "many.xml"});
  options.limits.assign(kMaxCountedJoints + 1, config().robot.limits[0]);
  EXPECT_EQ(message_of<InvalidArgument>([&] { return FileSimulator(options); }),
            "the model has 129 driven joints, a robot has at most 128; name those to be driven "
            "(robot.joints)");
}

TEST_F(FileRobotTest, HasObjectsThatTheConfigurationAdds) {
  FileRobot robot(config("", R"(objects:
  - {name: cube, type: cube, size: [0.06], mass: 0.1, position: [0.3, 0.3, 0.1]}
  - {name: pen, type: stick, position: [-0.3, 0.3, 0.02]}
  - {name: marble, type: ball, size: [0.04], position: [0, -0.5, 0.02], velocity: [0.2, 0, 0]}
)")
                      .robot);
  // The file's own come first, and all have a pose in the companion.
  ASSERT_EQ(robot.companions().size(), 1U);
  EXPECT_THAT(robot.companions()[0].element.text(),
              AllOf(HasSubstr("ball."), HasSubstr("brick."), HasSubstr("cube."), HasSubstr("pen."),
                    HasSubstr("marble.")));
  // The file's key frame still holds for what it says.
  EXPECT_THAT(robot.initial_position(), ElementsAre(0.5, 1.0, 0.2, 0.0));
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  for (int step = 0; step < 500; ++step) {
    (void)observe(robot);
    (void)apply(robot, Action::of_position({0.5, 1.0, 0.2, 0.0}));
  }
  EXPECT_NEAR(robot.object_pose("cube").position[2], 0.03, 1e-3);  // It has fallen.
  EXPECT_NEAR(robot.object_pose("pen").position[2], 0.005, 1e-3);
  EXPECT_GT(robot.object_pose("marble").position[0], 0.1);  // It rolls.
  EXPECT_THAT(message_of<Error>([&] { (void)config("", "objects: [{name: cube, type: cube}]\n"); }),
              HasSubstr("object 'cube' needs a position"));
}

TEST_F(FileRobotTest, HoldsItsPose) {
  FileRobot robot(config().robot);
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  const Observation first = observe(robot);
  Action hold;
  ASSERT_EQ(robot.hold(&first, &hold).state, DriverReport::State::kReady);
  EXPECT_NE(hold.torque[0], 0.0);
  for (int step = 0; step < 1000; ++step) {
    (void)observe(robot);
    (void)apply(robot, hold);
  }
  const Observation last = observe(robot);
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_NEAR(last.position[i], first.position[i], 0.01) << i;
  }
}

TEST_F(FileRobotTest, MovesToATarget) {
  FileRobot robot(config().robot);
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  const JointVector<kJoints> target{-0.3, 0.5, 0.8, 0.3};
  for (int step = 0; step < 2000; ++step) {
    (void)observe(robot);
    (void)apply(robot, Action::of_position(target));
  }
  // Gravity remains against springs.
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_NEAR(observe(robot).position[i], target[i], 0.15) << i;
  }
}

TEST_F(FileRobotTest, IsHeldByTheSafetyChainUnderHostileActions) {
  FileRobot robot(config().robot);
  const std::int64_t steps = repetitions(100'000, 1'000'000);
  Enemy enemy(1, kJoints);
  JointVector<kJoints> least = detail::filled<kJoints>(1e9);
  JointVector<kJoints> most = detail::filled<kJoints>(-1e9);
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  for (std::int64_t step = 0; step < steps; ++step) {
    const Observation y = observe(robot);
    for (std::size_t i = 0; i < kJoints; ++i) {
      least[i] = std::min(least[i], y.position[i]);
      most[i] = std::max(most[i], y.position[i]);
    }
    Action action;
    write_element(enemy.next(), &action);
    const Applied applied = apply(robot, action);
    for (std::size_t i = 0; i < kJoints; ++i) {
      ASSERT_LE(std::abs(applied.torque[i]), robot.options().limits[i].max_torque);
    }
    if (testing::Test::HasFailure()) FAIL() << "in step " << step;
  }
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_GT(least[i], robot.options().limits[i].hard_lower) << i;
    EXPECT_LT(most[i], robot.options().limits[i].hard_upper) << i;
  }
}

TEST_F(FileRobotTest, NamesTheJointAtFault) {
  FileRobotConfig tight = config();
  tight.robot.limits[1].soft_upper = tight.robot.limits[1].hard_upper = 1.05;
  tight.robot.limits[1].braking = std::numeric_limits<double>::infinity();
  tight.robot.limits[1].safety_kd = 0.0;
  FileRobot robot(tight.robot);
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  // The shoulder throws the elbow beyond its limit.
  DriverReport report;
  for (int step = 0; step < 2000 && report.state == DriverReport::State::kReady; ++step) {
    (void)observe(robot);
    Action action;
    action.torque[0] = step % 100 < 50 ? 12 : -12;
    action.torque[1] = 8;
    Applied applied;
    report = robot.apply_action(&action, &applied);
  }
  ASSERT_EQ(report.state, DriverReport::State::kFault);
  EXPECT_EQ(robot.fault_text(report.fault_code), "joint 1 (elbow) is beyond its hard limit");
}

TEST_F(FileRobotTest, SaysWhichJointsCommandWasRejected) {
  FileRobot robot(config().robot);
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  (void)observe(robot);
  Action action = Action::of_position({0, 0, 0.5, 0});
  action.position_kp[1] = 21.0;
  Applied applied;
  EXPECT_TRUE(robot.apply_action(&action, &applied).action_rejected);
  EXPECT_THAT(std::string(robot.rejection_text()),
              HasSubstr("position_kp of joint 1 (elbow) is 21"));
}

// The bytes of all elements of a session with these actions.
std::vector<double> series(FileRobot& robot, int first, int last) {
  std::vector<double> values;
  for (int step = first; step < last; ++step) {
    const Observation y = observe(robot);
    Enemy enemy(static_cast<std::uint32_t>(step), kJoints);
    Action action;
    write_element(enemy.next(), &action);
    const Applied applied = apply(robot, action);
    values.insert(values.end(), y.joint_position.begin(), y.joint_position.end());
    values.insert(values.end(), applied.torque.begin(), applied.torque.end());
    const ObjectPose ball = robot.object_pose("ball");
    values.insert(values.end(), ball.position.begin(), ball.position.end());
  }
  return values;
}

TEST_F(FileRobotTest, RepeatsItselfBitForBit) {
  FileRobot one(config().robot);
  FileRobot other(config().robot);
  ASSERT_EQ(one.prepare(0).state, DriverReport::State::kReady);
  ASSERT_EQ(other.prepare(0).state, DriverReport::State::kReady);
  const std::vector<double> first = series(one, 0, 500);
  EXPECT_EQ(series(other, 0, 500), first);
  one.reset();
  ASSERT_EQ(one.prepare(0).state, DriverReport::State::kReady);
  EXPECT_EQ(series(one, 0, 500), first);
}

TEST_F(FileRobotTest, ContinuesFromASavedStateBitForBit) {
  FileRobot robot(config().robot);
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  (void)series(robot, 0, 200);
  const SimulationState state = robot.save();
  const std::vector<double> rest = series(robot, 200, 400);
  FileRobot other(config().robot);
  other.restore(state);
  ASSERT_EQ(other.prepare(0).state, DriverReport::State::kReady);
  EXPECT_EQ(series(other, 200, 400), rest);

  const FileRobotConfig faster =
      config("",
             "backend: {mode: real_time, period: 0.001, history: 64, access: owner, late_action: "
             "{policy: stop}, max_rejected_actions: 3, max_skipped_ticks: 1, max_late_steps: 1, "
             "max_measurement_age: .inf, first_action_timeout: 2}\n");
  FileRobot different(faster.robot);
  EXPECT_EQ(message_of<InvalidArgument>([&] {
              different.restore(state);
              return 0;
            }),
            "this state was saved from another model");
}

TEST_F(FileRobotTest, ContinuesFromASavedStateWithItsVariation) {
  const Variation variation{.object_mass = 1.3,
                            .friction = 0.7,
                            .motor_gain = 0.9,
                            .torque_delay = 3,
                            .joint_damping = 1.5,
                            .joint_friction = 0.01};
  FileRobot robot(config().robot);
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  const std::vector<double> usual = series(robot, 0, 50);
  robot.reset();
  robot.vary(variation);
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  EXPECT_NE(series(robot, 0, 50), usual);
  const SimulationState state = robot.save();
  const std::vector<double> rest = series(robot, 50, 200);
  FileRobot other(config().robot);
  other.restore(state);
  ASSERT_EQ(other.prepare(0).state, DriverReport::State::kReady);
  EXPECT_EQ(series(other, 50, 200), rest);

  robot.vary({});
  robot.reset();
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  EXPECT_EQ(series(robot, 0, 50), usual);
  const auto refused = [&robot](const Variation& wanted) {
    return message_of<InvalidArgument>([&] {
      robot.vary(wanted);
      return 0;
    });
  };
  EXPECT_THAT(refused({.stop_margin = 0.5}), HasSubstr("stop_margin is for TriFingers"));
  EXPECT_THAT(refused({.motor_gain = -1.0}), HasSubstr("motor_gain"));
}

TEST_F(FileRobotTest, VariesRotorAndDampingThatTheFileGivesToAnActuator) {
  std::string text = kArm;
  const std::string motor = R"(name="drive")";
  text.insert(text.find(motor), R"(armature="0.5" damping="0.1 0.2" )");
  write(folder_ / "arm.xml", text);
  const FileSimulator simulator(config().robot);
  const mjModel& original = *simulator.model().mujoco();
  const RobotModel::Compiled varied = simulator.make_varied_model();
  const RobotModel::Data data = simulator.model().make_data();
  simulator.vary({.rotor_inertia = 2.0, .joint_damping = 3.0}, *varied, *data);
  EXPECT_EQ(varied->actuator_armature[1], 2.0 * original.actuator_armature[1]);
  EXPECT_EQ(varied->actuator_damping[1], 3.0 * original.actuator_damping[1]);
  EXPECT_EQ(varied->actuator_dampingpoly[mjNPOLY], 3.0 * original.actuator_dampingpoly[mjNPOLY]);
  EXPECT_GT(original.actuator_dampingpoly[mjNPOLY], 0.0);
}

TEST_F(FileRobotTest, BeginsWithJointsWithoutMotorsElsewhere) {
  FileRobot robot(config().robot);
  const std::vector<double> position = robot.initial_position();
  robot.reset(position,
              std::vector<double>{kNotGiven, kNotGiven, kNotGiven, kNotGiven, kNotGiven, 0.25});
  EXPECT_EQ(observe(robot).joint_position[5], 0.25);
  EXPECT_THAT(observe(robot).position, testing::ElementsAreArray(position));
}

TEST_F(FileRobotTest, SaysWhereItsObjectsAre) {
  FileRobot robot(config().robot);
  ASSERT_EQ(robot.companions().size(), 1U);
  EXPECT_EQ(robot.companions()[0].name, "object");
  EXPECT_THAT(robot.companions()[0].element.text(),
              HasSubstr("ball.position float64[3] m\nball.orientation float64[4]\nbrick."));
  robot.place_object("brick", {.position = {0.3, 0.2, 0.05}, .orientation = {2, 0, 0, 0}});
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  struct Element {
    Stamp stamp;
    ObjectPose ball;
    ObjectPose brick;
  } element;
  ASSERT_EQ(robot.companions()[0].element.size(), sizeof(element));
  ASSERT_TRUE(robot.get_companion_element(0, -1, &element));
  EXPECT_FALSE(robot.get_companion_element(0, -1, &element));
  EXPECT_THAT(element.brick.position, ElementsAre(0.3, 0.2, 0.05));
  EXPECT_EQ(element.brick.orientation[0], 1.0);
  EXPECT_TRUE(robot.get_companion_element(0, 0, &element));
  EXPECT_FALSE(robot.get_companion_element(0, 9, &element));
  EXPECT_TRUE(robot.get_companion_element(0, 10, &element));
  EXPECT_EQ(element.stamp.capture_index, 10);
  EXPECT_THAT(message_of<InvalidArgument>([&] { return robot.object_pose("cube"); }),
              HasSubstr("the scene has ball, brick"));
}

TEST_F(FileRobotTest, NeedsNoMemoryFromTheHeapInAStep) {
  FileRobot robot(config().robot);
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  (void)series(robot, 0, 100);
  Observation observation;
  Applied applied;
  Action action;
  const AllocationCounter allocations;
  (void)robot.get_latest_observation(&observation);
  (void)robot.hold(&observation, &action);
  (void)robot.apply_action(&action, &applied);
  EXPECT_EQ(allocations.count(), 0U);
}

TEST_F(FileRobotTest, RunsASessionLikeAnyOther) {
  FileRobotConfig arm = config();
  const FileSimulation simulation(arm.robot, arm.session, arm.backend, arm.name);
  UntypedFrontend frontend = simulation.connect_untyped();
  const Action action = Action::of_position({0.4, 0.9, 0.3, 0.1});
  TimeIndex t = 0;
  for (int step = 0; step < 20; ++step) {
    t = frontend.append_desired_action(&action, kForever);
  }
  Observation observation;
  frontend.get(Series::kObservation, t, &observation, kForever);
  EXPECT_NE(observation.position[3], 0.0);
  const auto documents = frontend.session().documents();
  ASSERT_EQ(documents.size(), 2U);
  EXPECT_EQ(documents[1].name, "model.xml");
  EXPECT_THAT(documents[1].text, HasSubstr("shoulder"));
}

TEST_F(FileRobotTest, LetsOwnChecksChangeAnAction) {
  FileRobot robot(config().robot);
  robot.add_check([](const void* observation, void* action) {
    Observation y;
    std::memcpy(&y, observation, sizeof(y));
    EXPECT_EQ(y.joint_position[1], y.position[0]);
    Action changed;
    std::memcpy(&changed, action, sizeof(changed));
    changed.torque[1] = 0.25;
    std::memcpy(action, &changed, sizeof(changed));
  });
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  (void)observe(robot);
  const Applied applied = apply(robot, Action{});
  EXPECT_EQ(applied.torque[1], 0.25);
  EXPECT_TRUE(has(applied.reasons[1], Reason::kOwnCheck));
}

}  // namespace
}  // namespace trifinger::test
