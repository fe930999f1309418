// SPDX-License-Identifier: BSD-3-Clause
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
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulated_robot.hpp"
#include "trifinger/sim/simulation.hpp"

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

  [[nodiscard]] RobotConfig config(const std::string& robot = "",
                                   const std::string& more = "") const {
    write(folder_ / "arm.yml",
          "name: arm\ndriver: simulation\nrobot:\n  mjcf: arm.xml\n" + robot + kArmSafety + more);
    return load_robot_config((folder_ / "arm.yml").string());
  }

  Folder folder_;
};

// One step of a robot whose session has begun.
Observation observe(SimulatedRobot& robot) {
  Observation observation;
  EXPECT_EQ(robot.get_latest_observation(&observation).state, DriverReport::State::kReady);
  return observation;
}
Applied apply(SimulatedRobot& robot, const Action& action) {
  Applied applied;
  const DriverReport report = robot.apply_action(&action, &applied);
  EXPECT_EQ(report.state, DriverReport::State::kReady) << robot.fault_text(report.fault_code);
  return applied;
}

TEST_F(FileRobotTest, HasTheElementsOfARobotWithThatManyJoints) {
  const SimulatedRobot robot(config().simulation);
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
  SimulatedRobot robot(config().simulation);
  EXPECT_THAT(robot.initial_position(), ElementsAre(0.5, 1.0, 0.2, 0.0));
  EXPECT_THAT(observe(robot).joint_position, ElementsAre(0.0, 0.5, 1.0, 0.2, 0.2, 0.0));

  const SimulatedRobot other(
      config("  initial_position: {elbow: -1, finger: 0.7, flap: 0.3}\n").simulation);
  EXPECT_THAT(other.initial_position(), ElementsAre(0.5, -1.0, testing::DoubleEq(0.7), 0.0));
  EXPECT_THAT(message_of<Error>([&] {
                return SimulatedRobot(config("  initial_position: {elbow: 2.3}\n").simulation);
              }),
              HasSubstr("elbow begins at 2.3, its soft limits are -2.2 and 2.2"));
  EXPECT_EQ(message_of<InvalidArgument>([&] { robot.reset(std::vector{0.5, 1.0, 0.2, 3.0}, {}); }),
            "joint 3 (rail) cannot begin at 3 m, its hard limits are -2 and 2 m");
  EXPECT_EQ(message_of<InvalidArgument>([&] { robot.reset(std::vector{0.5, 1.0, 0.2}, {}); }),
            "position has 3 numbers, must have 4");
  EXPECT_THAT(message_of<Error>([&] { return config("  initial_position: {knee: 1}\n"); }),
              HasSubstr("knee"));
  EXPECT_THAT(
      message_of<Error>([&] { return SimulatedRobot(config("  keyframe: down\n").simulation); }),
      HasSubstr("no key frame 'down'"));
}

TEST_F(FileRobotTest, HasNoMoreJointsThanAnElementHas) {
  std::string bodies;
  for (std::size_t i = 0; i <= kMaxCountedJoints; ++i) {
    bodies += "<body pos='" + std::to_string(i) + " 0 0'><joint/><geom size='0.1'/></body>";
  }
  write(folder_ / "many.xml", "<mujoco><worldbody>" + bodies + "</worldbody></mujoco>");
  SimulationOptions options;
  options.file = std::make_shared<const ModelFile>(ModelFileOptions{.path = folder_ / "many.xml"});
  options.limits.emplace(kMaxCountedJoints + 1, config().simulation.limits->at(0));
  EXPECT_EQ(message_of<InvalidArgument>([&] { return Simulator(options); }),
            "the model has 129 driven joints, a robot has at most 128; name those to be driven "
            "(robot.joints)");
}

TEST_F(FileRobotTest, HasObjectsThatTheConfigurationAdds) {
  SimulatedRobot robot(config("", R"(objects:
  - {name: cube, type: cube, size: [0.06], mass: 0.1, position: [0.3, 0.3, 0.1]}
  - {name: pen, type: stick, position: [-0.3, 0.3, 0.02]}
  - {name: marble, type: ball, size: [0.04], position: [0, -0.5, 0.02], velocity: [0.2, 0, 0]}
)")
                           .simulation);
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
  SimulatedRobot robot(config().simulation);
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
  SimulatedRobot robot(config().simulation);
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
  SimulatedRobot robot(config().simulation);
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
      ASSERT_LE(std::abs(applied.torque[i]), robot.limits()[i].max_torque);
    }
    if (testing::Test::HasFailure()) FAIL() << "in step " << step;
  }
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_GT(least[i], robot.limits()[i].hard_lower) << i;
    EXPECT_LT(most[i], robot.limits()[i].hard_upper) << i;
  }
}

