// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/hand.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Core>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "sim/bare_driver.hpp"
#include "sim/recording.hpp"
#include "sim/robots.hpp"
#include "support/allocation_counter.hpp"
#include "support/child_process.hpp"
#include "support/message_of.hpp"
#include "support/session_folder.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/errors.hpp"
#include "trifinger/core/sensor.hpp"
#include "trifinger/model/kinematics.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulation.hpp"

namespace trifinger::test {
namespace {

using namespace std::chrono_literals;
using Eigen::Vector3d;
using ::testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kGravity = 9.81;

Vector3d to_vector(const std::array<double, 3>& values) { return Vector3d(values.data()); }
std::array<double, 3> to_array(const Vector3d& values) {
  return {values.x(), values.y(), values.z()};
}

// A robot whose session says what a hand pulls.
SimulationOptions with_hand(Nanoseconds period = 1ms) {
  SimulationOptions options;
  options.has_hand = true;
  options.period = period;
  return options;
}

// One of each kind of object, and the lightest that a configuration allows.
std::vector<ObjectDescription> all_objects() {
  ObjectDescription light = cuboid("light");
  light.mass = 0.001;
  return {cube(), cuboid(), stick(), ball(), light};
}

// Calls the driver like the back-end, and keeps what the companion says.
class Pulled {
 public:
  explicit Pulled(SimulationOptions options) : driver(std::move(options)) { look(-1); }

  DriverReport step(const TriFinger::Action& action = {}) {
    const DriverReport report = driver.step(action);
    look(++step_);
    return report;
  }
  [[nodiscard]] SimulatedRobot& robot() { return driver.robot; }

  BareDriver<TriFinger> driver;
  HandObservation hand{};

 private:
  void look(TimeIndex step) {
    for (std::size_t i = 0; i < robot().companions().size(); ++i) {
      if (robot().companions()[i].name != kHandCompanion) continue;
      while (robot().get_companion_element(i, step, &hand)) {
        EXPECT_EQ(hand.stamp.arrival_index, step);
      }
    }
  }

  TimeIndex step_{-1};
};

// ---- what the force does ----

class HandOfAnyPeriod : public testing::TestWithParam<Nanoseconds> {};
INSTANTIATE_TEST_SUITE_P(Hand, HandOfAnyPeriod, testing::Values(1ms, 2ms, 5ms, 10ms));

TEST_P(HandOfAnyPeriod, GivesTheMomentumThatItsForceSaysItGives) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> offset(-0.1, 0.1);
  const double dt = std::chrono::duration<double>(GetParam()).count();
  for (const ObjectDescription& object : all_objects()) {
    SimulationOptions options = with_hand(GetParam());
    options.description.objects = {object};
    Pulled pulled(options);
    const double mass = object.mass;
    for (int attempt = 0; attempt < 10; ++attempt) {
      const Vector3d start(0.0, 0.0, 0.6);  // far from everything
      pulled.robot().place_object(object.name, {.position = to_array(start)});
      const Vector3d target = start + Vector3d(offset(random), offset(random), offset(random));
      pulled.robot().pull(object.name,
                          {.target = to_array(target),
                           .point = to_array(0.1 * Vector3d(offset(random), 0, offset(random))),
                           .stiffness = 200.0});
      Vector3d impulse = Vector3d::Zero();
      for (int i = 0; i < 20; ++i) {
        ASSERT_EQ(pulled.step().state, DriverReport::State::kReady);
        impulse += dt * (to_vector(pulled.hand.force) - mass * kGravity * Vector3d::UnitZ());
      }
      const Vector3d momentum =
          mass * to_vector(pulled.robot().object_velocity(object.name).linear);
      EXPECT_LT((momentum - impulse).norm(), 1e-6 * impulse.norm() + 1e-9) << object.name;
    }
  }
}

TEST_P(HandOfAnyPeriod, IsStableForAnyObjectPointAndStiffness) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> share(-1.0, 1.0);
  for (const ObjectDescription& object : all_objects()) {
    SimulationOptions options = with_hand(GetParam());
    options.description.objects = {object};
    for (const double stiffness : {1.0, 30.0, 300.0, 1000.0, kMaxPullStiffness}) {
      Pulled pulled(options);
      const Vector3d start(0.0, 0.0, 0.5);
      pulled.robot().place_object(object.name, {.position = to_array(start)});
      const Vector3d point = 0.03 * Vector3d(share(random), share(random), share(random));
      const Vector3d target = start + 0.3 * Vector3d(share(random), share(random), share(random));
      pulled.robot().pull(
          object.name,
          {.target = to_array(target), .point = to_array(point), .stiffness = stiffness});
      // A soft spring lets it fall first.
      const double fastest = 2.0 * kMaxPullSpeed + 3.5;
      for (Nanoseconds time = 0ns; time < 2s; time += GetParam()) {
        ASSERT_EQ(pulled.step().state, DriverReport::State::kReady)
            << object.name << ", " << stiffness << " N/m";
        ASSERT_LE(to_vector(pulled.hand.force).norm(), kMaxPullForce * (1 + 1e-9));
        ASSERT_LT(to_vector(pulled.robot().object_velocity(object.name).linear).norm(), fastest)
            << object.name << ", " << stiffness << " N/m";
      }
    }
  }
}

