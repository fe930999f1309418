// SPDX-License-Identifier: BSD-3-Clause
// Tests the driver of my_robot in this process, without waiting for real time.
#include "my_robot.hpp"

#include <cmath>
#include <iostream>
#include <limits>
#include <string>

#include "trifinger/core/frontend.hpp"

namespace {

int failures = 0;

void expect(bool is_so, const std::string& what) {
  if (is_so) return;
  std::cerr << "FAILED: " << what << '\n';
  ++failures;
}

// The robot with a back-end that waits for each action.
class Rig {
 public:
  explicit Rig(const std::string& path) : config_(waiting(MyRobotConfig::load(path))) {}

  const MyRobotConfig& config() const { return config_; }
  trifinger::Frontend<MyRobot>& robot() { return robot_; }

 private:
  static MyRobotConfig waiting(MyRobotConfig config) {
    config.backend.mode = trifinger::BackendOptions::Mode::kNonRealTime;
    return config;
  }

  MyRobotConfig config_;
  MyRobotDriver driver_{config_};
  trifinger::SessionHost host_{trifinger::SessionHost::anonymous(config_.session)};
  trifinger::Backend backend_{driver_, host_, config_.backend};
  trifinger::Frontend<MyRobot> robot_{backend_};
};

void moves_to_a_target(const std::string& path) {
  Rig rig(path);
  MyRobotJoints target{};
  target[0] = 0.5;
  trifinger::TimeIndex t = 0;
  while (t < 3000) t = rig.robot().append_desired_action(MyRobot::Action::of_position(target));
  const auto reached = rig.robot().get_observation(t).position;
  for (std::size_t i = 0; i < target.size(); ++i) {
    expect(std::abs(reached[i] - target[i]) < 0.05, "joint " + std::to_string(i) + " is at " +
                                                        std::to_string(reached[i]) +
                                                        " rad after 3000 steps");
  }
}

void stays_within_its_limits_whatever_is_asked(const std::string& path) {
  Rig rig(path);
  MyRobotJoints much{};
  much.fill(1e9);
  for (int step = 0; step < 3000; ++step) {
    const auto t = rig.robot().append_desired_action(MyRobot::Action::of_torque(much));
    const auto measured = rig.robot().get_observation(t);
    const auto applied = rig.robot().get_applied_action(t);
    for (std::size_t i = 0; i < much.size(); ++i) {
      const trifinger::JointLimit& limit = rig.config().limits[i];
      expect(std::abs(applied.torque[i]) <= limit.max_torque, "the torque is within its limit");
      expect(measured.position[i] < limit.hard_upper, "the joint is within its hard limit");
    }
  }
}

void stops_after_many_actions_that_make_no_sense(const std::string& path) {
  Rig rig(path);
  MyRobotJoints nonsense{};
  nonsense.fill(std::numeric_limits<double>::infinity());
  try {
    for (int step = 0; step < 100; ++step) {
      const auto t = rig.robot().append_desired_action(MyRobot::Action::of_torque(nonsense));
      rig.robot().wait_until_time_index(t);
    }
    expect(false, "the session ended");
  } catch (const trifinger::RobotStopped& stopped) {
    const std::string why = stopped.what();
    expect(why.find(MyRobot::kJointNames[0]) != std::string::npos, "it says which joint: " + why);
  }
}

}  // namespace

int main(int argument_count, char** arguments) {
  if (argument_count != 2) {
    std::cerr << "usage: my_robot_test my_robot.yml\n";
    return 2;
  }
  moves_to_a_target(arguments[1]);
  stays_within_its_limits_whatever_is_asked(arguments[1]);
  stops_after_many_actions_that_make_no_sense(arguments[1]);
  std::cout << (failures == 0 ? "all passed" : "some failed") << '\n';
  return failures == 0 ? 0 : 1;
}
