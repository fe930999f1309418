// SPDX-License-Identifier: BSD-3-Clause
#include "endurance/simulated.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "boards/emulated_fault.hpp"
#include "sim/boards_config.hpp"
#include "sim/simulated_boards.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulated_robot.hpp"

namespace trifinger::apps {
namespace {

using Kind = InjectedFault::Kind;

// B a board or its bus, J a joint, K the next joint, D a duration [s].
constexpr std::array<std::string_view, 20> kBoardFaults{
    "power off for D s",
    "board B off for D s",
    "board B restarts",
    "board B near rollover",
    "board B silent for D s",
    "board B error temperature",
    "bus B loses 30 % for D s",
    "bus B duplicates 30 % for D s",
    "bus B delays 30 % by 0.004 s for D s",
    "bus B corrupts 10 % for D s",
    "bus B flooded with 5000 frames/s for D s",
    "bus B full for D s",
    "bus B off for D s",
    "bus B down for D s",
    "joint J jumps by 0.5 rad for D s",
    "joint J stuck for D s",
    "joint J noisy by 0.05 rad for D s",
    "joint J draws 3 times the current for D s",
    "joint J loose for D s",
    "joint J reversed for D s",
};
constexpr std::string_view kSwapped = "joints J and K swapped for D s";

}  // namespace

std::size_t num_faults_to_inject(bool has_boards) noexcept {
  return 2 + (has_boards ? kBoardFaults.size() + 1 : 0);
}

InjectedFault fault_to_inject(std::uint64_t number, std::uint64_t seed, std::size_t boards,
                              std::size_t joints) {
  Random random{.seed = seed, .episode = number};
  const std::size_t turn = number % num_faults_to_inject(boards > 0);
  if (turn == 0) return {.kind = Kind::kUnfit, .text = "actions are unfit"};
  if (turn == 1) return {.kind = Kind::kRestart, .text = "the back-end is restarted"};
  const std::string_view pattern =
      turn - 2 < kBoardFaults.size() ? kBoardFaults[turn - 2] : kSwapped;
  const auto board = random.integer(0, static_cast<std::int64_t>(boards));
  const auto joint = random.integer(0, static_cast<std::int64_t>(joints));
  // Faults of an instant up to those that outlast some attempts to recover.
  const double duration = std::pow(10.0, random.uniform(-2.0, 0.9));
  std::string text;
  for (std::size_t i = 0; i < pattern.size(); ++i) {
    const bool stands_alone =
        i > 0 && pattern[i - 1] == ' ' && (i + 1 == pattern.size() || pattern[i + 1] == ' ');
    if (stands_alone && pattern[i] == 'B') {
      text += fmt::format("{}", board);
    } else if (stands_alone && pattern[i] == 'J') {
      text += fmt::format("{}", joint);
    } else if (stands_alone && pattern[i] == 'K') {
      text += fmt::format("{}", (joint + 1) % static_cast<std::int64_t>(joints));
    } else if (stands_alone && pattern[i] == 'D') {
      text += fmt::format("{:.3f}", duration);
    } else {
      text += pattern[i];
    }
  }
  return {.kind = Kind::kBoards, .text = std::move(text)};
}

// What the back-end drives, and what lives on while nobody drives it.
class SimulatedPlace::World {
 public:
  World() = default;
  World(const World&) = delete;
  World& operator=(const World&) = delete;
  virtual ~World() = default;

  [[nodiscard]] virtual UntypedDriver& driver() noexcept = 0;
  // Whether steps of the driver move the clock by themselves.
  [[nodiscard]] virtual bool moves_clock() const noexcept = 0;
  virtual void pass(Nanoseconds time) = 0;
  // The back-end was started anew.
  virtual void restart() = 0;
  [[nodiscard]] virtual std::size_t num_boards() const noexcept = 0;
  [[nodiscard]] virtual std::size_t num_joints() const noexcept = 0;
  virtual void add(const std::string& fault) = 0;
};

// A robot on emulated motor boards.
class SimulatedPlace::BoardWorld final : public World {
 public:
  BoardWorld(boards::BoardRobotOptions boards, const SimulationOptions& simulation,
             ManualClock& clock)
      : boards_(std::move(boards), simulation, clock) {}