TEST_P(HandOfAnyPeriod, LetsAnObjectHangAtTheTargetWhereSpringAndWeightBalance) {
  for (const ObjectDescription& object : all_objects()) {
    SimulationOptions options = with_hand(GetParam());
    options.description.objects = {object};
    Pulled pulled(options);
    const Vector3d target(0.0, 0.0, 0.4);
    pulled.robot().place_object(object.name, {.position = {0.05, 0.0, 0.35}});
    pulled.robot().pull(object.name, {.target = to_array(target), .stiffness = 300.0});
    // The physics' step of 1 ms is too long for 300 N/m at a body of 1 g.
    const double stiffness = std::min(300.0, 0.25 * object.mass / 1e-6);
    for (Nanoseconds time = 0ns; time < 2s; time += GetParam()) static_cast<void>(pulled.step());
    const Vector3d sag = target - to_vector(pulled.robot().object_pose(object.name).position);
    const double weight = object.mass * kGravity;
    EXPECT_NEAR(sag.z(), weight / stiffness, 1e-6) << object.name;
    EXPECT_NEAR(sag.head<2>().norm(), 0.0, 1e-6) << object.name;
    EXPECT_NEAR(pulled.hand.force[2], weight, 1e-4) << object.name;
  }
}

TEST(Hand, DragsACubeAlongAPath) {
  Pulled pulled(with_hand());
  const Vector3d start = to_vector(pulled.robot().object_pose("cube").position);
  for (int i = 0; i < 4000; ++i) {
    const double angle = 2 * M_PI * i / 2000;
    // Up, then in a circle.
    const Vector3d target =
        start + Vector3d(0.05 * std::sin(angle), 0.0, 0.1 * std::min(1.0, i / 500.0));
    pulled.robot().pull("cube", {.target = to_array(target), .stiffness = 500.0});
    ASSERT_EQ(pulled.step().state, DriverReport::State::kReady);
    // The damper of 2 sqrt(k m) = 13.7 Ns/m lags by v / (k / c), 0.2 m/s at most.
    const Vector3d position = to_vector(pulled.robot().object_pose("cube").position);
    ASSERT_LT((position - target).norm(), 0.02) << i;
  }
}

