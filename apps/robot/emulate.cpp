// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <chrono>
#include <csignal>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "commands.hpp"
#include "shared/options.hpp"
#include "shared/signals.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/boards/emulator.hpp"
#include "trifinger/boards/read_options.hpp"
#include "trifinger/can/interface_state.hpp"
#include "trifinger/realtime/clock.hpp"
#include "trifinger/realtime/thread.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulated_plant.hpp"

namespace trifinger::apps {
namespace {

struct EmulateOptions {
  std::string robot;
  std::optional<std::string> name;
  std::vector<std::string> overrides;
  // Hardware waits for nobody, so the boards come before the loop and its watchdog.
  RealtimeOptions realtime{.demand = Demand::kTry, .priority = 82};
};

constexpr Nanoseconds kTick = std::chrono::milliseconds(1);
// A machine that was slower than this is not made up for.
constexpr Nanoseconds kLargestDelay = std::chrono::milliseconds(50);

// Runs the boards until a signal comes.
template <class R>
void run_boards(const std::string& name, const BoardsConfig& config,
                const SimulationOptions<R>& simulation, const Signals& signals) {
  const auto& options = std::get<boards::BoardRobotOptions<R>>(config.options);
  Clock& clock = MonotonicClock::instance();
  SimulatedPlant<R> plant(simulation);
  boards::Emulator<R> emulator(options, boards::open_buses(config.bus, options.names, name), plant,
                               clock.now());
  std::optional<SimulatedTracker<R>> tracker;
  if (!simulation.description.objects.empty()) tracker.emplace(name, plant);
  fmt::print("{}: {} emulated boards are on; Ctrl-C switches them off.\n", name,
             emulator.num_boards());
  std::fflush(stdout);
  Instant next = clock.now();
  while (!signals.wait(Nanoseconds::zero())) {
    const Instant now = clock.now();
    emulator.tick(now);
    if (tracker) tracker->tick(now);
    next += kTick;
    if (clock.now() - next > kLargestDelay) next = clock.now();
    clock.sleep_until(next);
    if (plant.has_diverged()) throw Error("the simulation of the robot has diverged");
  }
  fmt::print("{}: off.\n", name);
}

// On a real bus, emulated boards would answer beside the real ones.
void require_virtual(const std::vector<std::string>& interfaces) {
  for (const std::string& name : interfaces) {
    const auto state = can::read_interface_state(name);
    if (!state || state->kind == "vcan") continue;  // a missing one is named when it is opened
    throw InvalidArgument("'" + name +
                          "' is no virtual CAN interface: real boards may be on it; "
                          "--set boards.bus=emulated emulates them without CAN");
  }
}

int emulate(const EmulateOptions& options) {
  std::signal(SIGPIPE, SIG_IGN);
  const RobotConfig config = load_robot_config(options.robot, options.overrides);
  if (!config.boards) {
    throw InvalidArgument("'" + options.robot +
                          "' is not on motor boards: its driver is simulation");
  }
  if (config.boards->bus == boards::BusKind::kSocketCan) {
    std::visit([](const auto& boards) { require_virtual(boards.names); }, config.boards->options);
  }
  const Signals signals;
  for (const std::string& lack : enter_realtime(options.realtime)) {
    fmt::print(stderr, "{}: {}\n", config.name, lack);
  }
  std::visit(
      [&](const auto& simulation) {
        run_boards(options.name.value_or(config.name), *config.boards, simulation, signals);
      },
      config.simulation);
  return kDone;
}

}  // namespace

void add_emulate(CLI::App& program, Action& action) {
  const auto& [command, options] =
      add_command(program, action, "emulate",
                  "Be the motor boards of a robot, with a simulation behind them", emulate);
  command
      .add_option("ROBOT", options.robot,
                  "A configuration of a robot on motor boards, by name or file")
      ->required();
  command.add_option("--name", options.name, "Name of the robot; default: the configuration's")
      ->option_text("NAME");
  command
      .add_option("--set", options.overrides,
                  "Change a value of the configuration, as in boards.bus=socketcan")
      ->allow_extra_args(false)
      ->option_text("KEY=VALUE ...");
  add_scheduling(command, options.realtime.demand,
                 "Whether real-time priority and locked memory are required; default: try");
  command.footer(
      "The robot itself runs beside it, in another terminal, and cannot tell it from hardware:\n"
      "the same frames go over the same kind of bus. With boards.bus=socketcan both use CAN\n"
      "interfaces, such as virtual ones.\n"
      "Example:\n"
      "  trifinger emulate trifinger_edu_emulated\n"
      "  trifinger run trifinger_edu_emulated");
}

}  // namespace trifinger::apps
