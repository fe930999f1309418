// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <cstddef>
#include <string>
#include <vector>

#include "commands.hpp"
#include "robot/maintenance.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/joint/counted.hpp"

namespace trifinger::apps {
namespace {

using HomeOptions = MaintenanceOptions;

int home(const HomeOptions& options) {
  ServicedRobot robot(options);
  robot.boards().set_preparation({.home = true});
  robot.prepare([&robot] {
    const UntypedFrontend session(robot.host(), {.control = false});
    std::vector<std::byte> element(robot.boards().description().observation.size());
    session.latest_observation(element.data(), kForever);
    CountedObservation observation(robot.boards().options().motors.size());
    read_element(element.data(), observation);
    std::string angles;
    for (const double angle : observation.position) angles += fmt::format(" {:.3f}", angle);
    robot.print("is home and at its initial position [rad]:" + angles, Style::kGood);
  });
  robot.print("is at rest");
  return kDone;
}

}  // namespace

void add_home(CLI::App& program, Action& action) {
  const auto& [command, options] =
      add_command(program, action, "home", "Home the joints of a robot on motor boards", home);
  add_maintenance(command, options);
  command.footer(
      "'trifinger run' homes the robot by itself when it is necessary. This command does it in "
      "any\n"
      "case, moves the robot to its initial position, and lets it go.\n"
      "Example:\n"
      "  trifinger home trifinger_edu_can");
}

}  // namespace trifinger::apps
