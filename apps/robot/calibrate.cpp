// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "boards/calibration.hpp"
#include "commands.hpp"
#include "robot/maintenance.hpp"
#include "shared/external_command.hpp"
#include "shared/options.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::apps {
namespace {

struct CalibrateOptions : MaintenanceOptions {
  std::vector<double> pose{0.0};  // [rad]
  std::optional<std::string> serial;
  std::filesystem::path output;
};

// Repeats the angles that were given, for one joint or for one finger, for all `count` joints.
std::vector<double> repeated(const std::vector<double>& angles, std::size_t count) {
  if (angles.empty() || count % angles.size() != 0) {
    throw UsageError(fmt::format("--pose has {} angles, must have 1{} or {}", angles.size(),
                                 count > 3 && count % 3 == 0 ? ", 3" : "", count));
  }
  std::vector<double> pose;
  pose.reserve(count);
  for (std::size_t i = 0; i < count; ++i) pose.push_back(angles[i % angles.size()]);
  return pose;
}

// Throws UsageError, or InvalidArgument for a robot whose homing finds no places.
void require_reference(const boards::BoardRobotOptions& robot, const std::vector<double>& pose) {
  for (std::size_t i = 0; i < pose.size(); ++i) {
    const JointLimit& limit = robot.limits[i];
    if (robot.motors[i].homing.method == boards::HomingMethod::kHere) {
      // No joint has another one then.
      throw InvalidArgument(
          robot.key_text("homing.method") +
          " is 'here', which finds no place; choose one that does, such as end_stop_index");
    }
    if (pose[i] >= limit.hard_lower && pose[i] <= limit.hard_upper) continue;
    throw UsageError(
        fmt::format("--pose: {} is at {} rad, must be within its hard limits, {} to {} rad",
                    robot.joint_text(i).view(), pose[i], limit.hard_lower, limit.hard_upper));
  }
}

int calibrate(const CalibrateOptions& options) {
  const bool is_one_line = std::ranges::none_of(
      options.serial.value_or(""), [](unsigned char c) { return std::iscntrl(c) != 0; });
  if (!is_one_line) throw UsageError("--serial must be one line of text");
  ServicedRobot robot(options, /*is_calibrated=*/false);
  const std::filesystem::path path =
      options.output.empty() ? boards::calibration_file(robot.name()) : options.output;
  boards::BoardRobot& driver = robot.boards();
  const std::vector<double> pose = repeated(options.pose, driver.options().motors.size());
  require_reference(driver.options(), pose);
  driver.set_preparation({.reference = pose});
  robot.prepare();
  const auto calibration =
      boards::Calibration::of(robot.name(), options.serial.value_or(driver.options().serial),
                              driver.options(), driver.home_position());
  std::string angles;
  for (const double angle : calibration.home_position) angles += fmt::format(" {:.4f}", angle);
  robot.print("homes [rad]:" + angles);
  boards::write_calibration(path, calibration);
  robot.print(fmt::format("is at rest; its calibration is in {}", path.string()), Style::kGood);
  return kDone;
}

}  // namespace

void add_calibrate(CLI::App& program, Action& action) {
  const auto& [command, options] =
      add_command(program, action, "calibrate",
                  "Find out where the homes of a robot's joints are, and save it", calibrate);
  add_maintenance(command, options);
  command
      .add_option("--pose", options.pose,
                  "Angles of the reference [rad]: one, those of a finger, or all; default: 0")
      ->option_text("ANGLE ...");
  command
      .add_option("--serial", options.serial,
                  "What is written on the robot; default: boards.serial")
      ->option_text("TEXT");
  add_output(command, options.output,
             "File of the calibration; default: the one that 'trifinger run' reads");
  command.footer(
      "The motors let go. Put all joints at a reference whose angles are known, such as straight\n"
      "down with a gauge, hold them there, and press Enter. Take your hands away and press Enter\n"
      "again: the robot homes itself. The angles of its homes are saved with date and serial\n"
      "number, by default in ~/.config/trifinger/calibration, where 'trifinger run' finds them by\n"
      "the robot's name.\n"
      "Example:\n"
      "  trifinger calibrate trifinger_edu_can --serial 0042\n"
      "  trifinger calibrate ./my_robot.yml --pose 0 0.9 -1.7\n"
      "Cameras have a calibration of their own: 'trifinger calibrate cameras --help' tells more. "
      "So have\n"
      "the colours of objects: 'trifinger calibrate colours --help'.");
  declare_external(command);
}

}  // namespace trifinger::apps
