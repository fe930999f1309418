// SPDX-License-Identifier: BSD-3-Clause
// A TriFinger on motor boards that are emulated in another process.
#include <fmt/format.h>
#include <stdlib.h>  // NOLINT(modernize-deprecated-headers): mkdtemp is of POSIX

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "boards/board_robot.hpp"
#include "boards/emulator.hpp"
#include "boards/read_options.hpp"
#include "can/memory_bus.hpp"
#include "harness.hpp"
#include "sim/boards_config.hpp"
#include "sim/simulated_plant.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/frontend.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::benchmarks {
namespace {

using namespace std::chrono_literals;
using Boards = boards::BoardRobotOptions;
using Simulation = SimulationOptions;

constexpr const char* kName = "bench";
constexpr Nanoseconds kTick = 1ms;

// The emulated robot. It takes its pose for its home, which saves the way to the end stops.
struct Robot {
  Robot() {
    RobotConfig config = load_robot_config(
        "trifinger_edu_emulated",
        {"boards.homing.method=here", "boards.homing.home_position=[0, 0.9, -1.7]",
         "boards.move_time=0.1", "boards.silent_after=1", "boards.receive_timeout=1"});
    boards = config.boards->options;
    simulation = config.simulation;
    backend = config.backend;
    backend.max_action_repeats = backend.max_skipped_ticks = 1'000'000;
  }
  Boards boards;
  Simulation simulation;
  BackendOptions backend;
};

// Frames in memory, as fast as it goes.
double times_real_time(const Robot& robot) {
  ManualClock clock;
  SimulatedPlant plant(robot.simulation);
  std::vector<std::unique_ptr<can::MemoryBus>> wires;
  std::vector<std::unique_ptr<can::Bus>> hosts;
  std::vector<std::unique_ptr<can::Bus>> buses;
  for (std::size_t i = 0; i < robot.boards.interfaces.size(); ++i) {
    wires.push_back(std::make_unique<can::MemoryBus>(clock));
    hosts.push_back(wires.back()->connect());
    buses.push_back(wires.back()->connect());
  }
  boards::Emulator emulator(robot.boards, std::move(buses), plant, clock.now());
  const std::vector<can::Frame> start{
      encode(can::BoardCommand{.command = can::Command::kEnableSystem, .value = 1}),
      encode(can::BoardCommand{.command = can::Command::kSendAll, .value = 1})};
  for (const auto& host : hosts) static_cast<void>(host->send(start));
  constexpr int kTicks = 3000;
  std::array<can::Frame, 64> frames;
  const can::Frame currents = encode(can::DesiredCurrents{{0.1, -0.1}});
  const auto begin = Clock::now();
  for (int i = 0; i < kTicks; ++i) {
    clock.advance(kTick);
    for (const auto& host : hosts) {
      static_cast<void>(host->receive(frames));
      static_cast<void>(host->send({&currents, 1}));
    }
    emulator.tick(clock.now());
  }
  return 1e-3 * kTicks / seconds_since(begin);
}

void emulate(const Robot& robot) {
  static_cast<void>(enter_realtime({.demand = Demand::kTry, .priority = 82, .cpu = 0}));
  MonotonicClock& clock = MonotonicClock::instance();
  SimulatedPlant plant(robot.simulation);
  boards::Emulator emulator(
      robot.boards, boards::open_buses(boards::BusKind::kEmulated, robot.boards.interfaces, kName),
      plant, clock.now(), {.alignment_time = 100ms});
  Instant next = clock.now();
  for (;;) {
    emulator.tick(clock.now());
    next = std::max(next + kTick, clock.now() - 50 * kTick);
    clock.sleep_until(next);
  }
}

// Notes how long each tick takes from when the last frame was read until the last one is sent.
class TimedRobot final : public UntypedDriver {
 public:
  explicit TimedRobot(const Robot& robot)
      : robot_(robot.boards,
               boards::open_buses(boards::BusKind::kEmulated, robot.boards.interfaces, kName),
               MonotonicClock::instance()) {
    times_.reserve(1'000'000);
  }