TEST(Hand, HoldsATipWhereItsForceAndTheWeightOfTheLimpFingerBalance) {
  for (const Variant variant : kVariants) {
    SimulationOptions options = with_hand();
    options.description.variant = variant;
    options.description.objects.clear();
    Pulled pulled(options);
    Kinematics kinematics(options.description);
    const auto update = [&] {
      const auto& position = pulled.driver.observation.position;
      kinematics.update(JointValues::Map(position.data(), TriFinger::kJoints));
    };
    for (int finger = 0; finger < 3; ++finger) {
      pulled.driver.reset();
      update();
      const Vector3d target =
          kinematics.tip_positions().segment<3>(3 * finger) + Vector3d(0.0, 0.0, 0.02);
      const double stiffness = 400.0;
      pulled.robot().pull(finger, {.target = to_array(target), .stiffness = stiffness});
      for (int i = 0; i < 4000; ++i) {
        // The other fingers would fall into their stops.
        TriFinger::Action action = hold_position(pulled.driver.observation);
        for (int joint = 3 * finger; joint < 3 * finger + 3; ++joint) {
          action.position[static_cast<std::size_t>(joint)] = kNan;
        }
        ASSERT_EQ(pulled.step(action).state, DriverReport::State::kReady);
      }
      update();
      EXPECT_EQ(pulled.hand.body, finger);
      const Vector3d tip = kinematics.tip_positions().segment<3>(3 * finger);
      const Vector3d force = to_vector(pulled.hand.force);
      EXPECT_LT((stiffness * (target - tip) - force).norm(), 0.01) << force.transpose();
      // In equilibrium J^T F carries the weight.
      const Eigen::Vector3d carried =
          (kinematics.tip_jacobian(finger).transpose() * force).segment<3>(3 * finger);
      const Eigen::Vector3d weight = kinematics.gravity_torques().segment<3>(3 * finger);
      EXPECT_LT((carried - weight).norm(), 0.002)
          << carried.transpose() << " but the weight is " << weight.transpose();
    }
  }
}

TEST(Hand, DoesNotPullHarderOrFasterHoweverFarTheTargetIs) {
  for (const ObjectDescription& object : all_objects()) {
    SimulationOptions options = with_hand();
    options.description.objects = {object};
    options.description.boundary = false;
    Pulled pulled(options);
    pulled.robot().place_object(object.name, {.position = {0.0, 0.0, 0.6}});
    pulled.robot().pull(object.name, {.target = {9.0, 0.0, 0.6}, .stiffness = kMaxPullStiffness});
    for (int i = 0; i < 1000; ++i) {
      static_cast<void>(pulled.step());
      ASSERT_LE(to_vector(pulled.hand.force).norm(), kMaxPullForce * (1 + 1e-9));
      ASSERT_LT(pulled.robot().object_velocity(object.name).linear[0], 1.1 * kMaxPullSpeed);
    }
  }
}

// ---- what it leaves ----

TEST(Hand, MovesNothingWithASpringThatHasNoForce) {
  const SimulationOptions options = with_hand(5ms);
  Pulled without(options);
  Pulled with(options);
  with.robot().pull("cube", {.target = {0.0, 0.0, 0.3}, .stiffness = 1e-300});
  for (int i = 0; i < 200; ++i) {
    static_cast<void>(without.step());
    static_cast<void>(with.step());
    ASSERT_EQ(without.robot().configuration(), with.robot().configuration()) << i;
  }
}

TEST(Hand, LeavesSeriesBitForBitAsTheyAreWhileItDoesNotPull) {
  const SessionFolder folder;
  SimulationOptions options;
  options.seed = 3;
  options.object_position_noise = 1e-3;
  const auto play = [](const SimulationOptions& chosen, bool listens) {
    const Simulation simulation(chosen);
    if (listens) simulation.robot().listen_to_hand("sim");
    const Triple centre = simulation.robot().object_pose("cube").position;
    Poking<TriFinger> policy(chosen.description, centre, 1);
    auto robot = simulation.connect();
    Recording<TriFinger> recording;
    record(robot, policy, 500, recording);
    return recording;
  };
  const auto without = play(options, false);
  options.has_hand = true;
  EXPECT_EQ(first_difference(without, play(options, true)), "");
}

