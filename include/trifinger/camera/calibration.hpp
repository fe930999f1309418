// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "trifinger/camera/camera.hpp"
#include "trifinger/config/node.hpp"

namespace trifinger::camera {

/// The cameras of a robot as they were calibrated, in the order of its images.
struct Calibration {
  std::string date;    ///< When it was measured: "2026-11-22 21:50:00 UTC"; empty if unknown.
  double residual{0};  ///< Root mean square of what the calibration could not explain [pixel].
  std::vector<Camera> cameras;

  /// Returns the text of a file, in YAML.
  [[nodiscard]] std::string text() const;
};

/// Reads the section or file of a calibration.
/// @throws config::ConfigError at what makes no sense
[[nodiscard]] Calibration read_calibration(const config::Node& node);
/// Reads a file that `Calibration::text` has written.
/// @throws config::ConfigError at what makes no sense, SystemError
[[nodiscard]] Calibration read_calibration(const std::filesystem::path& path);

/// The file with the calibration of the cameras of the robot `robot`: ROBOT.cameras.yml in the
/// folder of calibrations, $TRIFINGER_CALIBRATION_DIR or ~/.config/trifinger/calibration.
/// @throws InvalidArgument if the environment names no folder
[[nodiscard]] std::filesystem::path calibration_file(const std::string& robot);

}  // namespace trifinger::camera
