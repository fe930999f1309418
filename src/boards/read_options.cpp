// SPDX-License-Identifier: BSD-3-Clause
#include "boards/read_options.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <optional>
#include <span>
#include <string_view>

#include "base/text_of.hpp"
#include "can/socket_can.hpp"
#include "can/unix_bus.hpp"
#include "joint/every_joint.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/joint/read_limits.hpp"

namespace trifinger::boards {
namespace {

using config::Node;
using config::Range;
using trifinger::detail::text_of;

constexpr Range kPolarity{.min = -1, .max = 1};
constexpr Range kGearRatio{.min = 0, .max = 1000, .above_min = true};
constexpr Range kTorqueConstant{.unit = "Nm/A", .min = 0, .max = 10, .above_min = true};
constexpr Range kHomingTorque{.unit = "Nm", .min = -10, .max = 10};
// Joints may be as strong as they like; `max_torque` is the bound.
constexpr Range kAnyTorque{.unit = "Nm", .min = -1000, .max = 1000};
constexpr Range kHomePosition{.unit = "rad", .min = -20, .max = 20};

// Reads pairs of a board and a number on it.
std::vector<Terminal> read_terminals(const Node& node, std::size_t boards, std::size_t count) {
  const std::vector<Node> pairs = node.items();
  if (pairs.size() != count) {
    node.fail(text_of("has ", pairs.size(), " entries, must have ", count));
  }
  std::vector<Terminal> terminals;
  for (const Node& entry : pairs) {
    const auto pair = entry.as<std::array<std::size_t, 2>>({.min = 0, .max = 1000});
    if (pair[0] >= boards) {
      entry.fail(text_of("is on board ", pair[0], ", but there are ", boards, " interfaces"));
    }
    if (pair[1] > 1) entry.fail(text_of("is number ", pair[1], " of its board, must be 0 or 1"));
    terminals.push_back({.board = pair[0], .number = pair[1]});
  }
  return terminals;
}

Nanoseconds read_time(const Node& section, std::string_view key, double most) {
  const auto time =
      section.required<double>(key, {.unit = "s", .min = 0, .max = most, .above_min = true});
  return std::chrono::round<Nanoseconds>(std::chrono::duration<double>(time));
}

// Reads what a robot has whose joints have no names: one value for all joints, or a list.
void read_lists(const Node& section, BoardRobotOptions& options) {
  const std::size_t count = options.motors.size();
  std::vector<double> values(count);
  const auto read = [&values](const Node& place, std::string_view key, const Range& range) {
    trifinger::detail::read_repeated(place.at(key, range.unit), range, values);
    return std::span<const double>(values);
  };
  const auto places = read_terminals(section.at("motors"), options.interfaces.size(), count);
  read(section, "polarity", kPolarity);
  for (std::size_t i = 0; i < count; ++i) {
    options.motors[i] = {.place = places[i], .polarity = values[i]};
    if (std::abs(values[i]) == 1.0) continue;
    section.at("polarity").fail(text_of("of joint ", i, " is ", values[i], ", must be 1 or -1"));
  }
  const auto gear_ratio = section.required<double>("gear_ratio", kGearRatio);
  const auto torque_constant = section.required<double>("torque_constant", kTorqueConstant);
  const Node homing = section.section("homing");
  const auto method = homing.required_choice<HomingMethod>("method", homing_methods());
  for (BoardMotor& motor : options.motors) {
    motor.gear_ratio = gear_ratio;
    motor.torque_constant = torque_constant;
    motor.homing.method = method;
  }
  read(homing, "torque", kHomingTorque);
  for (std::size_t i = 0; i < count; ++i) {
    options.motors[i].homing.torque = values[i];
    if (std::abs(values[i]) <= options.limits[i].max_torque) continue;
    homing.at("torque").fail(text_of("of joint ", i, " is ", values[i],
                                     " Nm, must be at most safety.max_torque (",
                                     options.limits[i].max_torque, " Nm)"));
  }
  read(homing, "home_position", kHomePosition);
  for (std::size_t i = 0; i < count; ++i) options.motors[i].homing.home_position = values[i];
}

// What is said of a joint: in its own section, or in that of every joint.
class JointSection {
 public:
  JointSection(Node own, std::optional<Node> every)
      : own_(std::move(own)), every_(std::move(every)) {}

  // The value under a key. @throws ConfigError if nobody says it
  [[nodiscard]] Node at(std::string_view key, std::string_view unit = "") const {
    // Both are looked up, so that neither counts as an unknown key.
    const auto general = every_ ? every_->find(key) : std::nullopt;
    const auto special = own_.find(key);
    return special ? *special : general ? *general : own_.at(key, unit);
  }
  [[nodiscard]] double number(std::string_view key, const Range& range) const {
    return at(key, range.unit).as<double>(range);
  }
  [[nodiscard]] JointSection section(std::string_view key) const {
    const auto general = every_ ? every_->optional_section(key) : std::nullopt;
    const auto special = own_.optional_section(key);
    if (special || !general) return {special ? *special : own_.section(key), general};
    return {*general, std::nullopt};
  }