TEST(Hand, IsNoPartOfASavedStateSoAnObjectFallsFreelyFromIt) {
  Pulled pulled(with_hand());
  pulled.robot().place_object("cube", {.position = {0.0, 0.0, 0.6}});
  pulled.robot().pull("cube", {.target = {0.1, 0.0, 0.7}});
  for (int i = 0; i < 50; ++i) static_cast<void>(pulled.step());
  const SimulationState state = pulled.robot().save();

  Pulled fresh(with_hand());
  fresh.robot().restore(state);
  pulled.robot().restore(state);
  const ObjectVelocity before = fresh.robot().object_velocity("cube");
  for (int i = 0; i < 50; ++i) {
    static_cast<void>(fresh.step());
    static_cast<void>(pulled.step());
    ASSERT_EQ(fresh.robot().configuration(), pulled.robot().configuration());
  }
  const ObjectVelocity after = fresh.robot().object_velocity("cube");
  EXPECT_EQ(after.linear[0], before.linear[0]);
  EXPECT_NEAR(after.linear[2], before.linear[2] - 0.05 * kGravity, 1e-9);
  EXPECT_EQ(pulled.hand.body, -1);
}

TEST(Hand, HasNoPartInTheOrderlyStop) {
  SimulationOptions options = with_hand();
  options.stop.damping_time = 100ms;
  Pulled pulled(options);
  pulled.robot().place_object("cube", {.position = {0.0, 0.0, 0.5}});
  pulled.robot().pull("cube", {.target = {0.05, 0.0, 0.6}});
  for (int i = 0; i < 50; ++i) static_cast<void>(pulled.step());
  const ObjectVelocity before = pulled.robot().object_velocity("cube");
  ASSERT_GT(before.linear[0], 0.0);
  int steps = 0;
  while (pulled.robot().stop(steps).state == DriverReport::State::kBusy) {
    ++steps;
    const ObjectVelocity now = pulled.robot().object_velocity("cube");
    ASSERT_EQ(now.linear[0], before.linear[0]);
    ASSERT_NEAR(now.linear[2], before.linear[2] - 1e-3 * steps * kGravity, 1e-9);
  }
  EXPECT_GT(steps, 50);
}

TEST(Hand, EndsWithTheSessionWithAResetAndWithLetGo) {
  Pulled pulled(with_hand());
  const Pull pull{.target = {0.0, 0.0, 0.2}};
  const auto is_pulling = [&] {
    static_cast<void>(pulled.step());
    return pulled.hand.body >= 0;
  };
  pulled.robot().pull("cube", pull);
  EXPECT_TRUE(is_pulling());
  pulled.robot().let_go();
  EXPECT_FALSE(is_pulling());
  pulled.robot().pull("tip_2", pull);
  EXPECT_TRUE(is_pulling());
  EXPECT_EQ(pulled.hand.body, 2);
  pulled.robot().reset();
  EXPECT_FALSE(is_pulling());
  pulled.robot().pull("cube", pull);
  static_cast<void>(pulled.robot().prepare(0));
  EXPECT_FALSE(is_pulling());
}

// ---- what the companion says ----

