// SPDX-License-Identifier: BSD-3-Clause
#include "boards/calibration.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <span>
#include <string_view>

#include "base/regular_file.hpp"
#include "base/text_of.hpp"
#include "base/user_folder.hpp"
#include "boards/read_options.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/text.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger::boards {
namespace {

using trifinger::detail::text_of;

std::string now_text() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  ::gmtime_r(&now, &parts);
  std::array<char, 64> text{};
  return {text.data(), std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%S UTC", &parts)};
}

std::string_view name_of(HomingMethod method) {
  return std::ranges::find(homing_methods(), method, [](const auto& named) { return named.second; })
      ->first;
}

// The shortest text that reads back to the same number.
std::string number_text(double value) { return std::string(FixedText().append(value).view()); }

std::string list_text(std::span<const double> values) {
  std::string text;
  for (const double value : values) text += (text.empty() ? "[" : ", ") + number_text(value);
  return text + "]";
}

template <class R>
std::vector<double> directions(const BoardRobotOptions<R>& options) {
  std::vector<double> directions;
  for (const double torque : options.homing.torque) {
    directions.push_back(std::signbit(torque) ? -1.0 : 1.0);
  }
  return directions;
}

// A text in YAML that may contain any character of a line.
std::string quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted + "\"";
}

}  // namespace

template <class R>
Calibration Calibration::of(const std::string& robot, const std::string& serial,
                            const BoardRobotOptions<R>& options,
                            const JointVector<R::kJoints>& home_position) {
  return {.robot = robot,
          .serial = serial,
          .date = now_text(),
          .method = options.homing.method,
          .direction = directions(options),
          .polarity = {options.polarity.begin(), options.polarity.end()},
          .gear_ratio = options.drive.gear_ratio,
          .home_position = {home_position.begin(), home_position.end()}};
}

std::string Calibration::text() const {
  return text_of(
      "# Written by 'trifinger calibrate'.\nrobot: ", quoted(robot),
      "\n# What is written on the robot.\nserial: ", quoted(serial), "\ndate: ", quoted(date),
      "\n# Homing finds other places if one of these changes.\nmethod: ", name_of(method),
      "\ndirection: ", list_text(direction), "\npolarity: ", list_text(polarity),
      "\ngear_ratio: ", number_text(gear_ratio),
      "\n# Angle of each joint at the place that homing finds [rad].\nhome_position: ",
      list_text(home_position), "\n");
}

std::filesystem::path calibration_file(const std::string& robot) {
  return UserFolder{.purpose = "calibrations",
                    .variable = "TRIFINGER_CALIBRATION_DIR",
                    .xdg_variable = "XDG_CONFIG_HOME",
                    .at_home = ".config",
                    .below = "calibration"}
             .path() /
         (robot + ".yml");
}

Calibration read_calibration(const std::filesystem::path& path) {
  const config::File file = config::File::load(path);
  const config::Node root = file.root();
  using Numbers = std::vector<double>;
  Calibration calibration{
      .robot = root.required<std::string>("robot"),
      .serial = root.required<std::string>("serial"),
      .date = root.required<std::string>("date"),
      .method = root.required_choice<HomingMethod>("method", homing_methods()),
      .direction = root.required<Numbers>("direction", {.min = -1, .max = 1}),
      .polarity = root.required<Numbers>("polarity", {.min = -1, .max = 1}),
      .gear_ratio = root.required<double>("gear_ratio", {.min = 0, .max = 1000, .above_min = true}),
      .home_position =
          root.required<Numbers>("home_position", {.unit = "rad", .min = -20, .max = 20})};
  file.reject_unknown_keys();
  return calibration;
}

void write_calibration(const std::filesystem::path& path, const Calibration& calibration) {
  if (path.has_parent_path()) {
    std::error_code error;
    std::filesystem::create_directories(path.parent_path(), error);
    if (error) throw SystemError("make the folder " + path.parent_path().string(), error.value());
  }
  const std::string text = calibration.text();
  replace_file(path, std::as_bytes(std::span(text)));
}

template <class R>
void calibrate(BoardRobotOptions<R>& options, const std::string& robot,
               const Calibration& calibration) {
  const auto refuse = [&calibration](const std::string& problem) {
    throw InvalidArgument(text_of("the calibration of ", calibration.date, " ", problem,
                                  "; 'trifinger calibrate' measures a new one"));
  };
  if (calibration.robot != robot) {
    refuse(text_of("is that of the robot '", calibration.robot, "', not of '", robot, "'"));
  }
  if (options.serial != "any" && calibration.serial != options.serial) {
    refuse(text_of("is that of the robot with serial number '", calibration.serial, "', not '",
                   options.serial, "'"));
  }
  const Calibration mine = Calibration::of(robot, options.serial, options, {});
  if (calibration.home_position.size() != mine.home_position.size()) {
    refuse(text_of("has ", calibration.home_position.size(), " joints, the robot has ",
                   mine.home_position.size()));
  }
  const bool is_same_homing =
      calibration.method == mine.method && calibration.direction == mine.direction &&
      calibration.polarity == mine.polarity && calibration.gear_ratio == mine.gear_ratio;
  if (!is_same_homing) {
    refuse(
        "was measured with another homing: method, direction, polarity and gear ratio must be "
        "those of the configuration");
  }
  std::ranges::copy(calibration.home_position, options.homing.home_position.begin());
}

template Calibration Calibration::of(const std::string&, const std::string&,
                                     const BoardRobotOptions<TriFinger>&, const JointVector<9>&);
template Calibration Calibration::of(const std::string&, const std::string&,
                                     const BoardRobotOptions<Finger>&, const JointVector<3>&);
template void calibrate(BoardRobotOptions<TriFinger>&, const std::string&, const Calibration&);
template void calibrate(BoardRobotOptions<Finger>&, const std::string&, const Calibration&);

}  // namespace trifinger::boards
