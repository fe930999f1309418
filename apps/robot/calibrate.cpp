// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "commands.hpp"
#include "robot/maintenance.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/boards/calibration.hpp"

namespace trifinger::apps {
namespace {

struct CalibrateOptions : MaintenanceOptions {
  std::vector<double> pose{0.0};  // [rad]
  std::optional<std::string> serial;
  std::optional<std::filesystem::path> to;
};

// Repeats the angles that were given, for one joint or for one finger, for all joints.
template <std::size_t N>
JointVector<N> repeated(const std::vector<double>& angles) {
  if (angles.empty() || N % angles.size() != 0) {
    throw UsageError(fmt::format("--pose has {} angles, must have 1, 3 or {}", angles.size(), N));
  }
  JointVector<N> pose{};
  for (std::size_t i = 0; i < N; ++i) pose[i] = angles[i % angles.size()];
  return pose;
}

int calibrate(const CalibrateOptions& options) {
  ServicedRobot robot(options, /*is_calibrated=*/false);
  const std::filesystem::path path = options.to.value_or(boards::calibration_file(robot.name()));
  robot.visit([&]<class R>(boards::BoardRobot<R>& boards) {
    boards.set_preparation({.reference = repeated<R::kJoints>(options.pose)});
  });
  robot.prepare([] {}, "put all joints at the reference, hold them there, and press Enter");
  robot.visit([&]<class R>(const boards::BoardRobot<R>& boards) {
    const std::string serial = options.serial.value_or(boards.options().serial);
    const auto calibration =
        boards::Calibration::of(robot.name(), serial, boards.options(), boards.home_position());
    boards::write_calibration(path, calibration);
    std::string angles;
    for (const double angle : calibration.home_position) angles += fmt::format(" {:.4f}", angle);
    robot.print("homes [rad]:" + angles);
  });
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
  command
      .add_option("--to", options.to,
                  "File of the calibration; default: the one that 'trifinger run' reads")
      ->option_text("FILE");
  command.footer(
      "The motors let go, you put all joints at a reference whose angles are known, such as "
      "straight\n"
      "down with a gauge, and press Enter. The robot then homes itself: end stops push it, so "
      "keep\n"
      "your hands away. The angles of its homes are saved with date and serial number, by default "
      "in\n"
      "~/.config/trifinger/calibration, where 'trifinger run' finds them by the robot's name.\n"
      "Example:\n"
      "  trifinger calibrate trifinger_edu_can --serial 0042\n"
      "  trifinger calibrate ./my_robot.yml --pose 0 0.9 -1.7");
}

}  // namespace trifinger::apps
