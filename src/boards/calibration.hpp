// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "boards/board_robot.hpp"
#include "boards/homing.hpp"

namespace trifinger::boards {

/// The angles of one robot's joints where its homing finds them: its calibration, in a file of its
/// own.
struct Calibration {
  std::string robot;   ///< Name of the robot.
  std::string serial;  ///< What is written on it; "any" if nobody has said it.
  std::string date;    ///< When it was measured: "2026-11-22 21:50:00 UTC".
  // Homing finds other places with other values of these:
  std::vector<HomingMethod> method;  ///< Of each joint; in the file one word if all have the same.
  std::vector<double> direction;     ///< 1 or -1: sign of each homing torque.
  std::vector<double> polarity;      ///< 1 or -1, of each joint.
  std::vector<double> gear_ratio;  ///< Of each joint; in the file one number if all have the same.
  std::vector<double> home_position;  ///< Angle of each joint at its home [rad].

  /// The calibration of a robot whose homing has found these homes, with the present date.
  [[nodiscard]] static Calibration of(const std::string& robot, const std::string& serial,
                                      const BoardRobotOptions& options,
                                      std::vector<double> home_position);

  /// Returns the text of a file, in YAML.
  [[nodiscard]] std::string text() const;
};

/// The file with the calibration of the robot `robot`: NAME.yml in $TRIFINGER_CALIBRATION_DIR, else
/// in $XDG_CONFIG_HOME/trifinger/calibration, else in ~/.config/trifinger/calibration.
/// @throws InvalidArgument if the environment names no folder
[[nodiscard]] std::filesystem::path calibration_file(const std::string& robot);

/// Reads a calibration. @throws config::ConfigError at what makes no sense, SystemError
[[nodiscard]] Calibration read_calibration(const std::filesystem::path& path);

/// Replaces the file by `calibration`, or leaves it as it was. @throws SystemError
void write_calibration(const std::filesystem::path& path, const Calibration& calibration);

/// Gives a robot the homes of `calibration`.
/// @throws InvalidArgument if it is the calibration of another robot than `robot`, or if it was
/// measured with another homing
void calibrate(BoardRobotOptions& options, const std::string& robot,
               const Calibration& calibration);

}  // namespace trifinger::boards
