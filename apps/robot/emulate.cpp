// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include <chrono>
#include <csignal>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "boards/emulated_fault.hpp"
#include "boards/emulator.hpp"
#include "boards/read_options.hpp"
#include "can/interface_state.hpp"
#include "commands.hpp"
#include "robot/emulate_motors.hpp"
#include "robot/typed_lines.hpp"
#include "shared/child_program.hpp"
#include "shared/options.hpp"
#include "shared/output.hpp"
#include "shared/signals.hpp"
#include "sim/boards_config.hpp"
#include "sim/robot_cameras.hpp"
#include "sim/simulated_plant.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/realtime/clock.hpp"
#include "trifinger/realtime/thread.hpp"
#include "trifinger/sim/robot_config.hpp"

namespace trifinger::apps {
namespace {

struct EmulateOptions {
  std::string robot;
  std::optional<std::string> name;
  std::vector<std::string> overrides;
  std::vector<std::string> faults;
  // Hardware waits for nobody, so the boards come before the loop and its watchdog.
  RealtimeOptions realtime{.demand = Demand::kTry, .priority = 82};
  pid_t parent{0};  // ends when it has ended, unless 0
};

constexpr const char* kResetObjects = "reset objects";
constexpr Nanoseconds kTick = std::chrono::milliseconds(1);
// A machine that was slower than this is not made up for.
constexpr Nanoseconds kLargestDelay = std::chrono::milliseconds(50);

// The faults of an emulator, as they are given and as they happen.
class Faults {
 public:
  explicit Faults(boards::Emulator& emulator, std::string name)
      : emulator_(emulator), name_(std::move(name)) {}

  void add(const std::string& text, Instant now) {
    emulator_.add(boards::parse_fault(text), now);
    texts_.push_back(text);
    reported_.push_back(boards::ScheduledFault::Phase::kWaits);
  }

  // Prints what has begun and ended.
  void report() {
    using Phase = boards::ScheduledFault::Phase;
    for (std::size_t i = 0; i < reported_.size(); ++i) {
      const Phase phase = emulator_.faults()[i].phase;
      if (phase == reported_[i]) continue;
      if (reported_[i] == Phase::kWaits) print("begins", i);
      if (phase == Phase::kIsOver) print("is over", i);
      reported_[i] = phase;
    }
  }

 private:
  void print(const char* what, std::size_t i) const {
    print_safely("{}: fault '{}' {}\n", name_, texts_[i], what);
    std::fflush(stdout);
  }

