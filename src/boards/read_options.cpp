// SPDX-License-Identifier: BSD-3-Clause
#include "boards/read_options.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <span>
#include <string_view>

#include "base/text_of.hpp"
#include "can/socket_can.hpp"
#include "can/unix_bus.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/joint/read_limits.hpp"

namespace trifinger::boards {
namespace {

using config::Node;
using config::Range;
using trifinger::detail::text_of;

void read_joints(const Node& section, std::string_view key, const Range& range,
                 std::span<double> values) {
  trifinger::detail::read_repeated(section.at(key, range.unit), range, values);
}

// Reads pairs of a board and a number on it.
void read_terminals(const Node& section, std::string_view key, std::size_t boards,
                    std::span<Terminal> terminals) {
  const Node node = section.at(key);
  const std::vector<Node> pairs = node.items();
  if (pairs.size() != terminals.size()) {
    node.fail(text_of("has ", pairs.size(), " entries, must have ", terminals.size()));
  }
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto pair = pairs[i].as<std::array<std::size_t, 2>>({.min = 0, .max = 1000});
    if (pair[0] >= boards) {
      pairs[i].fail(text_of("is on board ", pair[0], ", but there are ", boards, " interfaces"));
    }
    if (pair[1] > 1) pairs[i].fail(text_of("is number ", pair[1], " of its board, must be 0 or 1"));
    terminals[i] = {.board = pair[0], .number = pair[1]};
  }
}

Nanoseconds read_time(const Node& section, std::string_view key, double most) {
  const auto time =
      section.required<double>(key, {.unit = "s", .min = 0, .max = most, .above_min = true});
  return std::chrono::round<Nanoseconds>(std::chrono::duration<double>(time));
}

template <std::size_t N>
HomingOptions<N> read_homing(const Node& section, const JointLimits<N>& limits) {
  HomingOptions<N> homing;
  homing.method = section.required_choice<HomingMethod>("method", homing_methods());
  read_joints(section, "torque", {.unit = "Nm", .min = -10, .max = 10}, homing.torque);
  for (std::size_t i = 0; i < N; ++i) {
    if (std::abs(homing.torque[i]) <= limits[i].max_torque) continue;
    section.at("torque").fail(text_of("of joint ", i, " is ", homing.torque[i],
                                      " Nm, must be at most safety.max_torque (",
                                      limits[i].max_torque, " Nm)"));
  }
  read_joints(section, "home_position", {.unit = "rad", .min = -20, .max = 20},
              homing.home_position);
  homing.max_travel = section.required<double>(
      "max_travel", {.unit = "rad", .min = 0, .max = 20, .above_min = true});
  homing.max_time = read_time(section, "max_time", 600);
  return homing;
}

}  // namespace

template <class R>
BoardRobotOptions<R> read_board_options(const Node& section,
                                        const JointLimits<R::kJoints>& limits) {
  BoardRobotOptions<R> options;
  options.limits = limits;
  options.names = section.required<std::vector<std::string>>("interfaces");
  read_terminals(section, "motors", options.names.size(), options.motors);
  read_terminals(section, "tips", options.names.size(), options.tips);
  read_joints(section, "polarity", {.min = -1, .max = 1}, options.polarity);
  for (std::size_t i = 0; i < R::kJoints; ++i) {
    if (std::abs(options.polarity[i]) == 1.0) continue;
    section.at("polarity")
        .fail(text_of("of joint ", i, " is ", options.polarity[i], ", must be 1 or -1"));
  }
  const Range positive{.min = 0, .max = 1000, .above_min = true};
  options.drive.gear_ratio = section.required<double>("gear_ratio", positive);
  options.drive.torque_constant = section.required<double>(
      "torque_constant", {.unit = "Nm/A", .min = 0, .max = 10, .above_min = true});
  options.max_current = section.required<double>(
      "max_current", {.unit = "A", .min = 0, .max = 20, .above_min = true});
  options.tip_sensor.zero = section.required<double>("tip_zero", {.min = 0, .max = 1});
  options.tip_sensor.scale =
      section.required<double>("tip_scale", {.unit = "N", .min = 0, .max = 1000});
  options.board.silent_after = read_time(section, "silent_after", 10);
  // A current follows what is asked for within some messages.
  options.board.no_current_after = options.board.silent_after + std::chrono::milliseconds(3);
  options.board.receive_timeout = read_time(section, "receive_timeout", 10);
  options.self_test = section.required<bool>("self_test");
  options.serial = section.required<std::string>("serial");
  options.homing = read_homing(section.section("homing"), limits);
  options.move_time = read_time(section, "move_time", 60);
  return options;
}

template BoardRobotOptions<TriFinger> read_board_options<TriFinger>(
    const Node&, const JointLimits<TriFinger::kJoints>&);
template BoardRobotOptions<Finger> read_board_options<Finger>(const Node&,
                                                              const JointLimits<Finger::kJoints>&);

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
