// SPDX-License-Identifier: BSD-3-Clause
#include "boards/calibration.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <iomanip>
#include <span>
#include <string_view>
#include <utility>

#include "base/regular_file.hpp"
#include "base/text_of.hpp"
#include "base/user_folder.hpp"
#include "boards/read_options.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/text.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger::boards {
namespace {

using config::Node;
using trifinger::detail::joined;
using trifinger::detail::text_of;
using trifinger::detail::utc_text;

std::string_view name_of(HomingMethod method) {
  return std::ranges::find(homing_methods(), method, [](const auto& named) { return named.second; })
      ->first;
}

// The shortest text that reads back to the same number.
std::string number_text(double value) { return std::string(FixedText().append(value).view()); }

template <class T, class Text>
std::string list_text(const std::vector<T>& values, const Text& text_of_value) {
  return "[" + joined(values, text_of_value) + "]";
}

// A list, or one value if all are the same.
template <class T, class Text>
std::string shortest_text(const std::vector<T>& values, const Text& text_of_value) {
  const bool is_one = std::ranges::all_of(values, [&](const T& x) { return x == values.front(); });
  return is_one && !values.empty() ? std::string(text_of_value(values.front()))
                                   : list_text(values, text_of_value);
}

// The entries of a list, or one value for all `count` joints.
std::vector<Node> entries_of(const Node& node, std::size_t count) {
  return node.is_list() ? node.items() : std::vector<Node>(count, node);
}

}  // namespace

Calibration Calibration::of(const std::string& robot, const std::string& serial,
                            const BoardRobotOptions& options, std::vector<double> home_position) {
  Calibration calibration{.robot = robot,
                          .serial = serial,
                          .date = utc_text(std::time(nullptr), "%F %T UTC"),
                          .method = {},
                          .direction = {},
                          .polarity = {},
                          .gear_ratio = {},
                          .home_position = std::move(home_position)};
  for (const BoardMotor& motor : options.motors) {
    calibration.method.push_back(motor.homing.method);
    calibration.direction.push_back(std::signbit(motor.homing.torque) ? -1.0 : 1.0);
    calibration.polarity.push_back(motor.polarity);
    calibration.gear_ratio.push_back(motor.gear_ratio);
  }
  return calibration;
}

std::string Calibration::text() const {
  return text_of("# Written by 'trifinger calibrate'.\nrobot: ", std::quoted(robot),
                 "\n# What is written on the robot.\nserial: ", std::quoted(serial),
                 "\ndate: ", std::quoted(date),
                 "\n# Homing finds other places if one of these changes.\nmethod: ",
                 shortest_text(method, name_of), "\ndirection: ", list_text(direction, number_text),
                 "\npolarity: ", list_text(polarity, number_text),
                 "\ngear_ratio: ", shortest_text(gear_ratio, number_text),
                 "\n# Angle of each joint at the place that homing finds [rad].\nhome_position: ",
                 list_text(home_position, number_text), "\n");
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
  const Node root = file.root();
  using Numbers = std::vector<double>;
  Calibration calibration{.robot = root.required<std::string>("robot"),
                          .serial = root.required<std::string>("serial"),
                          .date = root.required<std::string>("date"),
                          .method = {},
                          .direction = root.required<Numbers>("direction", {.min = -1, .max = 1}),
                          .polarity = root.required<Numbers>("polarity", {.min = -1, .max = 1}),
                          .gear_ratio = {},
                          .home_position = root.required<Numbers>(
                              "home_position", {.unit = "rad", .min = -20, .max = 20})};
  const std::size_t joints = calibration.home_position.size();
  for (const Node& node : entries_of(root.at("method"), joints)) {
    calibration.method.push_back(node.as_choice(homing_methods()));
  }
  for (const Node& node : entries_of(root.at("gear_ratio"), joints)) {
    calibration.gear_ratio.push_back(node.as<double>({.min = 0, .max = 1000, .above_min = true}));
  }
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

void calibrate(BoardRobotOptions& options, const std::string& robot,
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
  if (calibration.home_position.size() != options.motors.size()) {
    refuse(text_of("has ", calibration.home_position.size(), " joints, the robot has ",
                   options.motors.size()));
  }
  const bool is_same_homing =
      calibration.method == mine.method && calibration.direction == mine.direction &&
      calibration.polarity == mine.polarity && calibration.gear_ratio == mine.gear_ratio;
  if (!is_same_homing) {
    refuse(
        "was measured with another homing: method, direction, polarity and gear ratio must be "
        "those of the configuration");
  }
  for (std::size_t i = 0; i < options.motors.size(); ++i) {
    options.motors[i].homing.home_position = calibration.home_position[i];
  }
}

}  // namespace trifinger::boards
