// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <algorithm>
#include <string>
#include <vector>

#include "commands.hpp"
#include "shared/output.hpp"
#include "shared/terminal.hpp"
#include "sim/gain_warnings.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::apps {
namespace {

struct ConfigOptions {
  std::string robot;
  std::vector<std::string> overrides;
};

int print_config(const ConfigOptions& options) {
  const config::File file = load_config_file(options.robot, options.overrides);
  // Who reads it knows what is allowed.
  const RobotConfig config = read_robot_config(file);
  const std::vector<config::File::Key> keys = file.keys();
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
  command
      .add_option("--set", options.overrides,
                  "Change a value for this once, as in --set fingers.height=0.3")
      ->option_text("KEY=VALUE ...");
  command.footer(
      "Example:\n"
      "  trifinger config sim\n"
      "  trifinger config sim --set contact.tip_friction=0.8");
}

}  // namespace trifinger::apps
