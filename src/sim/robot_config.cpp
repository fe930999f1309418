// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/robot_config.hpp"

#include <dlfcn.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <set>
#include <utility>

#include "from_file.hpp"
#include "in_seconds.hpp"
#include "read_object.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/base/text_of.hpp"
#include "trifinger/joint/read_backend.hpp"
#include "trifinger/joint/read_limits.hpp"

namespace trifinger {
namespace {

using config::Node;
using config::Range;
using detail::in_seconds;
using detail::text_of;

constexpr std::string_view kSuffix = ".yml";
constexpr std::string_view kDocument = "configuration.yml";

Variant read_variant(const Node& robot) {
  return robot.required_choice<Variant>(
      "variant", {{"edu", Variant::kEdu}, {"pro", Variant::kPro}, {"one", Variant::kOne}});
}

Arrangement read_arrangement(const Node& robot) {
  return robot.required_choice<Arrangement>(
      "arrangement",
      {{"trifinger", Arrangement::kTriFinger}, {"finger", Arrangement::kSingleFinger}});
}

// Files of older versions have no such section; missing values are those of the description.
void read_joints(const Node& root, RobotDescription& description) {
  const auto joints = root.optional_section("joints");
  if (!joints) return;
  ActuatorParameters drive = actuator(description);
  drive.rotor_inertia = joints->optional<double>("rotor_inertia", drive.rotor_inertia,
                                                 {.unit = "kgm^2", .min = 0, .max = 1e-3});
  drive.damping =
      joints->optional<double>("damping", drive.damping, {.unit = "Nms/rad", .min = 0, .max = 1});
  drive.friction =
      joints->optional<double>("friction", drive.friction, {.unit = "Nm", .min = 0, .max = 1});
  description.actuator = drive;
  StopParameters& stops = description.stops;
  stops.margin =
      joints->optional<double>("stop_margin", stops.margin, {.unit = "rad", .min = 0, .max = 1});
  stops.time_constant = joints->optional<double>("stop_time_constant", stops.time_constant,
                                                 {.unit = "s", .min = 0.002, .max = 0.1});
}

ContactParameters read_contact(const Node& section) {
  const Range friction{.min = 0.001, .max = 5};
  const Range time{.unit = "s", .min = 0.002, .max = 0.1};
  ContactParameters contact;
  contact.tip_friction = section.required<double>("tip_friction", friction);
  contact.tip_torsional_friction =
      section.required<double>("tip_torsional_friction", {.unit = "m", .min = 0, .max = 0.1});
  contact.floor_friction = section.required<double>("floor_friction", friction);
  // Files of older versions have no such section.
  if (const auto pairs = section.optional_section("friction")) {
    for (const SurfacePair pair : all_surface_pairs()) {
      if (const auto given = pairs->find(name_of(pair))) {
        contact.friction[pair] = given->as<double>(friction);
      }
    }
  }
  contact.time_constant = section.optional<double>("time_constant", contact.time_constant, time);
  contact.tip_time_constant =
      section.optional<double>("tip_time_constant", contact.tip_time_constant, time);
  return contact;
}

RobotDescription read_description(const Node& root) {
  RobotDescription description;
  const Node robot = root.section("robot");
  description.variant = read_variant(robot);
  description.arrangement = read_arrangement(robot);
  const Node fingers = root.section("fingers");
  description.finger_height =
      fingers.required<double>("height", {.unit = "m", .min = 0.2, .max = 0.6});
  description.soft_tips = fingers.required<bool>("soft_tips");
  description.flipped =
      root.required_choice<bool>("platform", {{"upright", false}, {"flipped", true}});
  description.boundary = root.required<bool>("boundary");
  description.contact = read_contact(root.section("contact"));
  read_joints(root, description);
  description.objects = detail::read_objects(root.at("objects"));
  return description;
}

// Reads a time that must be a whole number of steps.
TimeIndex read_steps(const Node& section, std::string_view key, Nanoseconds period,
                     const Range& range) {
  const Node node = section.at(key, range.unit);
  const auto seconds = node.as<double>(range);
  const double steps = seconds / in_seconds(period);
  const double rounded = std::round(steps);
  constexpr double kTolerance = 1e-6;
  if (std::abs(steps - rounded) > kTolerance) {
    node.fail("is " + text_of(seconds) + " s, must be a whole number of steps of " +
              text_of(in_seconds(period)) + " s");
  }
  return static_cast<TimeIndex>(rounded);
}

// Reads angles within the soft limits: three for every finger, or one for each joint.
template <std::size_t N>
JointVector<N> read_pose(const Node& section, std::string_view key, const JointLimits<N>& limits) {
  const Node position = section.at(key, "rad");
  const auto angles = position.as<std::vector<double>>({.unit = "rad"});
  if (angles.empty() || N % angles.size() != 0) {
    position.fail("has " + std::to_string(angles.size()) + " angles, must have " +
                  std::to_string(kJointsPerFinger) + " or " + std::to_string(N));
  }
  JointVector<N> pose{};
  for (std::size_t i = 0; i < N; ++i) {
    pose[i] = angles[i % angles.size()];
    if (pose[i] < limits[i].soft_lower || pose[i] > limits[i].soft_upper) {
      position.fail("has " + text_of(pose[i]) + " rad for joint " + std::to_string(i) +
                    ", must be within its soft limits, " + text_of(limits[i].soft_lower) + " to " +
                    text_of(limits[i].soft_upper) + " rad");
    }
  }
  return pose;
}

Nanoseconds read_time(const Node& node, const Range& range) {
  return std::chrono::round<Nanoseconds>(std::chrono::duration<double>(node.as<double>(range)));
}

template <std::size_t N>
OrderlyStopOptions<N> read_stop(const Node& root, const JointLimits<N>& limits) {
  OrderlyStopOptions<N> options;
  const auto section = root.optional_section("stop");
  if (!section) return options;
  // If a motion is abandoned, the damping follows once more. Altogether 2 + 5.5 + 2 s stay below
  // the back-end's limit for the whole stop.
  options.damping_time =
      read_time(section->at("damping_time", "s"), {.unit = "s", .min = 0, .max = 2});
  // This key is read without a rest position, too, so that removing the position needs no other
  // change.
  const auto move_time = section->find("move_time");
  const Range range{.unit = "s", .min = 0, .max = 5.5, .above_min = true};
  if (move_time) options.move_time = read_time(*move_time, range);
  if (!section->find("rest_position")) return options;
  options.rest_position = read_pose(*section, "rest_position", limits);
  const Node required = section->at("move_time", "s");
  if (const Nanoseconds shortest = options.shortest_move_time(limits);
      options.move_time < shortest) {
    required.fail("is " + text_of(in_seconds(options.move_time)) + " s, must be at least " +
                  text_of(in_seconds(shortest)) + " s, or the joints cannot follow");
  }
  return options;
}

template <class R>
SimulationOptions<R> read_simulation(const Node& root, RobotDescription description,
                                     Nanoseconds period) {
  SimulationOptions<R> options;
  options.description = std::move(description);
  options.limits = read_joint_limits<R::kJoints>(root.section("safety"));
  options.period = period;

  options.initial_position =
      read_pose(root.section("fingers"), "initial_position", *options.limits);
  options.stop = read_stop(root, *options.limits);

  const Node section = root.section("simulation");
  options.seed = section.required<std::uint64_t>("seed", {.min = 0});
  options.object_period =
      read_steps(section, "object_period", period, {.unit = "s", .min = 0.001, .max = 1});
  options.object_delay =
      read_steps(section, "object_delay", period, {.unit = "s", .min = 0, .max = 1});
  options.object_position_noise =
      section.required<double>("object_position_noise", {.unit = "m", .min = 0, .max = 0.1});
  options.object_orientation_noise =
      section.required<double>("object_orientation_noise", {.unit = "rad", .min = 0, .max = 1});
  // Files of older versions do not have this key.
  options.object_loss = section.optional<double>("object_loss", 0.0, {.min = 0, .max = 1});
  options.has_hand = section.optional<bool>("hand", false);
  return options;
}

// Reads how a simulated robot knows its objects, and what its simulated cameras need.
void read_sight(const Node& simulation, RobotConfig& config) {
  const auto poses = simulation.find("object_poses");
  config.tracks_objects = poses && poses->as_choice<bool>({{"exact", false}, {"tracked", true}});
  if (config.tracks_objects && !config.cameras) {
    poses->fail("is tracked, but the robot has no cameras: a section 'cameras' is missing");
  }
  if (!config.cameras || config.cameras->source != camera::SourceKind::kSimulated) return;
  std::visit(
      [&config](auto& options) {
        options.scene_period = std::max<TimeIndex>(config.cameras->period / options.period, 1);
      },
      config.simulation);
}

// The limits, poses and the stop of the simulated robot are those of the one on boards, too.
BoardsConfig read_boards(
    const Node& section,
    const std::variant<SimulationOptions<TriFinger>, SimulationOptions<Finger>>& simulation) {
  BoardsConfig config{.bus = boards::read_bus_kind(section), .options = {}};
  std::visit(
      [&]<class R>(const SimulationOptions<R>& robot) {
        boards::BoardRobotOptions<R> options =
            boards::read_board_options<R>(section, robot.limits.value());
        options.initial_position = robot.initial_position.value();
        options.stop = robot.stop;
        options.period = robot.period;
        try {
          options.validate();
        } catch (const InvalidArgument& error) {
          section.fail(std::string("makes no sense: ") + error.what());
        }
        config.options = std::move(options);
      },
      simulation);
  return config;
}

// Describes an object, as in "box of 0.065 x 0.065 x 0.065 m and 0.094 kg".
std::string object_text(const ObjectDescription& object) {
  std::string text = object.shape == ObjectShape::kBox     ? "box of "
                     : object.shape == ObjectShape::kStick ? "stick of "
                                                           : "ball of ";
  const std::size_t lengths = object.shape == ObjectShape::kBox     ? 3
                              : object.shape == ObjectShape::kStick ? 2
                                                                    : 1;
  for (std::size_t i = 0; i < lengths; ++i) text += text_of(i > 0 ? " x " : "", object.size[i]);
  return text + text_of(" m and ", object.mass, " kg");
}

// Returns the values of a configuration that matter to a controller, by key; objects by name.
std::map<std::string, std::string> noticed_values(const config::File& file) {
  std::map<std::string, std::string> values = file.values();
  std::erase_if(values, [](const auto& entry) {
    const std::string& key = entry.first;
    return key == "name" || key == "driver" || key == "fingers.initial_position" ||
           key == "simulation.seed" || key == "simulation.hand" || key.ends_with("_noise") ||
           key.starts_with("stop.") || (key.starts_with("backend.") && key != "backend.period") ||
           key.starts_with("objects") || key.starts_with("cameras.");
  });
  if (const auto objects = file.root().find("objects"); objects && objects->is_list()) {
    for (const Node& node : objects->items()) {
      const ObjectDescription object = detail::read_object(node);
      values["object '" + object.name + "'"] = object_text(object);
    }
  }
  return values;
}

}  // namespace

std::vector<std::filesystem::path> config_folders(const std::string& folder) {
  std::vector<std::filesystem::path> folders;
  if (const char* const given = std::getenv("TRIFINGER_CONFIG_DIR");
      given != nullptr && *given != '\0') {
    folders.emplace_back(given);
  }
  Dl_info info{};
  std::error_code ignored;
  // `kSuffix` is local to this file. A symbol seen by other files might belong to another library.
  if (::dladdr(&kSuffix, &info) != 0) {
    // A program's name is what the user typed. A name without a slash was found on the PATH, so a
    // file of that name in the working directory is a different one.
    const std::string_view name = info.dli_fname;
    std::filesystem::path self;
    if (name.find('/') != std::string_view::npos) self = std::filesystem::canonical(name, ignored);
    if (self.empty()) self = std::filesystem::canonical("/proc/self/exe", ignored);
    folders.push_back(self.parent_path() / "config");
    folders.push_back(self.parent_path().parent_path() / "share" / "trifinger" / "config");
  }
  if (!folder.empty()) {
    for (std::filesystem::path& path : folders) path /= folder;
  }
  return folders;
}

std::vector<std::string> config_names(const std::string& folder) {
  std::set<std::string> names;
  for (const std::filesystem::path& place : config_folders(folder)) {
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator(place, ignored)) {
      if (entry.path().extension() == kSuffix) names.insert(entry.path().stem().string());
    }
  }
  return {names.begin(), names.end()};
}

