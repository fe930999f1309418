// SPDX-License-Identifier: BSD-3-Clause
#include "servos/read_options.hpp"

#include <algorithm>
#include <chrono>
#include <optional>
#include <string_view>
#include <utility>

#include "base/text_of.hpp"
#include "dynamixel/control_table.hpp"
#include "dynamixel/port.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger::servos {
namespace {

using config::Node;
using trifinger::detail::joined;
using trifinger::detail::text_of;

constexpr std::string_view kEmulated = "emulated";

Nanoseconds in_nanoseconds(double seconds) {
  return std::chrono::round<Nanoseconds>(std::chrono::duration<double>(seconds));
}

Nanoseconds read_time(const Node& section, std::string_view key, Nanoseconds fallback,
                      double most) {
  const double usual = std::chrono::duration<double>(fallback).count();
  return in_nanoseconds(section.optional<double>(key, usual, {.unit = "s", .min = 0, .max = most}));
}

// A time that motors keep in whole units.
Nanoseconds read_register(const Node& section, std::string_view key, Nanoseconds fallback,
                          Nanoseconds unit, std::int64_t most) {
  const double longest = std::chrono::duration<double>(unit * most).count();
  const Nanoseconds time = read_time(section, key, fallback, longest);
  if (time % unit != Nanoseconds::zero()) {
    section.at(key).fail("is " + duration_text(time) + ", must be a multiple of " +
                         duration_text(unit));
  }
  return time;
}

const dynamixel::MotorModel* read_model(const Node& section,
                                        const dynamixel::MotorModel* fallback) {
  const std::optional<Node> name = section.find("model");
  if (!name) return fallback;
  const dynamixel::MotorModel* const model = dynamixel::find_model(name->as<std::string>());
  if (model == nullptr) {
    name->fail(text_of("is '", name->as<std::string>(), "', which is no known model; there are ",
                       dynamixel::names_of_models()));
  }
  return model;
}

// What is said of all motors is in `servo` already.
Servo read_servo(const Node& section, Servo servo) {
  servo.id = section.required<std::uint8_t>("id", {.min = 0, .max = dynamixel::kMaxId});
  servo.zero = section.optional<double>("zero", 0.0, {.unit = "rad", .min = -100, .max = 100});
  servo.direction = section.optional_choice<double>("direction", 1.0, {{"1", 1.0}, {"-1", -1.0}});
  servo.ratio = section.optional<double>("ratio", 1.0, {.min = 0, .max = 1e6, .above_min = true});
  servo.model = read_model(section, servo.model);
  return servo;
}

std::size_t index_of(const Node& place, const std::string& name,
                     const std::vector<std::string>& names) {
  const auto found = std::ranges::find(names, name);
  if (found == names.end()) {
    place.fail("has '" + name + "', which is no driven joint; there are " + joined(names));
  }
  return static_cast<std::size_t>(found - names.begin());
}

ResetOptions read_reset(const Node& section, const std::vector<std::string>& joints) {
  ResetOptions reset;
  if (const auto first = section.find("first")) {
    for (const auto& name : first->as<std::vector<std::string>>()) {
      reset.first.push_back(index_of(*first, name, joints));
    }
  }
  constexpr double kMost = 60.0;
  reset.first_time = read_time(section, "first_time", reset.first_time, kMost);
  reset.move_time = read_time(section, "move_time", reset.move_time, kMost);
  reset.settle_time = read_time(section, "settle_time", reset.settle_time, kMost);
  reset.release_time = read_time(section, "release_time", reset.release_time, kMost);
  reset.tolerance = section.optional<double>(
      "tolerance", reset.tolerance, {.unit = "rad", .min = 0, .max = 10, .above_min = true});
  reset.attempts = section.optional<int>("attempts", reset.attempts, {.min = 0, .max = 100});
  if (const auto untangle = section.optional_section("untangle")) {
    for (std::size_t i = 0; i < joints.size(); ++i) {
      if (const auto position = untangle->find(joints[i])) {
        reset.untangle.emplace_back(i, position->as<double>({.unit = "rad"}));
      }
    }
  }
  return reset;
}

int read_baud(const Node& section) {
  const auto baud = section.required<int>("baud", {.min = 9600, .max = 4.5e6});
  if (std::ranges::find(dynamixel::kBaudRates, baud) == dynamixel::kBaudRates.end()) {
    section.at("baud").fail(
        text_of("is ", baud, ", motors know ",
                joined(dynamixel::kBaudRates, [](int rate) { return text_of(rate); })));
  }
  return baud;
}

}  // namespace

