// SPDX-License-Identifier: BSD-3-Clause
// One program controls two robots of different kinds on one machine, each at 1 kHz: an arm follows
// a finger of a TriFinger. Start both first: `trifinger run sim`, `trifinger run examples/arm.yml`.
//
// Each robot has a loop in a thread of its own, which only this robot paces. A loop that needs to
// know about the other robot reads its newest observation, which never waits. So nothing that
// happens to one robot can delay the other.
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <numbers>
#include <string>
#include <syncstream>
#include <thread>

#include "trifinger/core/frontend.hpp"
#include "trifinger/joint/types.hpp"

namespace {

// The arm comes from a file (arm.yml). C++ needs to know the number of its joints.
struct Arm : trifinger::JointRobot<2> {
  static constexpr std::string_view kType = "arm";
};

constexpr trifinger::TimeIndex kSteps = 2000;

// Lets the robot follow `target`, the positions of its joints in step t. Returns false if the robot
// stopped before its time.
template <class R, class Target>
bool control(trifinger::Frontend<R>& robot, const Target& target) {
  const std::string name = robot.session().info().name;
  try {
    trifinger::TimeIndex t = -1;
    do {
      t = robot.append_desired_action(R::Action::of_position(target(t + 1)));
      robot.wait_until_time_index(t);
    } while (t + 1 < kSteps);
    robot.finish();
    std::osyncstream(std::cout) << name << ": " << t + 1 << " steps\n";
    return true;
  } catch (const trifinger::Error& error) {
    std::osyncstream(std::cout) << error.what() << '\n';
    return false;
  }
}

}  // namespace

int main(int argument_count, char** arguments) {
  try {
    const bool are_named = argument_count > 2;
    auto fingers = trifinger::connect<trifinger::TriFinger>(are_named ? arguments[1] : "sim");
    auto arm = trifinger::connect<Arm>(are_named ? arguments[2] : "arm");

    // Finger 0 bends and stretches once per second.
    const auto begin = fingers.latest_observation().position;
    const auto wave = [&begin](trifinger::TimeIndex t) {
      const double phase = 2 * std::numbers::pi * static_cast<double>(t) / 1000;
      auto target = begin;
      target[2] += 0.3 * (1 - std::cos(phase));
      return target;
    };
    // The joints of the arm follow the last two of the finger.
    const auto shadow = [&fingers](trifinger::TimeIndex) {
      const auto finger = fingers.latest_observation().position;
      return trifinger::JointVector<2>{finger[1], finger[2]};
    };

    std::atomic<bool> fingers_are_done{false};
    std::thread other([&] { fingers_are_done = control(fingers, wave); });
    const bool arm_is_done = control(arm, shadow);
    other.join();
    return arm_is_done && fingers_are_done ? EXIT_SUCCESS : EXIT_FAILURE;
  } catch (const trifinger::Error& error) {
    std::cerr << error.what() << '\n';
    return EXIT_FAILURE;
  }
}
