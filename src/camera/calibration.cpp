// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/camera/calibration.hpp"

#include <array>
#include <cmath>
#include <iomanip>
#include <set>
#include <string_view>
#include <utility>

#include "base/text_of.hpp"
#include "base/user_folder.hpp"
#include "trifinger/base/text.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger::camera {
namespace {

using trifinger::detail::text_of;

const std::vector<std::pair<std::string_view, PixelFormat>>& pixel_formats() {
  static const std::vector<std::pair<std::string_view, PixelFormat>> formats = [] {
    std::vector<std::pair<std::string_view, PixelFormat>> named;
    for (const PixelFormat format :
         {PixelFormat::kMono8, PixelFormat::kBayerRg8, PixelFormat::kRgb8}) {
      named.emplace_back(name_of(format), format);
    }
    return named;
  }();
  return formats;
}

Camera read_camera(const config::Node& node) {
  constexpr config::Range kSize{.unit = "pixel", .min = 16, .max = 8192};
  constexpr config::Range kPixel{.unit = "pixel", .min = -1e5, .max = 1e5};
  constexpr config::Range kFocal{.unit = "pixel", .min = 1, .max = 1e5};
  constexpr config::Range kPlace{.unit = "m", .min = -100, .max = 100};
  Camera camera;
  camera.name = node.required<std::string>("name");
  camera.serial = node.optional<std::string>("serial", "any");
  camera.format = {.width = node.required<int>("width", kSize),
                   .height = node.required<int>("height", kSize),
                   .pixels = node.required_choice<PixelFormat>("pixels", pixel_formats())};
  const auto focal = node.required<std::array<double, 2>>("focal_length", kFocal);
  const auto centre = node.required<std::array<double, 2>>("principal_point", kPixel);
  camera.lens = {
      .fx = focal[0],
      .fy = focal[1],
      .cx = centre[0],
      .cy = centre[1],
      .distortion = node.required<std::array<double, 5>>("distortion", {.min = -100, .max = 100})};
  const auto position = node.required<std::array<double, 3>>("position", kPlace);
  const config::Node turn = node.at("orientation");
  const auto [w, x, y, z] = turn.as<std::array<double, 4>>({.min = -2, .max = 2});
  const Eigen::Quaterniond orientation(w, x, y, z);
  if (std::abs(orientation.norm() - 1) > 0.01) {
    turn.fail("must be a unit quaternion w, x, y, z");
  }
  camera.pose.linear() = orientation.normalized().toRotationMatrix();
  camera.pose.translation() << position[0], position[1], position[2];
  return camera;
}

std::string number_text(double value) { return std::string(FixedText().append(value).view()); }

template <class Numbers>
std::string list_text(const Numbers& values) {
  return "[" + trifinger::detail::joined(values, number_text) + "]";
}

std::string text_of_camera(const Camera& camera) {
  const Lens& lens = camera.lens;
  const Eigen::Vector3d& place = camera.pose.translation();
  const Eigen::Quaterniond turn(camera.pose.linear());
  using Pair = std::array<double, 2>;
  return text_of(
      "  - name: ", std::quoted(camera.name), "\n    serial: ", std::quoted(camera.serial),
      "\n    width: ", camera.format.width, "\n    height: ", camera.format.height,
      "\n    pixels: ", name_of(camera.format.pixels),
      "\n    focal_length: ", list_text(Pair{lens.fx, lens.fy}),
      "\n    principal_point: ", list_text(Pair{lens.cx, lens.cy}),
      "\n    distortion: ", list_text(lens.distortion),
      "\n    position: ", list_text(std::array<double, 3>{place.x(), place.y(), place.z()}),
      "\n    orientation: ",
      list_text(std::array<double, 4>{turn.w(), turn.x(), turn.y(), turn.z()}), "\n");
}

}  // namespace

std::string Calibration::text() const {
  std::string text = text_of(
      "# Written by 'trifinger calibrate cameras'. Lenses are in OpenCV's model, with (0, 0) at\n"
      "# the centre of the first pixel. Poses are those of the cameras' frames in the world: x\n"
      "# right, y down, z forward [m], quaternions w, x, y, z.\ndate: ",
      std::quoted(date.empty() ? "unknown" : date),
      "\n# Root mean square of what remained unexplained [pixel].\nresidual: ",
      number_text(residual), "\ncameras:\n");
  for (const Camera& camera : cameras) text += text_of_camera(camera);
  return text;
}

Calibration read_calibration(const config::Node& node) {
  Calibration calibration{
      .date = node.optional<std::string>("date", "unknown"),
      .residual = node.optional<double>("residual", 0.0, {.unit = "pixel", .min = 0, .max = 1e4}),
      .cameras = {}};
  const config::Node cameras = node.at("cameras");
  std::set<std::string> names;
  for (const config::Node& item : cameras.items()) {
    calibration.cameras.push_back(read_camera(item));
    if (!names.insert(calibration.cameras.back().name).second) {
      item.at("name").fail("is the name of two cameras");
    }
  }
  if (calibration.cameras.empty()) cameras.fail("is empty, must name at least one camera");
  return calibration;
}

Calibration read_calibration(const std::filesystem::path& path) {
  const config::File file = config::File::load(path);
  Calibration calibration = read_calibration(file.root());
  file.reject_unknown_keys();
  return calibration;
}

std::filesystem::path calibration_file(const std::string& robot) {
  return UserFolder{.purpose = "calibrations",
                    .variable = "TRIFINGER_CALIBRATION_DIR",
                    .xdg_variable = "XDG_CONFIG_HOME",
                    .at_home = ".config",
                    .below = "calibration"}
             .path() /
         (robot + ".cameras.yml");
}

}  // namespace trifinger::camera
