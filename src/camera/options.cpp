// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/camera/options.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <system_error>
#include <type_traits>
#include <utility>

#include "aravis_device.hpp"
#include "base/text_of.hpp"
#include "camera/device.hpp"
#include "camera/folder_source.hpp"
#include "trifinger/base/error.hpp"
#include "video_device.hpp"

namespace trifinger::camera {
namespace {

using trifinger::detail::text_of;

Nanoseconds in_nanoseconds(double seconds) {
  return std::chrono::round<Nanoseconds>(std::chrono::duration<double>(seconds));
}

// Exposure and gain are keys of all cameras.
void read_look(const config::Node& section, RenderingOptions& look) {
  const auto read = [&section, &look]<class T>(const RenderingField<T>& row) {
    if constexpr (!std::is_same_v<T, Nanoseconds>) {
      if (std::string_view(row.name) == "gain") return;
      const std::optional<config::Node> value = section.find(row.name);
      if (!value) return;
      if constexpr (std::is_same_v<T, bool>) {
        look.*row.value = value->as<bool>();
      } else {
        const bool has_bounds = row.low < row.high;
        look.*row.value = value->as<T>(has_bounds ? config::Range{.min = row.low, .max = row.high}
                                                  : config::Range{});
      }
    }
  };
  std::apply([&read](const auto&... row) { (read(row), ...); }, RenderingOptions::fields());
  try {
    look.validate();
  } catch (const InvalidArgument& error) {
    section.fail(std::string("does not fit: ") + error.what());
  }
}

Calibration chosen_calibration(const CameraOptions& options, const std::string& robot,
                               const std::function<Calibration()>& figures) {
  if (options.calibration == "figures") return figures();
  if (options.calibration != "own") return read_calibration(options.calibration);
  const std::filesystem::path path = calibration_file(robot);
  std::error_code ignored;
  if (std::filesystem::symlink_status(path, ignored).type() ==
      std::filesystem::file_type::not_found) {
    throw InvalidArgument("the cameras of robot '" + robot +
                          "' have not been calibrated: there is "
                          "no " +
                          path.string() +
                          "; 'trifinger calibrate cameras' measures them, "
                          "and cameras.calibration=figures does without");
  }
  return read_calibration(path);
}

// The device of a camera. Its calibration is good for no other.
std::string device_of(const Camera& camera, const std::string& wanted) {
  if (wanted.empty() || wanted == "any") return camera.serial;
  const bool is_path = wanted.starts_with('/');
  if (!is_path && camera.serial != "any" && camera.serial != wanted) {
    throw InvalidArgument(camera.name + " was calibrated with serial number " + camera.serial +
                          ", but is to be " + wanted +
                          "; correct cameras.devices, or calibrate the cameras again");
  }
  return wanted;
}

// A device that is named is that camera's.
std::shared_ptr<Claims> claims_of_names(const std::vector<Camera>& cameras) {
  std::set<std::string> names;
  for (const Camera& camera : cameras) {
    if (camera.serial == "any") continue;
    names.insert(camera.serial);
    // Links such as /dev/v4l/by-id/... say for good which device is meant.
    std::error_code error;
    const std::filesystem::path path = std::filesystem::canonical(camera.serial, error);
    if (!error) names.insert(path.string());
  }
  return std::make_shared<Claims>(std::move(names));
}

std::unique_ptr<Source> open_video(const CameraOptions& options,
                                   const std::vector<Camera>& cameras) {
  const std::vector<DeviceInfo> found = list_video_devices();
  const std::shared_ptr<Claims> claims = claims_of_names(cameras);
  std::vector<std::unique_ptr<Device>> devices;
  devices.reserve(cameras.size());
  for (const Camera& camera : cameras) {
    std::string path = camera.serial;
    if (path == "any") {
      const auto free = std::ranges::find_if(
          found, [&](const DeviceInfo& device) { return claims->take({}, device.id); });
      detail::require(free != found.end(),
                      text_of("there is no device for ", camera.name, ": Video4Linux has ",
                              found.size(), " cameras, needed are ", cameras.size(),
                              "; connect them, or name them in cameras.devices"));
      path = free->id;
    }
    devices.push_back(std::make_unique<VideoDevice>(VideoSettings{.path = path,
                                                                  .format = camera.format,
                                                                  .period = options.period,
                                                                  .exposure = options.exposure}));
  }
  return std::make_unique<CameraGroup>(cameras, std::move(devices), options.period);
}

std::unique_ptr<Source> open_aravis(const CameraOptions& options,
                                    const std::vector<Camera>& cameras) {
  const std::shared_ptr<Claims> claims = claims_of_names(cameras);
  std::vector<std::unique_ptr<Device>> devices;
  devices.reserve(cameras.size());
  for (const Camera& camera : cameras) {
    devices.push_back(std::make_unique<AravisDevice>(AravisSettings{.device = camera.serial,
                                                                    .claims = claims,
                                                                    .format = camera.format,
                                                                    .offset = options.offset,
                                                                    .period = options.period,
                                                                    .exposure = options.exposure,
                                                                    .gain = options.gain}));
  }
  return std::make_unique<CameraGroup>(cameras, std::move(devices), options.period);
}

}  // namespace

CameraOptions read_camera_options(const config::Node& section) {
  CameraOptions options;
  options.source =
      section.required_choice<SourceKind>("source", {{"simulated", SourceKind::kSimulated},
                                                     {"aravis", SourceKind::kAravis},
                                                     {"v4l2", SourceKind::kV4l2},
                                                     {"folder", SourceKind::kFolder}});
  options.calibration = section.optional<std::string>("calibration", options.calibration);
  const auto rate =
      section.optional<double>("rate", 100.0, {.unit = "Hz", .min = 0.1, .max = 1000});
  options.period = in_nanoseconds(1 / rate);
  options.exposure = in_nanoseconds(
      section.optional<double>("exposure", 0.0015, {.unit = "s", .min = 1e-6, .max = 1}));
  if (options.exposure > options.period) {
    section.at("exposure")
        .fail(
            text_of("is longer than the time between two images, ", duration_text(options.period)));
  }
  options.gain = section.optional<double>("gain", 0.0, {.unit = "dB", .min = 0, .max = 48});
  if (const auto size = section.find("size")) {
    options.size = size->as<int>({.unit = "pixel", .min = 16, .max = 8192});
  }
  if (const auto pixels = section.find("pixels")) {
    options.pixels = pixels->as_choice<PixelFormat>({{"bayer_rggb8", PixelFormat::kBayerRg8},
                                                     {"rgb8", PixelFormat::kRgb8},
                                                     {"mono8", PixelFormat::kMono8}});
  }
  if (const auto offset = section.find("offset")) {
    options.offset = offset->as<std::array<int, 2>>({.unit = "pixel", .min = 0, .max = 65535});
  }
  options.devices = section.optional<std::vector<std::string>>("devices", {});
  if (options.source == SourceKind::kFolder) {
    options.folder = section.required<std::string>("folder");
  } else {
    options.folder = section.optional<std::string>("folder", "");
  }
  options.simulated.delay =
      in_nanoseconds(section.optional<double>("delay", 0.0, {.unit = "s", .min = 0, .max = 1}));
  options.simulated.varies = section.optional<bool>("varies", false);
  if (const auto look = section.optional_section("look")) read_look(*look, options.simulated.look);
  return options;
}

Calibration resolve_calibration(const CameraOptions& options, const std::string& robot,
                                const std::function<Calibration()>& figures) {
  Calibration calibration = chosen_calibration(options, robot, figures);
  detail::require(
      options.devices.empty() || options.devices.size() == calibration.cameras.size(),
      text_of("cameras.devices names ", options.devices.size(),
              " devices, but the calibration has ", calibration.cameras.size(), " cameras"));
  for (std::size_t i = 0; i < calibration.cameras.size(); ++i) {
    Camera& camera = calibration.cameras[i];
    if (options.size && *options.size != camera.format.width) {
      const bool is_device =
          options.source == SourceKind::kAravis || options.source == SourceKind::kV4l2;
      detail::require(
          !is_device || options.calibration == "figures",
          text_of("cameras.size is ", *options.size, ", but ", camera.name,
                  " was calibrated with images of ", camera.format.width,
                  " pixels. Devices deliver a part of the image then, not a smaller one; leave "
                  "cameras.size out, or calibrate the cameras again"));
      detail::require(*options.size <= camera.format.width,
                      text_of("cameras.size is ", *options.size, ", must be at most the ",
                              camera.format.width, " of the calibration of ", camera.name));
      camera = camera.resized(*options.size);
    }
    camera.format.pixels = options.pixels.value_or(camera.format.pixels);
    if (!options.devices.empty()) camera.serial = device_of(camera, options.devices[i]);
  }
  return calibration;
}

std::unique_ptr<Source> open_source(const CameraOptions& options,
                                    const std::vector<Camera>& cameras) {
  switch (options.source) {
    case SourceKind::kFolder:
      return std::make_unique<FolderSource>(
          cameras, FolderOptions{.folder = options.folder, .period = options.period});
    case SourceKind::kV4l2:
      return open_video(options, cameras);
    case SourceKind::kAravis:
      return open_aravis(options, cameras);
    case SourceKind::kSimulated:
      break;
  }
  throw InvalidArgument("simulated cameras need their simulation");
}

std::vector<DeviceInfo> list_devices(std::vector<std::string>& warnings) {
  std::vector<DeviceInfo> devices;
  try {
    devices = list_aravis_devices();
  } catch (const Error& error) {
    warnings.emplace_back(error.what());
  }
  for (DeviceInfo& device : list_video_devices()) devices.push_back(std::move(device));
  return devices;
}

}  // namespace trifinger::camera
