// SPDX-License-Identifier: BSD-3-Clause
// The series keep which action was desired, which was applied, and why they differ.
#include <cstdlib>
#include <iostream>
#include <map>
#include <string>
#include <vector>

#include "trifinger/joint/reasons.hpp"
#include "trifinger/sim/simulation.hpp"

int main(int argument_count, char** arguments) {
  // The history is short here, to show what happens at its end. The default is 16384 steps.
  const trifinger::Simulation simulation({}, {.history = 256});
  // A robot of the name that this program is given has its own.
  const bool is_named = argument_count > 1;
  auto robot =
      is_named ? trifinger::connect<trifinger::TriFinger>(arguments[1]) : simulation.connect();

  auto good = trifinger::hold_position(robot.latest_observation());
  auto strong = good;
  strong.torque[2] = 5.0;  // more than the motor can deliver
  auto wrong = good;
  wrong.position_kp[0] =
      1e6;  // no gain that the robot accepts: joint 0 keeps its last target instead
  for (int i = 0; i < 300; ++i) robot.append_desired_action(good);
  for (int i = 0; i < 5; ++i) robot.append_desired_action(strong);
  robot.append_desired_action(wrong);
  const auto last = robot.append_desired_action(good);
  robot.finish();

  // One call reads a range of steps into memory of ours.
  const auto first = last - 99;
  std::vector<trifinger::TriFinger::AppliedAction> applied(100);
  std::vector<trifinger::Status> statuses(100);
  robot.get_applied_actions(first, applied);
  robot.get_statuses(first, statuses);

  // Every joint of an applied action has the reasons why it differs from the desired one.
  std::map<std::string, int> counts;
  for (const auto& action : applied) {
    for (const trifinger::Reason reason : trifinger::all_reasons()) {
      for (const std::uint64_t reasons : action.reasons) {
        if (has(reasons, reason)) ++counts[std::string(name_of(reason))];
      }
    }
  }
  for (const auto& [name, count] : counts) std::cout << name << ": " << count << "\n";

  int rejected = 0;
  for (std::size_t i = 0; i < statuses.size(); ++i) {
    if ((statuses[i].flags & trifinger::Status::kActionRejected) == 0) continue;
    ++rejected;
    std::cout << "the action of step " << first + static_cast<trifinger::TimeIndex>(i)
              << " was rejected: " << trifinger::names_of(applied[i].reasons[0]) << "\n";
  }

  // Reading steps that were overwritten throws.
  trifinger::TimeIndex oldest = -1;
  try {
    static_cast<void>(robot.get_observation(0));
  } catch (const trifinger::HistoryLost& error) {
    oldest = error.oldest();
    std::cout << error.what() << "\n";
  }
  return rejected == 1 && counts["kp_out_of_bounds"] == 1 && counts["torque_clipped"] >= 5 &&
                 (oldest > 0 || is_named)
             ? EXIT_SUCCESS
             : EXIT_FAILURE;
}
