// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/sim/robot_config.hpp"

#include <dlfcn.h>

#include <cstdlib>
#include <map>
#include <set>
#include <utility>

#include "base/text_of.hpp"
#include "read_file_robot.hpp"
#include "read_motors.hpp"
#include "read_object.hpp"
#include "read_simulation.hpp"
#include "sim/boards_config.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/joint/read_backend.hpp"
#include "trifinger/joint/read_limits.hpp"

namespace trifinger {
namespace {

using config::Node;
using config::Range;
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
  contact.tip_damping_ratio = section.optional<double>(
      "tip_damping_ratio", contact.tip_damping_ratio, {.min = 0.1, .max = 10});
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

SimulationOptions simulation_of(const Node& root, RobotDescription description,
                                Nanoseconds period) {
  SimulationOptions options;
  options.description = std::move(description);
  options.limits.emplace(static_cast<std::size_t>(num_joints(options.description)));
  read_joint_limits(root.section("safety"), *options.limits);
  options.period = period;
  options.identified = detail::read_identified(root, options.limits->size(), period);

  options.initial_position =
      detail::read_pose(root.section("fingers"), "initial_position", options);
  options.stop = detail::read_stop(root, options);

  detail::read_simulation(root.section("simulation"), detail::Missing::kRefused, options);
  return options;
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

[[noreturn]] void refuse_robot_from_file(const std::string& name) {
  throw InvalidArgument("robot '" + name +
                        "' is from a file; this is for a TriFinger or one of its fingers");
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
  const std::string known = detail::joined(config_names(folder));
  throw InvalidArgument("there is no configuration '" + name + "'; " +
                        (known.empty() ? "none is installed" : "there are " + known) +
                        ", or give the path of a file");
}

config::File load_config_file(const std::string& name, const std::vector<std::string>& overrides) {
  config::File file = config::File::load(find_config(name), overrides, config_folders());
  if (!detail::is_from_file(file.root())) return file;
  const Node node = detail::file_node(file.root());
  std::filesystem::path model = node.as<std::string>();
  // An override counts from the working directory.
  const bool is_override = node.location().line == 0;
  const std::filesystem::path folder =
      is_override ? "" : std::filesystem::path(node.location().source).parent_path();
  model = std::filesystem::absolute(folder / model).lexically_normal();
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(model, ignored)) {
    node.fail("is " + model.string() + ": there is no such file");
  }
  file.replace(node, model.string());
  return file;
}

bool is_from_file(const config::File& file) { return detail::is_from_file(file.root()); }

RobotConfig load_robot_config(const std::string& name, const std::vector<std::string>& overrides) {
  return read_robot_config(load_config_file(name, overrides));
}

RobotConfig read_robot_config(const config::File& file) {
  const Node root = file.root();
  if (detail::is_from_file(root)) return detail::read_file_robot(file);
  RobotConfig config;
  config.name = root.required<std::string>("name");
  RobotDescription description = read_description(root);
  config.backend = read_backend(root.section("backend"), config.session, kPhysicsStep);
  config.simulation = simulation_of(root, std::move(description), config.backend.period);
  detail::read_motors(root, config);
  detail::read_sight(root, config);
  file.reject_unknown_keys();
  try {
    config.simulation.validate();
  } catch (const InvalidArgument& error) {
    // Single values were checked when they were read, so this error is about how objects fit
    // together.
    throw config::ConfigError(root.at("objects").location(), error.what());
  }
  config.session.documents = {{std::string(kDocument), "application/yaml", file.text()}};
  return config;
}

const RobotDescription& description_of(const RobotConfig& config) {
  if (config.simulation.file != nullptr) refuse_robot_from_file(config.name);
  return config.simulation.description;
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
  const config::File file = config_file_of(session);
  if (is_from_file(file)) refuse_robot_from_file(file.root().required<std::string>("name"));
  return read_robot_config(file);
}

}  // namespace trifinger