 private:
  Node own_;
  std::optional<Node> every_;
};

// Reads what a robot has whose joints have names: a section for each, and one for every joint.
void read_by_name(const Node& section, BoardRobotOptions& options) {
  const Node motors = section.section("motors");
  const auto every = motors.optional_section(trifinger::detail::kEveryJoint);
  std::vector<std::pair<std::string_view, std::size_t>> boards;
  boards.reserve(options.interfaces.size());
  for (const std::string& name : options.interfaces) boards.emplace_back(name, boards.size());
  for (std::size_t i = 0; i < options.motors.size(); ++i) {
    const JointSection joint(motors.section(options.names[i]), every);
    BoardMotor& motor = options.motors[i];
    motor.place.board = joint.at("interface").as_choice(boards);
    motor.place.number = joint.at("motor").as<std::size_t>({.min = 0, .max = 1});
    motor.polarity = joint.at("polarity").as_choice<double>({{"1", 1.0}, {"-1", -1.0}});
    motor.gear_ratio = joint.number("gear_ratio", kGearRatio);
    motor.torque_constant = joint.number("torque_constant", kTorqueConstant);
    const JointSection homing = joint.section("homing");
    motor.homing.method = homing.at("method").as_choice(homing_methods());
    motor.homing.torque = homing.number("torque", kAnyTorque);
    const double most = options.limits[i].max_torque;
    if (std::abs(motor.homing.torque) > most) {
      homing.at("torque").fail(text_of("is ", motor.homing.torque, " Nm for ", options.names[i],
                                       ", must be at most its safety.max_torque (", most, " Nm)"));
    }
    motor.homing.home_position = homing.number("home_position", kHomePosition);
  }
}

}  // namespace

BoardRobotOptions read_board_options(const Node& section, const CountedDriverOptions& robot) {
  BoardRobotOptions options;
  static_cast<CountedDriverOptions&>(options) = robot;
  options.interfaces = section.required<std::vector<std::string>>("interfaces");
  options.motors.resize(robot.names.size());
  const bool has_names = std::ranges::none_of(robot.names, &std::string::empty);
  if (has_names) {
    read_by_name(section, options);
  } else {
    read_lists(section, options);
  }
  options.max_current = section.required<double>(
      "max_current", {.unit = "A", .min = 0, .max = 20, .above_min = true});
  if (robot.num_tips > 0) {
    options.tips = read_terminals(section.at("tips"), options.interfaces.size(), robot.num_tips);
    options.tip_sensor.zero = section.required<double>("tip_zero", {.min = 0, .max = 1});
    options.tip_sensor.scale =
        section.required<double>("tip_scale", {.unit = "N", .min = 0, .max = 1000});
  }
  options.board.silent_after = read_time(section, "silent_after", 10);
  // A current follows what is asked for within some messages.
  options.board.no_current_after = options.board.silent_after + std::chrono::milliseconds(3);
  options.board.receive_timeout = read_time(section, "receive_timeout", 10);
  options.self_test = section.required<bool>("self_test");
  options.serial = section.required<std::string>("serial");
  const Node homing = section.section("homing");
  options.max_travel = homing.required<double>(
      "max_travel", {.unit = "rad", .min = 0, .max = 20, .above_min = true});
  options.max_homing_time = read_time(homing, "max_time", 600);
  options.move_time = read_time(section, "move_time", 60);
  return options;
}

const std::vector<std::pair<std::string_view, HomingMethod>>& homing_methods() {
  static const std::vector<std::pair<std::string_view, HomingMethod>> methods{
      {"end_stop_index", HomingMethod::kEndStopIndex},
      {"end_stop", HomingMethod::kEndStop},
      {"released_end_stop", HomingMethod::kReleasedEndStop},
      {"next_index", HomingMethod::kNextIndex},
      {"here", HomingMethod::kHere}};
  return methods;
}

BusKind read_bus_kind(const Node& section) {
  return section.required_choice<BusKind>(
      "bus", {{"socketcan", BusKind::kSocketCan}, {"emulated", BusKind::kEmulated}});
}

std::filesystem::path emulated_bus_folder(const std::string& robot, const std::string& name) {
  return session_folder() / text_of("trifinger-can.", robot, ".", name);
}

std::vector<std::unique_ptr<can::Bus>> open_buses(BusKind kind,
                                                  const std::vector<std::string>& names,
                                                  const std::string& robot) {
  std::vector<std::unique_ptr<can::Bus>> buses;
  buses.reserve(names.size());
  for (const std::string& name : names) {
    buses.push_back(kind == BusKind::kSocketCan
                        ? can::open_socket_can(name)
                        : can::join_unix_bus(emulated_bus_folder(robot, name)));
  }
  return buses;
}

}  // namespace trifinger::boards