TEST_F(FileRobotTest, NamesTheJointAtFault) {
  SimulationOptions tight = config().simulation;
  JointLimit& elbow = tight.limits->at(1);
  elbow.soft_upper = elbow.hard_upper = 1.05;
  elbow.braking = std::numeric_limits<double>::infinity();
  elbow.safety_kd = 0.0;
  SimulatedRobot robot(tight);
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
  SimulatedRobot robot(config().simulation);
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
std::vector<double> series(SimulatedRobot& robot, int first, int last) {
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
  SimulatedRobot one(config().simulation);
  SimulatedRobot other(config().simulation);
  ASSERT_EQ(one.prepare(0).state, DriverReport::State::kReady);
  ASSERT_EQ(other.prepare(0).state, DriverReport::State::kReady);
  const std::vector<double> first = series(one, 0, 500);
  EXPECT_EQ(series(other, 0, 500), first);
  one.reset();
  ASSERT_EQ(one.prepare(0).state, DriverReport::State::kReady);
  EXPECT_EQ(series(one, 0, 500), first);
}

TEST_F(FileRobotTest, ContinuesFromASavedStateBitForBit) {
  SimulatedRobot robot(config().simulation);
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  (void)series(robot, 0, 200);
  const SimulationState state = robot.save();
  const std::vector<double> rest = series(robot, 200, 400);
  SimulatedRobot other(config().simulation);
  other.restore(state);
  ASSERT_EQ(other.prepare(0).state, DriverReport::State::kReady);
  EXPECT_EQ(series(other, 200, 400), rest);

  const RobotConfig faster =
      config("",
             "backend: {mode: real_time, period: 0.001, history: 64, access: owner, late_action: "
             "{policy: stop}, max_rejected_actions: 3, max_skipped_ticks: 1, max_late_steps: 1, "
             "max_measurement_age: .inf, first_action_timeout: 2}\n");
  SimulatedRobot different(faster.simulation);
  EXPECT_EQ(message_of<InvalidArgument>([&] {
              different.restore(state);
              return 0;
            }),
            "this state was saved from another model: another robot, other objects, or another "
            "object_period or object_delay");
}

TEST_F(FileRobotTest, ContinuesFromASavedStateWithItsVariation) {
  const Variation variation{.object_mass = 1.3,
                            .friction = 0.7,
                            .motor_gain = 0.9,
                            .torque_delay = 3,
                            .joint_damping = 1.5,
                            .joint_friction = 0.01};
  SimulatedRobot robot(config().simulation);
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  const std::vector<double> usual = series(robot, 0, 50);
  robot.reset();
  robot.vary(variation);
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  EXPECT_NE(series(robot, 0, 50), usual);
  const SimulationState state = robot.save();
  const std::vector<double> rest = series(robot, 50, 200);
  SimulatedRobot other(config().simulation);
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
  const Simulator simulator(config().simulation);
  const mjModel& original = *simulator.model().mujoco();
  const Variation variation{.rotor_inertia = 2.0, .joint_damping = 3.0};
  const SceneModel::Compiled varied = simulator.make_varied_model(variation);
  const SceneModel::Data data = simulator.model().make_data();
  simulator.vary(variation, *varied, *data);
  EXPECT_EQ(varied->actuator_armature[1], 2.0 * original.actuator_armature[1]);
  EXPECT_EQ(varied->actuator_damping[1], 3.0 * original.actuator_damping[1]);
  EXPECT_EQ(varied->actuator_dampingpoly[mjNPOLY], 3.0 * original.actuator_dampingpoly[mjNPOLY]);
  EXPECT_GT(original.actuator_dampingpoly[mjNPOLY], 0.0);
}

TEST_F(FileRobotTest, BeginsWithJointsWithoutMotorsElsewhere) {
  SimulatedRobot robot(config().simulation);
  const std::vector<double> position = robot.initial_position();
  robot.reset(position, {},
              std::vector<double>{kNotGiven, kNotGiven, kNotGiven, kNotGiven, kNotGiven, 0.25});
  EXPECT_EQ(observe(robot).joint_position[5], 0.25);
  EXPECT_THAT(observe(robot).position, testing::ElementsAreArray(position));
}

TEST_F(FileRobotTest, SaysWhereItsObjectsAre) {
  SimulatedRobot robot(config().simulation);
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

TEST_F(FileRobotTest, KnowsItsObjectsLateAndNotExactly) {
  struct Element {
    Stamp stamp;
    ObjectPose ball;
    ObjectPose brick;
  };
  const auto poses = [this](const std::string& more) {
    SimulatedRobot robot(config("",
                                "simulation: {object_period: 0.004, object_delay: 0.006, "
                                "object_position_noise: 0.01, " +
                                    more + "}\n")
                             .simulation);
    EXPECT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
    std::vector<Triple> positions;
    Element element;
    for (TimeIndex t = -1; t < 20; ++t) {
      (void)observe(robot);
      while (robot.get_companion_element(0, t, &element)) {
        EXPECT_EQ(element.stamp.arrival_index, t);
        EXPECT_EQ(element.stamp.capture_index, t < 0 ? -1 : t - 3);
        EXPECT_NE(element.ball.position[0], robot.object_pose("ball").position[0]);
        EXPECT_NEAR(element.ball.position[0], robot.object_pose("ball").position[0], 0.06);
        positions.push_back(element.ball.position);
      }
      (void)apply(robot, {});
    }
    return positions;
  };
  const std::vector<Triple> first = poses("seed: 1");
  EXPECT_EQ(first.size(), 1U + 9U);
  EXPECT_EQ(poses("seed: 1"), first);
  EXPECT_NE(poses("seed: 2"), first);
  EXPECT_EQ(poses("seed: 1, object_loss: 1").size(), 1U);
}

TEST_F(FileRobotTest, ComesToRestAfterASession) {
  const std::vector rest{0.2, 0.6, 0.8, 0.1};
  SimulatedRobot robot(
      config("", "stop: {damping_time: 0.1, rest_position: [0.2, 0.6, 0.8, 0.1], move_time: 4}\n")
          .simulation);
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  (void)series(robot, 0, 200);
  (void)observe(robot);
  TimeIndex step = 0;
  for (; robot.stop(step).state == DriverReport::State::kBusy; ++step) {
    const Observation y = observe(robot);
    for (std::size_t i = 0; i < kJoints; ++i) {
      ASSERT_LE(std::abs(y.torque[i]), robot.limits()[i].max_torque) << step;
    }
  }
  EXPECT_EQ(step, 50 + 2000);
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_NEAR(observe(robot).position[i], rest[i], 0.05) << i;
    EXPECT_NEAR(observe(robot).velocity[i], 0.0, 0.05) << i;
  }
}

TEST_F(FileRobotTest, HasObjectsThatAHandPulls) {
  SimulatedRobot robot(config("", "simulation: {hand: true}\n").simulation);
  ASSERT_EQ(robot.companions().size(), 2U);
  EXPECT_EQ(robot.companions()[1].name, kHandCompanion);
  ASSERT_EQ(robot.prepare(0).state, DriverReport::State::kReady);
  robot.pull("brick", {.target = {-0.5, 0.0, 0.4}, .stiffness = 500.0});
  HandObservation hand;
  for (TimeIndex t = 0; t < 1000; ++t) {
    (void)observe(robot);
    (void)robot.get_companion_element(1, t, &hand);
    (void)apply(robot, Action::of_position({0.5, 1.0, 0.2, 0.0}));
  }
  EXPECT_EQ(hand.body, 1);
  EXPECT_NEAR(robot.object_pose("brick").position[2], 0.4, 0.05);
  EXPECT_THAT(message_of<InvalidArgument>([&] { robot.pull("rail", {}); }), HasSubstr("brick"));
}

TEST_F(FileRobotTest, NeedsNoMemoryFromTheHeapInAStep) {
  SimulatedRobot robot(config().simulation);
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
  RobotConfig arm = config();
  const Simulation simulation(arm.simulation, arm.session, arm.backend, arm.name);
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
  SimulatedRobot robot(config().simulation);
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