  boards::Emulator& emulator_;
  std::string name_;
  std::vector<std::string> texts_;
  std::vector<boards::ScheduledFault::Phase> reported_;
};

// Runs the boards until a signal comes.
void run_boards(const std::string& name, const RobotConfig& config,
                const std::vector<std::string>& texts, const Signals& signals) {
  const boards::BoardRobotOptions& options = config.boards->options;
  const SimulationOptions& simulation = config.simulation;
  Clock& clock = MonotonicClock::instance();
  SimulatedPlant plant(simulation);
  boards::Emulator emulator(options,
                            boards::open_buses(config.boards->bus, options.interfaces, name), plant,
                            clock.now());
  std::optional<SimulatedTracker> tracker;
  if (!plant.model().objects().empty() && !config.tracks_objects) tracker.emplace(name, plant);
  std::optional<SimulatedScene> scene;
  if (has_simulated_cameras(config)) scene.emplace(name, plant, config.cameras->period);
  Faults faults(emulator, name);
  for (const std::string& text : texts) faults.add(text, clock.now());
  TypedLines typed;
  const auto obey = [&](const std::string& line) {
    try {
      if (line == kResetObjects) {
        plant.reset_objects();
      } else {
        faults.add(line, clock.now());
      }
    } catch (const InvalidArgument& error) {
      print_safely(stderr, "{}: {}\n", name, error.what());
    }
  };
  print_safely("{}: {} emulated boards are on; Ctrl-C switches them off.\n", name,
               emulator.num_boards());
  std::fflush(stdout);
  Instant next = clock.now();
  while (!signals.wait(Nanoseconds::zero())) {
    const Instant now = clock.now();
    emulator.tick(now);
    if (tracker) tracker->tick(now);
    if (scene) scene->tick(now);
    faults.report();
    for (const std::string& line : typed.take()) obey(line);
    next += kTick;
    if (clock.now() - next > kLargestDelay) next = clock.now();
    clock.sleep_until(next);
    if (plant.has_diverged()) throw Error("the simulation of the robot has diverged");
  }
  print_safely("{}: off.\n", name);
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

std::string indented(const std::string& text) {
  std::istringstream lines(text);
  std::string result;
  for (std::string line; std::getline(lines, line);) result += "  " + line + "\n";
  return result;
}

int emulate(const EmulateOptions& options) {
  if (options.parent > 0) end_with_parent(options.parent);
  // The boards must not stop because nobody reads their messages or because they are sent to the
  // background.
  for (const int signal : {SIGPIPE, SIGTTIN}) std::signal(signal, SIG_IGN);
  RobotConfig config = load_robot_config(options.robot, options.overrides);
  config.name = options.name.value_or(config.name);
  if (config.servos) {
    emulate_motors(config, options.faults, options.realtime);
    return kDone;
  }
  if (!config.boards) {
    throw InvalidArgument("'" + options.robot +
                          "' is not on motor boards or Dynamixel motors: its driver is simulation");
  }
  for (const std::string& text : options.faults) static_cast<void>(boards::parse_fault(text));
  if (config.boards->bus == boards::BusKind::kSocketCan) {
    require_virtual(config.boards->options.interfaces);
  }
  const Signals signals;
  for (const std::string& warning : enter_realtime(options.realtime)) {
    print_safely(stderr, "{}: {}\n", config.name, warning);
  }
  run_boards(config.name, config, options.faults, signals);
  return kDone;
}

}  // namespace

void add_emulate(CLI::App& program, Action& action) {
  const auto& [command, options] = add_command(
      program, action, "emulate",
      "Be the motor boards or Dynamixel motors of a robot, with a simulation behind them", emulate);
  add_configured_robot(
      command, options,
      "A configuration of a robot on motor boards or Dynamixel motors, by name or file",
      "boards.bus=socketcan")
      ->required();
  command
      .add_option("--fault", options.faults,
                  "Let something go wrong, as in 'board 3 silent at 5 s for 0.2 s'; see below")
      ->allow_extra_args(false)
      ->option_text("TEXT ...");
  command.add_option("--with-process", options.parent)->group("");
  add_scheduling(command, options.realtime.demand,
                 "Whether real-time priority and locked memory are required; default: try");
  command.footer(
      "The robot itself runs beside it, in another terminal, and cannot tell it from hardware:\n"
      "the same frames go over the same kind of bus. With boards.bus=socketcan both use CAN\n"
      "interfaces, such as virtual ones.\n\n"
      "Dynamixel motors are at a pseudo-terminal, where any program may open them.\n\n"
      "Faults of boards. N and M are numbers from 0, P is a share, R a rate, A an angle, F a "
      "factor; ERROR "
      "is\n"
      "encoder, receive_timeout, temperature, position_converter, rollover, undefined or other.\n"
      "The T after 'at' counts from the start of this program.\n" +
      indented(boards::fault_texts()) +
      "Faults of Dynamixel motors; ERROR is input_voltage, overheating, encoder, electric_shock or "
      "overload:\n" +
      indented(std::string(motor_fault_texts())) +
      "A fault can also be typed while this program runs; without 'at' it begins at once. The "
      "line\n"
      "'reset objects' puts the objects back; with Dynamixel motors 'reset' puts everything back.\n"
      "Example:\n"
      "  trifinger emulate trifinger_edu_emulated\n"
      "  trifinger run trifinger_edu_emulated");
}

}  // namespace trifinger::apps