TEST(Hand, SaysInItsCompanionWhatActedInEachStep) {
  const Simulation simulation(with_hand());
  auto robot = simulation.connect({.strict = false});
  const Companion<HandObservation> hand(robot.companion(kHandCompanion));
  const Pull pull{.target = {0.0, 0.1, 0.2}, .point = {0.01, 0.0, 0.0}, .stiffness = 123.0};
  TimeIndex t = robot.append_desired_action({});
  ASSERT_TRUE(hand.get_latest_at(t));
  EXPECT_EQ(hand.get_latest_at(t)->body, -1);
  static_cast<void>(robot.get_observation(t + 1));  // step t is over
  simulation.robot().pull("cube", pull);
  t = robot.append_desired_action({});
  static_cast<void>(robot.get_observation(t + 1));
  simulation.robot().let_go();
  const auto acted = hand.get_latest_at(t + 1);
  ASSERT_TRUE(acted);
  EXPECT_EQ(acted->stamp.capture_index, t);
  EXPECT_EQ(acted->body, 3);
  EXPECT_EQ(acted->process, 0);
  EXPECT_EQ(acted->target, pull.target);
  EXPECT_EQ(acted->point, pull.point);
  EXPECT_EQ(acted->stiffness, pull.stiffness);
  EXPECT_GT(acted->force[2], 0.0);
  t = robot.append_desired_action({});
  static_cast<void>(robot.get_observation(t + 1));
  EXPECT_EQ(hand.get_latest_at(t + 1)->body, -1);
  EXPECT_EQ(hand.get_latest_at(t + 1)->force, (std::array<double, 3>{}));
}

TEST(Hand, RefusesPullsThatMakeNoSenseAndSaysWhy) {
  SimulatedRobot robot(with_hand());
  const auto refusal = [&](const std::string& body, const Pull& pull) {
    return message_of<InvalidArgument>([&] {
      robot.pull(body, pull);
      return 0;
    });
  };
  EXPECT_EQ(refusal("cube", {}), "nothing");
  EXPECT_THAT(refusal("sphere", {}), HasSubstr("tip_0, tip_1, tip_2, cube"));
  for (const double bad : {kNan, kInfinity, -kInfinity, 1e300, 11.0}) {
    EXPECT_THAT(refusal("cube", {.target = {0, bad, 0}}), HasSubstr("the target of a pull is"));
    EXPECT_THAT(refusal("cube", {.point = {0, bad, 0}}), HasSubstr("the point of a pull is"));
    if (bad < 0 || bad != 11.0) {
      EXPECT_THAT(refusal("cube", {.stiffness = bad}), HasSubstr("the stiffness of a pull is"));
    }
  }
  EXPECT_THAT(refusal("cube", {.stiffness = 0}), HasSubstr("must be above 0"));
  EXPECT_THROW(robot.pull(4, {}), InvalidArgument);
  EXPECT_THROW(robot.pull(-1, {}), InvalidArgument);
}

// ---- a hand in another process ----

// A simulation with a name, as `trifinger run` runs it, whose steps the test does.
class RunningSimulation {
 public:
  explicit RunningSimulation(const std::vector<std::string>& overrides = {},
                             const std::string& name = "sim")
      : config_(load_robot_config(TRIFINGER_CONFIG_DIR "/sim.yml", overrides)),
        robot_(with_companion(config_)),
        host_(SessionHost::named(name, config_.session)),
        backend_(robot_, host_, {.mode = BackendOptions::Mode::kNonRealTime}),
        frontend_(std::in_place, backend_),
        hand_(frontend_->companion(kHandCompanion)) {
    robot_.listen_to_hand(name);
  }
  RunningSimulation(const RunningSimulation&) = delete;
  RunningSimulation& operator=(const RunningSimulation&) = delete;
  ~RunningSimulation() { frontend_.reset(); }

  // What acted in the next step.
  HandObservation step() {
    const TimeIndex t = frontend_->append_desired_action({});
    static_cast<void>(frontend_->get_observation(t + 1));
    return hand_.get_latest_at(t + 1).value();
  }
  // The first step in which the hand pulls, or does not.
  HandObservation step_until(bool pulls) {
    for (;;) {
      const HandObservation hand = step();
      if ((hand.body >= 0) == pulls) return hand;
      std::this_thread::sleep_for(1ms);
    }
  }
  [[nodiscard]] SimulatedRobot& robot() { return robot_; }

 private:
  static SimulationOptions with_companion(const RobotConfig& config) {
    auto options = config.simulation;
    options.has_hand = true;
    return options;
  }

  RobotConfig config_;
  SimulatedRobot robot_;
  SessionHost host_;
  Backend backend_;
  std::optional<Frontend<TriFinger>> frontend_;
  Companion<HandObservation> hand_;
};

