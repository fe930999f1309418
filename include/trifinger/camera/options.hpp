// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/camera/calibration.hpp"
#include "trifinger/camera/rendering_options.hpp"
#include "trifinger/camera/source.hpp"
#include "trifinger/config/node.hpp"

namespace trifinger::camera {

/// Where images come from.
enum class SourceKind : std::uint8_t {
  kSimulated,  ///< Drawn from a simulation.
  kAravis,     ///< Industrial cameras at USB or Ethernet (GenICam), through the library Aravis.
  kV4l2,       ///< Webcams and whatever else is a Video4Linux device.
  kFolder,     ///< PNG and JPEG files.
};

/// What only simulated cameras have.
struct SimulatedCameraOptions {
  Nanoseconds delay{0};  ///< Time from the middle of the exposure until the images arrive.
  /// Light, colours, noise and the like. Its exposure and gain mean nothing: those of the cameras
  /// count.
  RenderingOptions look{};
  bool varies{false};  ///< Light, colours, dust and noise differ in each session.
};

/// The section `cameras` of a robot's configuration. config/sim_cameras.yml documents every key.
struct CameraOptions {
  SourceKind source{SourceKind::kSimulated};
  /// "figures": those of the robot's model; "own": the file that `trifinger calibrate cameras` has
  /// written for this robot; otherwise the path of a file.
  std::string calibration{"figures"};
  Nanoseconds period{std::chrono::milliseconds(10)};
  Nanoseconds exposure{std::chrono::microseconds(1500)};
  double gain{0};             ///< [dB]
  std::optional<int> size{};  ///< Width of the images [pixel], if smaller than calibrated.
  std::optional<PixelFormat> pixels{};  ///< If other than calibrated.
  /// Column and row at which images of GenICam cameras begin on the sensor [pixel]. Default: where
  /// they do when a camera is first opened.
  std::optional<std::array<int, 2>> offset{};
  /// The device of each camera, in the order of the calibration: a serial number, or for
  /// Video4Linux the path of its device. Empty: the calibration says it.
  std::vector<std::string> devices{};
  std::filesystem::path folder{};  ///< Folder of images in files.
  SimulatedCameraOptions simulated{};
};

/// Reads the section `cameras`. Nothing is opened.
/// @throws config::ConfigError
[[nodiscard]] CameraOptions read_camera_options(const config::Node& section);

/// The cameras of the robot `robot` with the sizes, formats and devices of `options`. `figures`
/// gives the calibration of its model.
/// @throws InvalidArgument if they do not fit the calibration, config::ConfigError, SystemError
[[nodiscard]] Calibration resolve_calibration(const CameraOptions& options,
                                              const std::string& robot,
                                              const std::function<Calibration()>& figures);

/// Opens devices or files. `cameras` are those of `resolve_calibration`.
/// @throws InvalidArgument for simulated cameras, which need their simulation; Error that says what
/// is missing
[[nodiscard]] std::unique_ptr<Source> open_source(const CameraOptions& options,
                                                  const std::vector<Camera>& cameras);

/// A device that could be a camera.
struct DeviceInfo {
  std::string kind;    ///< "aravis" or "v4l2"
  std::string id;      ///< What `CameraOptions::devices` calls it.
  std::string name;    ///< Vendor and model.
  std::string detail;  ///< Address, formats.
};

/// All devices of all kinds. What hinders the search is in `warnings`, in sentences.
[[nodiscard]] std::vector<DeviceInfo> list_devices(std::vector<std::string>& warnings);

}  // namespace trifinger::camera