std::filesystem::path find_config(const std::string& name, const std::string& folder) {
  const bool is_path = name.find('/') != std::string::npos || name.ends_with(kSuffix);
  if (is_path) return name;
  for (const std::filesystem::path& place : config_folders(folder)) {
    const std::filesystem::path path = place / (name + std::string(kSuffix));
    if (std::filesystem::exists(path)) return path;
  }
  std::string known;
  for (const std::string& other : config_names(folder))
    known += (known.empty() ? "" : ", ") + other;
  throw InvalidArgument("there is no configuration '" + name + "'; " +
                        (known.empty() ? "none is installed" : "there are " + known) +
                        ", or give the path of a file");
}

RobotConfig load_robot_config(const std::string& name, const std::vector<std::string>& overrides) {
  return read_robot_config(config::File::load(find_config(name), overrides, config_folders()));
}

RobotConfig read_robot_config(const config::File& file) {
  const Node root = file.root();
  if (detail::is_from_file(root)) {
    root.section("robot").fail(
        "is from a file; this is for a TriFinger or one of its fingers, with a variant and an "
        "arrangement");
  }
  RobotConfig config;
  config.name = root.required<std::string>("name");
  const bool is_on_boards =
      root.required_choice<bool>("driver", {{"simulation", false}, {"boards", true}});
  RobotDescription description = read_description(root);
  config.backend = read_backend(root.section("backend"), config.session, kPhysicsStep);
  if (description.arrangement == Arrangement::kTriFinger) {
    config.simulation =
        read_simulation<TriFinger>(root, std::move(description), config.backend.period);
  } else {
    config.simulation =
        read_simulation<Finger>(root, std::move(description), config.backend.period);
  }
  if (is_on_boards) config.boards = read_boards(root.section("boards"), config.simulation);
  if (const auto cameras = root.optional_section("cameras")) {
    config.cameras = camera::read_camera_options(*cameras);
  }
  read_sight(root.section("simulation"), config);
  file.reject_unknown_keys();
  try {
    std::visit([](const auto& options) { options.validate(); }, config.simulation);
  } catch (const InvalidArgument& error) {
    // Single values were checked when they were read, so this error is about how objects fit
    // together.
    throw config::ConfigError(root.at("objects").location(), error.what());
  }
  config.session.documents = {{std::string(kDocument), "application/yaml", file.text()}};
  return config;
}

std::vector<ConfigDifference> differences(const config::File& robot, const config::File& other) {
  std::map<std::string, ConfigDifference> found;
  for (const auto& [key, value] : noticed_values(robot)) found[key] = {.key = key, .value = value};
  for (const auto& [key, value] : noticed_values(other)) {
    found[key].key = key;
    found[key].other = value;
  }
  std::vector<ConfigDifference> different;
  for (auto& [key, difference] : found) {
    if (difference.value != difference.other) different.push_back(std::move(difference));
  }
  return different;
}

config::File config_file_of(const Session& session) {
  for (const Document& document : session.documents()) {
    if (document.name == kDocument) return config::File::parse(document.text, document.name);
  }
  throw InvalidArgument("the robot does not say what it is: its session has no configuration");
}

RobotConfig robot_config_of(const Session& session) {
  return read_robot_config(config_file_of(session));
}

}  // namespace trifinger