constexpr Pull kLift{.target = {0.0, 0.0, 0.15}};

TEST(HandWriter, PullsARobotInAnotherPlace) {
  const SessionFolder folder;
  RunningSimulation sim;
  HandWriter hand("sim");
  EXPECT_THAT(hand.bodies(), ::testing::ElementsAre("tip_0", "tip_1", "tip_2", "cube"));
  EXPECT_EQ(sim.step().body, -1);
  hand.pull("cube", kLift);
  const HandObservation pulled = sim.step_until(true);
  EXPECT_EQ(pulled.body, 3);
  EXPECT_EQ(pulled.process, ::getpid());
  EXPECT_EQ(pulled.target, kLift.target);
  // A busy machine may take the writer for one that was stopped.
  for (int in_a_row = 0; in_a_row < 2000;) {
    const std::int64_t body = sim.step().body;
    ASSERT_TRUE(body == 3 || body == -1) << body;
    in_a_row = body == 3 ? in_a_row + 1 : 0;
  }
  EXPECT_NEAR(sim.robot().object_pose("cube").position[2], 0.15, 0.01);
  // What is written is there at the next step.
  hand.pull("tip_1", {.target = {0.0, 0.0, 0.1}, .stiffness = 50.0});
  EXPECT_EQ(sim.step().body, 1);
  hand.let_go();
  EXPECT_EQ(sim.step().body, -1);
}

TEST(HandWriter, LetsGoAfterItsTimeUnlessItPullsAgain) {
  const SessionFolder folder;
  RunningSimulation sim;
  HandWriter hand("sim");
  hand.pull("cube", kLift);
  sim.step_until(true);
  hand.pull("cube", kLift, 30ms);
  sim.step_until(false);
  hand.pull("cube", kLift, 30ms);
  hand.pull("cube", kLift);
  std::this_thread::sleep_for(100ms);  // nothing to wait for: nothing happens
  // At once, unless a busy machine takes the writer for one that was stopped.
  EXPECT_EQ(sim.step_until(true).body, 3);
}

TEST(HandWriter, PullsAsLongAsItsProcessLivesHoweverSlowTheStepsAre) {
  const SessionFolder folder;
  RunningSimulation sim;
  HandWriter hand("sim");
  hand.pull("cube", kLift);
  sim.step_until(true);
  // A step that takes long. A busy machine may stop the writer just then: once more.
  do {
    std::this_thread::sleep_for(3 * kHandTimeout);
  } while (sim.step().body < 0);
}

// A process that pulls.
class PullingProcess {
 public:
  PullingProcess()
      : child_([] {
          // The robot may not run yet.
          for (;;) {
            try {
              HandWriter hand("sim");
              hand.pull("cube", kLift);
              for (;;) ::pause();
            } catch (const SessionNotFound&) {
              std::this_thread::sleep_for(1ms);
            }
          }
          return 0;
        }) {}
  ChildProcess* operator->() { return &child_; }

 private:
  ChildProcess child_;
};

TEST(HandWriter, LetsGoWhenItsProcessIsKilled) {
  const SessionFolder folder;
  PullingProcess process;
  RunningSimulation sim;
  EXPECT_EQ(sim.step_until(true).process, process->pid());
  process->kill();
  sim.step_until(false);
  const double falls = sim.robot().object_velocity("cube").linear[2];
  EXPECT_EQ(sim.step().body, -1);
  EXPECT_LE(sim.robot().object_velocity("cube").linear[2], falls + 1e-3);
  // The next one may pull.
  HandWriter hand("sim");
  hand.pull("tip_0", kLift);
  EXPECT_EQ(sim.step_until(true).body, 0);
}

TEST(HandWriter, LetsGoWhenItsProcessIsStoppedAndPullsAgainWhenItGoesOn) {
  const SessionFolder folder;
  PullingProcess process;
  RunningSimulation sim;
  sim.step_until(true);
  process->send(SIGSTOP);
  sim.step_until(false);
  process->send(SIGCONT);
  sim.step_until(true);
}