  [[nodiscard]] const RobotTypes& description() const noexcept override {
    return robot_.description();
  }
  [[nodiscard]] DriverReport prepare(TimeIndex step) noexcept override {
    return robot_.prepare(step);
  }
  [[nodiscard]] DriverReport get_latest_observation(void* observation) noexcept override {
    const DriverReport report = robot_.get_latest_observation(observation);
    begin_ = Clock::now();
    return report;
  }
  [[nodiscard]] DriverReport apply_action(const void* desired, void* applied) noexcept override {
    const DriverReport report = robot_.apply_action(desired, applied);
    if (times_.size() < times_.capacity()) times_.push_back(1e6 * seconds_since(begin_));
    return report;
  }
  [[nodiscard]] DriverReport hold(const void* observation, void* action) noexcept override {
    return robot_.hold(observation, action);
  }
  [[nodiscard]] DriverReport stop(TimeIndex step) noexcept override { return robot_.stop(step); }
  void cut() noexcept override {}
  [[nodiscard]] std::string_view fault_text(std::int32_t code) const noexcept override {
    return robot_.fault_text(code);
  }

  [[nodiscard]] const std::vector<double>& times() const noexcept { return times_; }

 private:
  boards::BoardRobot robot_;
  Clock::time_point begin_{};
  std::vector<double> times_;  // [us]
};

// The 99 % quantile of the lateness in a session of this robot [us].
double p99_of(UntypedDriver& driver, const BackendOptions& options, double window_time) {
  SessionHost host = SessionHost::anonymous();
  Backend backend(driver, host, options);
  const BackendThread thread(backend, {.demand = Demand::kTry, .priority = 80, .cpu = 1});
  Frontend<TriFinger> robot(host);
  robot.append_desired_action(hold_position(robot.latest_observation()));
  Samples lateness;
  std::vector<Status> part(100);
  const auto steps = static_cast<TimeIndex>(1e3 * window_time);
  for (TimeIndex t = 0; t < steps; t += static_cast<TimeIndex>(part.size())) {
    robot.get_statuses(t, part);
    for (const Status& status : part) lateness.add(1e-3 * static_cast<double>(status.lateness));
  }
  return lateness.quantile(0.99);
}

// Sessions of this process in a folder that is removed in the end.
class Folder {
 public:
  Folder() {
    path_ = (std::filesystem::temp_directory_path() / "trifinger.XXXXXX").string();
    if (::mkdtemp(path_.data()) == nullptr) throw SystemError("make a folder", errno);
    ::setenv("TRIFINGER_SESSION_DIR", path_.c_str(), 1);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }

 private:
  std::string path_;
};

}  // namespace

std::vector<Row> emulator(const Effort& effort) {
  pin(0);
  const Robot robot;
  Samples samples;
  for (int i = 0; i < effort.rounds; ++i) samples.add(times_real_time(robot));
  return {make_row("emulator of six boards with its simulation, one processor", "x real time",
                   samples, ">= 5", samples.median() >= 5.0)};
}

std::vector<Row> emulated_robot(const Effort& effort) {
  const Folder folder;
  const Robot robot;
  Paired p99;
  Samples answers;
  for (int i = 0; i < effort.windows; ++i) {
    report_progress(i, effort.windows);
    {
      const Child child([&robot] { emulate(robot); });
      TimedRobot timed(robot);
      p99.measure.add(p99_of(timed, robot.backend, effort.window_time));
      for (const double time : timed.times()) answers.add(time);
    }
    SimulatedRobot simulated(robot.simulation);
    p99.reference.add(p99_of(simulated, robot.backend, effort.window_time));
  }
  Row lateness =
      make_row("1 kHz with boards in another process: lateness, median of the windows' p99", "us",
               p99.measure, "<= 1.3x", false);
  lateness.reference = "simulated robot at 1 kHz";
  lateness.reference_value = p99.reference.median();
  lateness.ratio = lateness.value / *lateness.reference_value;
  lateness.holds = *lateness.ratio <= 1.3;
  Samples p99_of_answers;
  p99_of_answers.add(answers.quantile(0.99));
  return {
      lateness,
      make_row("six boards in another process: last frame of a tick read to last command sent, p99",
               "us", p99_of_answers, "<= 100 us", p99_of_answers.median() <= 100.0,
               fmt::format("median {:.1f} us", answers.median()))};
}

}  // namespace trifinger::benchmarks