ServoConfig read_servo_config(const Node& root, const std::vector<std::string>& joints,
                              const std::vector<std::string>& others) {
  const Node section = root.section("dynamixel");
  ServoConfig config;
  config.port = section.required<std::string>("port");
  if (config.port == kEmulated) config.port.clear();
  config.baud = read_baud(section);
  ServoRobotOptions& robot = config.robot;
  robot.names = joints;
  robot.mode = section.required_choice<ServoMode>(
      "mode", {{"torque", ServoMode::kTorque}, {"position", ServoMode::kPosition}});
  const Servo usual{.model = read_model(section, nullptr)};
  robot.max_current = section.required<double>(
      "max_current", {.unit = "A", .min = 0, .above_min = true, .allow_infinite = true});
  const Node motors = section.section("motors");
  for (const std::string& joint : joints) {
    Servo servo = read_servo(motors.section(joint), usual);
    if (servo.model == nullptr || section.find("torque_constant")) {
      servo.torque_constant = section.required<double>(
          "torque_constant", {.unit = "Nm/A", .min = 0, .max = 1000, .above_min = true});
    } else {
      servo.torque_constant = servo.model->torque_constant();
    }
    robot.motors.push_back(servo);
  }
  if (const auto sensors = section.optional_section("sensors")) {
    for (const std::string& joint : others) {
      const auto sensor = sensors->optional_section(joint);
      if (!sensor) continue;
      if (std::ranges::find(joints, joint) != joints.end()) {
        sensor->fail("is a joint with a motor of its own, which measures it");
      }
      robot.sensors.push_back(read_servo(*sensor, usual));
      config.sensor_names.push_back(joint);
    }
  }
  if (const auto reset = section.optional_section("reset")) {
    robot.reset = read_reset(*reset, joints);
  }
  dynamixel::MotorGroupOptions& group = config.group;
  if (const auto gains = section.optional_section("position_gains")) {
    const auto gain = [&gains](std::string_view key) {
      return gains->required<int>(key, {.min = 0, .max = 16383});
    };
    group.position_gains = {.p = gain("p"), .i = gain("i"), .d = gain("d")};
  }
  group.is_fast = section.optional<bool>("fast_sync_read", group.is_fast);
  group.return_delay =
      read_register(section, "return_delay", group.return_delay, std::chrono::microseconds(2), 254);
  group.watchdog =
      read_register(section, "watchdog", group.watchdog, std::chrono::milliseconds(20), 127);
  group.silent_after = read_time(section, "silent_after", group.silent_after, 10.0);
  config.loop.period = read_time(section, "cycle_period", config.loop.period, 1.0);
  config.loop.goal_timeout = read_time(section, "goal_timeout", config.loop.goal_timeout, 10.0);
  config.slack = read_time(section, "slack", config.slack, 1.0);
  return config;
}

std::filesystem::path emulated_port(const std::string& robot) {
  return session_folder() / text_of("trifinger-dynamixel.", robot);
}

std::vector<dynamixel::EmulatedMotorOptions> emulated_motors(const ServoConfig& config) {
  std::vector<dynamixel::EmulatedMotorOptions> motors;
  for (const auto* const servos : {&config.robot.motors, &config.robot.sensors}) {
    for (const Servo& servo : *servos) {
      motors.push_back({.id = servo.id,
                        .model = servo.model == nullptr ? &dynamixel::kXm430W210 : servo.model,
                        .baud = config.baud});
    }
  }
  return motors;
}

ConnectedRobot connect(const ServoConfig& config, const std::string& name) {
  const bool is_emulated = config.port.empty();
  auto port = std::make_unique<dynamixel::SerialPort>(
      is_emulated ? emulated_port(name).string() : config.port,
      dynamixel::SerialOptions{.baud = config.baud, .is_emulated = is_emulated});
  ConnectedRobot connected;
  connected.warnings = port->warnings();
  auto group = std::make_unique<dynamixel::MotorGroup>(
      std::move(port), group_options(config.robot, config.group), config.slack);
  auto loop = std::make_unique<dynamixel::MotorLoop>(std::move(group), config.loop);
  connected.warnings.insert(connected.warnings.end(), loop->warnings().begin(),
                            loop->warnings().end());
  connected.robot = std::make_unique<ServoRobot>(config.robot, std::move(loop));
  return connected;
}

}  // namespace trifinger::servos
