// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <algorithm>
#include <string>
#include <vector>

#include "commands.hpp"
#include "shared/json.hpp"
#include "shared/options.hpp"
#include "shared/output.hpp"
#include "shared/terminal.hpp"
#include "sim/gain_warnings.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::apps {
namespace {

struct ConfigOptions {
  std::string robot;
  std::vector<std::string> overrides;
  bool json{false};
};

void print_table(const std::vector<config::File::Key>& keys) {
  std::size_t key_width = 0;
  std::size_t value_width = 0;
  for (const config::File::Key& key : keys) {
    key_width = std::max(key_width, key.path.size());
    value_width = std::max(value_width, key.value.size());
  }
  for (const config::File::Key& key : keys) {
    print_safely("{}  {}  {}\n", pad(key.path, key_width), pad(key.value, value_width),
                 key.allowed);
  }
}

int print_config(const ConfigOptions& options) {
  const config::File file = load_config_file(options.robot, options.overrides);
  // Who reads it knows what is allowed.
  const RobotConfig config = read_robot_config(file);
  const std::vector<config::File::Key> keys = file.keys();
  if (options.json) {
    print_json(Json::object({{"keys", list_of(keys, [](const config::File::Key& key) {
                                return Json::object({{"path", key.path},
                                                     {"value", key.value},
                                                     {"allowed", key.allowed}});
                              })}}));
  } else {
    print_table(keys);
  }
  for (const auto& [joint, warning] : detail::gain_warnings(config.simulation)) {
    print_safely(stderr, "{}\n", warning);
  }
  return kDone;
}

}  // namespace

void add_config(CLI::App& program, Action& action) {
  const auto& [command, options] = add_command(
      program, action, "config",
      "Print every key of a robot's configuration: its value and what is allowed", print_config);
  command.add_option("ROBOT", options.robot, "A configuration by name, or a file")->required();
  add_overrides(command, options.overrides, "fingers.height=0.3");
  add_json(command, options.json);
  command.footer(
      "Example:\n"
      "  trifinger config sim\n"
      "  trifinger config sim --set contact.tip_friction=0.8");
}

}  // namespace trifinger::apps