TEST(HandWriter, IsRefusedWhileAnotherOneIsThereAndSaysWhichProcessThatIs) {
  const SessionFolder folder;
  RunningSimulation sim;
  std::optional<HandWriter> first(std::in_place, "sim");
  EXPECT_THAT(message_of<Error>([] { return HandWriter("sim").bodies(); }),
              HasSubstr(std::to_string(::getpid())));
  first.reset();
  HandWriter second("sim");
  second.pull("cube", kLift);
  EXPECT_EQ(sim.step_until(true).body, 3);
}

TEST(HandWriter, EndsWithItsObject) {
  const SessionFolder folder;
  RunningSimulation sim;
  {
    HandWriter hand("sim");
    hand.pull("cube", kLift);
    sim.step_until(true);
  }
  EXPECT_EQ(sim.step().body, -1);
}

TEST(HandWriter, IsRefusedByRobotsThatCannotBePulled) {
  const SessionFolder folder;
  EXPECT_THROW(HandWriter("sim"), SessionNotFound);
  RobotConfig config = load_robot_config(TRIFINGER_CONFIG_DIR "/sim.yml");
  SimulatedRobot robot;
  const SessionHost host = SessionHost::named("other", config.session);
  Backend backend(robot, const_cast<SessionHost&>(host),
                  {.mode = BackendOptions::Mode::kNonRealTime});
  const Frontend<TriFinger> frontend(backend);
  EXPECT_THAT(message_of<InvalidArgument>([] { return HandWriter("other").bodies(); }),
              HasSubstr("'other' cannot be pulled"));
}

TEST(HandWriter, WhatItWritesIsNotBelievedIfItMakesNoSense) {
  const SessionFolder folder;
  RunningSimulation sim;
  SensorWriter<HandObservation> hostile("sim", kHandCompanion);
  const auto write = [&](const HandObservation& hand) {
    hostile.write(std::chrono::steady_clock::now(), hand);
  };
  const HandObservation good{.body = 3, .target = {0.0, 0.0, 0.15}, .stiffness = 300.0};
  std::vector<HandObservation> bad(12, good);
  bad[0].body = 4;
  bad[1].body = std::numeric_limits<std::int64_t>::max();
  bad[2].body = std::numeric_limits<std::int64_t>::min();
  bad[3].target[1] = kNan;
  bad[4].target[2] = kInfinity;
  bad[5].target[0] = 1e200;
  bad[6].point[0] = kNan;
  bad[7].point[1] = -1e200;
  bad[8].stiffness = kNan;
  bad[9].stiffness = -300.0;
  bad[10].stiffness = 1e300;
  bad[11].stiffness = 0.0;
  // The robot has found the writer.
  while (sim.step().body < 0) {
    write(good);
    std::this_thread::sleep_for(1ms);
  }
  for (std::size_t i = 0; i < bad.size(); ++i) {
    write(good);
    // A busy machine may take this writer for one that was stopped.
    while (sim.step().body < 0) write(good);
    write(bad[i]);
    EXPECT_EQ(sim.step().body, -1) << i;
  }
}

TEST(HandWriter, NeedsNoMemoryInTheLoop) {
  const SessionFolder folder;
  RunningSimulation sim;
  HandWriter hand("sim");
  hand.pull("cube", kLift);
  sim.step_until(true);
  const TriFinger::Action action;
  TriFinger::AppliedAction applied;
  TriFinger::Observation observation;
  const AllocationCounter allocations;
  for (int i = 0; i < 100; ++i) {
    static_cast<void>(sim.robot().apply_action(&action, &applied));
    static_cast<void>(sim.robot().get_latest_observation(&observation));
  }
  EXPECT_EQ(allocations.count(), 0);
}

}  // namespace
}  // namespace trifinger::test
