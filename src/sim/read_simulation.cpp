// SPDX-License-Identifier: BSD-3-Clause
#include "read_simulation.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/text_of.hpp"
#include "in_seconds.hpp"
#include "trifinger/camera/options.hpp"
#include "trifinger/model/robot_description.hpp"
#include "trifinger/sim/variation.hpp"

namespace trifinger::detail {
namespace {

using config::Node;
using config::Range;

// Reads a time that must be a whole number of steps.
TimeIndex read_steps(const Node& node, Nanoseconds period, const Range& range) {
  const auto seconds = node.as<double>(range);
  const double steps = seconds / in_seconds(period);
  const double rounded = std::round(steps);
  constexpr double kTolerance = 1e-6;
  const double fewest = range.min > 0.0 ? 1.0 : 0.0;
  if (rounded < fewest || std::abs(steps - rounded) > kTolerance) {
    node.fail("is " + text_of(seconds) + " s, must be a whole number of steps of " +
              text_of(in_seconds(period)) + " s");
  }
  return static_cast<TimeIndex>(rounded);
}

Nanoseconds read_time(const Node& node, const Range& range) {
  return std::chrono::round<Nanoseconds>(std::chrono::duration<double>(node.as<double>(range)));
}

}  // namespace

std::vector<double> read_pose(const Node& section, std::string_view key,
                              const SimulationOptions& options) {
  const std::span<const JointLimit> limits = options.limits.value();
  const Node position = section.at(key, "rad");
  const auto values = position.as<std::vector<double>>({.unit = "rad"});
  const bool is_from_file = options.file != nullptr;
  if (is_from_file ? values.size() != limits.size()
                   : values.empty() || limits.size() % values.size() != 0) {
    position.fail(text_of("has ", values.size(), is_from_file ? " numbers" : " angles",
                          ", must have ", is_from_file ? "" : text_of(kJointsPerFinger, " or "),
                          limits.size()));
  }
  std::vector<double> pose;
  for (std::size_t i = 0; i < limits.size(); ++i) {
    pose.push_back(values[i % values.size()]);
    if (pose[i] >= limits[i].soft_lower && pose[i] <= limits[i].soft_upper) continue;
    const bool is_slide = is_from_file && options.file->joints()[i].is_slide;
    const std::string_view unit = is_slide ? " m" : " rad";
    position.fail(text_of("has ", pose[i], unit, " for joint ", i,
                          is_from_file ? " (" + options.file->joints()[i].name + ")" : "",
                          ", must be within its soft limits, ", limits[i].soft_lower, " to ",
                          limits[i].soft_upper, unit));
  }
  return pose;
}

OrderlyStopOptions read_stop(const Node& root, const SimulationOptions& robot) {
  OrderlyStopOptions options;
  const auto section = root.optional_section("stop");
  if (!section) return options;
  // If a motion is abandoned, the damping follows once more. Altogether 2 + 5.5 + 2 s stay below
  // the back-end's limit for the whole stop.
  if (robot.file == nullptr || section->find("damping_time")) {
    options.damping_time =
        read_time(section->at("damping_time", "s"), {.unit = "s", .min = 0, .max = 2});
  }
  // This key is read without a rest position, too, so that removing the position needs no other
  // change.
  const auto move_time = section->find("move_time");
  const Range range{.unit = "s", .min = 0, .max = 5.5, .above_min = true};
  if (move_time) options.move_time = read_time(*move_time, range);
  if (!section->find("rest_position")) return options;
  options.rest_position = read_pose(*section, "rest_position", robot);
  const Node required = section->at("move_time", "s");
  if (const Nanoseconds shortest = options.shortest_move_time(robot.limits.value());
      options.move_time < shortest) {
    required.fail("is " + text_of(in_seconds(options.move_time)) + " s, must be at least " +
                  text_of(in_seconds(shortest)) + " s, or the joints cannot follow");
  }
  return options;
}

void read_simulation(const Node& section, Missing missing, SimulationOptions& options) {
  const Nanoseconds period = options.period;
  const bool is_required = missing == Missing::kRefused;
  const auto read = [&](std::string_view key, auto& value, const Range& range) {
    using Value = std::remove_reference_t<decltype(value)>;
    value = is_required ? section.required<Value>(key, range)
                        : section.optional<Value>(key, value, range);
  };
  const auto read_as_steps = [&](std::string_view key, TimeIndex& value, const Range& range) {
    if (is_required || section.find(key)) {
      value = read_steps(section.at(key, range.unit), period, range);
    }
  };
  read("seed", options.seed, {.min = 0});
  options.condition = section.optional_choice<Condition>(
      "condition", options.condition,
      {{name_of(Condition::kAsDocumented), Condition::kAsDocumented},
       {name_of(Condition::kAsBuilt), Condition::kAsBuilt},
       {name_of(Condition::kWorn), Condition::kWorn}});
  const bool is_from_file = options.file != nullptr;
  read_as_steps(
      "object_period", options.object_period,
      {.unit = "s", .min = is_from_file ? 1e-4 : 0.001, .max = is_from_file ? 10.0 : 1.0});
  read_as_steps("object_delay", options.object_delay, {.unit = "s", .min = 0, .max = 1});
  read("object_position_noise", options.object_position_noise, {.unit = "m", .min = 0, .max = 0.1});
  read("object_orientation_noise", options.object_orientation_noise,
       {.unit = "rad", .min = 0, .max = 1});
  // Files of older versions do not have these keys.
  options.object_loss = section.optional<double>("object_loss", 0.0, {.min = 0, .max = 1});
  options.has_hand = section.optional<bool>("hand", false);
}

Identified read_identified(const Node& root, std::size_t joints, Nanoseconds period) {
  Identified identified;
  const auto section = root.optional_section("identified");
  if (!section) return identified;
  for (const IdentifiedField& field : Identified::fields()) {
    const auto list = section->find(field.name);
    if (!list) continue;
    identified.*field.value =
        list->as<std::vector<double>>({.unit = field.unit, .min = field.min, .max = field.max});
    if ((identified.*field.value).size() == joints) continue;
    list->fail(text_of("has ", (identified.*field.value).size(), " numbers, must have ", joints));
  }
  const auto read_delay = [&](std::string_view key, TimeIndex& delay) {
    const auto node = section->find(key);
    const double most = static_cast<double>(Variation::kMaxDelay) * in_seconds(period);
    if (node) delay = read_steps(*node, period, {.unit = "s", .min = 0, .max = most});
  };
  read_delay("torque_delay", identified.torque_delay);
  read_delay("measurement_delay", identified.measurement_delay);
  return identified;
}

void read_sight(const Node& root, RobotConfig& config) {
  if (const auto cameras = root.optional_section("cameras")) {
    config.cameras = camera::read_camera_options(*cameras);
    if (config.servos) {
      cameras->fail("are those of simulations and of robots on boards, not of Dynamixel motors");
    }
  }
  SimulationOptions& options = config.simulation;
  const auto simulation = root.optional_section("simulation");
  const auto poses = simulation ? simulation->find("object_poses") : std::nullopt;
  config.tracks_objects = poses && poses->as_choice<bool>({{"exact", false}, {"tracked", true}});
  if (config.tracks_objects && !config.cameras) {
    poses->fail("is tracked, but the robot has no cameras: a section 'cameras' is missing");
  }
  if (config.tracks_objects && options.file != nullptr &&
      options.file->objects().size() != objects_of(options).size()) {
    poses->fail("is tracked, but '" + options.file->objects().front().name +
                "' floats freely in the robot's file, and only objects of the configuration have "
                "colours by which they are found");
  }
  if (!config.cameras || config.cameras->source != camera::SourceKind::kSimulated) return;
  options.scene_period = std::max<TimeIndex>(config.cameras->period / options.period, 1);
}

}  // namespace trifinger::detail