  [[nodiscard]] UntypedDriver& driver() noexcept override { return boards_; }
  [[nodiscard]] bool moves_clock() const noexcept override { return true; }
  void pass(Nanoseconds time) override { boards_.pass(time); }
  void restart() override { boards_.restart(); }
  [[nodiscard]] std::size_t num_boards() const noexcept override {
    return boards_.options().interfaces.size();
  }
  [[nodiscard]] std::size_t num_joints() const noexcept override {
    return boards_.options().motors.size();
  }
  void add(const std::string& fault) override { boards_.add(boards::parse_fault(fault)); }

 private:
  SimulatedBoards boards_;
};

// A simulation without motors between: its driver knows no time.
class SimulatedPlace::OtherWorld final : public World {
 public:
  OtherWorld(std::unique_ptr<UntypedDriver> driver, ManualClock& clock)
      : driver_(std::move(driver)), clock_(clock) {}

  [[nodiscard]] UntypedDriver& driver() noexcept override { return *driver_; }
  [[nodiscard]] bool moves_clock() const noexcept override { return false; }
  void pass(Nanoseconds time) override { clock_.advance(time); }
  void restart() override {}
  [[nodiscard]] std::size_t num_boards() const noexcept override { return 0; }
  [[nodiscard]] std::size_t num_joints() const noexcept override { return 0; }
  void add(const std::string& /*fault*/) override {}

 private:
  std::unique_ptr<UntypedDriver> driver_;
  ManualClock& clock_;
};

SimulatedPlace::SimulatedPlace(SimulatedOptions options, const std::atomic<bool>& stop)
    : options_(std::move(options)), stop_(stop) {
  RobotConfig config = load_robot_config(options_.robot, options_.overrides);
  if (config.servos) {
    throw InvalidArgument("'" + options_.robot +
                          "' is on motors, which run in real time only: --robot drives it");
  }
  name_ = config.name;
  backend_options_ = config.backend;
  session_options_ = std::move(config.session);
  if (config.boards) {
    world_ = std::make_unique<BoardWorld>(config.boards->options, config.simulation, clock_);
  } else {
    world_ = std::make_unique<OtherWorld>(
        std::make_unique<SimulatedRobot>(std::move(config.simulation)), clock_);
  }
  backend_options_.mode = BackendOptions::Mode::kNonRealTime;
  begin();
}

SimulatedPlace::~SimulatedPlace() = default;

void SimulatedPlace::begin() {
  backend_.reset();
  host_ = std::make_unique<SessionHost>(SessionHost::anonymous(session_options_, name_));
  backend_ = std::make_unique<Backend>(world_->driver(), *host_, backend_options_, clock_);
  backend_->begin_session();
}

Session SimulatedPlace::session() const { return host_->open(); }

void SimulatedPlace::add(const std::string& fault) { world_->add(fault); }

UntypedFrontend SimulatedPlace::connect() {
  if (std::exchange(is_restart_due_, false)) {
    backend_.reset();
    world_->restart();
    begin();
  }
  return UntypedFrontend(*backend_, {.control = true});
}

void SimulatedPlace::recover() { backend_->recover(); }

void SimulatedPlace::pause(Nanoseconds time) {
  if (stop_.load(std::memory_order_relaxed)) throw Stopped();
  world_->pass(time);
}

Nanoseconds SimulatedPlace::now() const noexcept { return clock_.now().time_since_epoch(); }

bool SimulatedPlace::expect(std::uint64_t steps) {
  if (stop_.load(std::memory_order_relaxed)) throw Stopped();
  if (!world_->moves_clock()) {
    clock_.advance(backend_options_.period * static_cast<std::int64_t>(steps));
  }
  const std::uint64_t before = steps_;
  steps_ += steps;
  const std::uint64_t every = options_.faults_every;
  if (every > 0 && before / every != steps_ / every) inject();
  return std::exchange(is_unfit_due_, false);
}

void SimulatedPlace::inject() {
  const InjectedFault fault =
      fault_to_inject(injected_, options_.seed, world_->num_boards(), world_->num_joints());
  ++injected_;
  switch (fault.kind) {
    case Kind::kUnfit:
      is_unfit_due_ = true;
      break;
    case Kind::kRestart:
      is_restart_due_ = true;
      backend_->request_stop();
      break;
    case Kind::kBoards:
      world_->add(fault.text);
      break;
  }
}

}  // namespace trifinger::apps
