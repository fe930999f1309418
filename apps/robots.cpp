// SPDX-License-Identifier: BSD-3-Clause
#include "robots.hpp"

#include <cerrno>
#include <chrono>
#include <cstddef>
#include <fstream>
#include <iterator>
#include <utility>
#include <variant>

#include "commands.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/core/fake_robot.hpp"
#include "trifinger/joint/types.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::apps {
namespace {

constexpr const char* kFakeRobot = "fake";

RunnableRobot make_fake_robot(const std::vector<std::string>& overrides) {
  const config::File file = config::File::parse("name: fake", kFakeRobot, overrides);
  const config::Node root = file.root();
  const config::Range count{.min = 0, .max = 1e6};
  RunnableRobot robot;
  robot.name = root.required<std::string>("name");
  robot.backend.mode = BackendOptions::Mode::kRealTime;
  const auto period =
      root.optional<double>("period", 0.001, {.unit = "s", .min = 1e-5, .max = 0.1});
  robot.backend.period = std::chrono::round<Nanoseconds>(std::chrono::duration<double>(period));
  robot.backend.max_action_repeats = root.optional<std::uint32_t>("max_repeats", 100, count);
  robot.backend.max_skipped_ticks = root.optional<std::uint32_t>("max_skipped", 100, count);
  robot.session.history = root.optional<std::size_t>("history", 16384, {.min = 16, .max = 1048576});
  // -1: never.
  const config::Range step{.min = -1, .max = 1e15};
  robot.driver = std::make_unique<FakeDriver>(
      FakeDriver::Options{.prepare_periods = root.optional<TimeIndex>("prepare_periods", 0, count),
                          .stop_periods = root.optional<TimeIndex>("stop_periods", 0, count),
                          .sensor_period = root.optional<TimeIndex>("sensor_period", 10, count),
                          .sensor_delay = root.optional<TimeIndex>("sensor_delay", 0, count),
                          .action_fault_after = root.optional<TimeIndex>("fault_after", -1, step)});
  file.reject_unknown_keys();
  robot.session.documents = {{"configuration.yml", "application/yaml", file.text()}};
  return robot;
}

template <class R>
std::unique_ptr<UntypedDriver> make_simulation(SimulationOptions<R> options) {
  return std::make_unique<SimulatedRobot<R>>(std::move(options));
}

}  // namespace

RunnableRobot make_robot(const std::string& robot, const std::vector<std::string>& overrides) {
  if (robot == kFakeRobot) return make_fake_robot(overrides);

  RobotConfig config = load_robot_config(robot, overrides);
  config.session.documents.push_back(std::visit(
      [](const auto& options) { return model_document(options.description); }, config.simulation));
  return {.name = std::move(config.name),
          .driver = std::visit([](auto& options) { return make_simulation(std::move(options)); },
                               config.simulation),
          .backend = config.backend,
          .session = std::move(config.session)};
}

}  // namespace trifinger::apps
