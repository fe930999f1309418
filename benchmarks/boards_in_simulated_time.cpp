// SPDX-License-Identifier: BSD-3-Clause
// A robot on emulated motor boards that other programs may use, in simulated time and as fast as
// they go, with a fault every few minutes: for benchmarks/soak.py. Says each fault when it begins;
// ends at SIGTERM.
//
//     boards_in_simulated_time NAME SECONDS_BETWEEN_FAULTS FAULTS
#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "boards/emulated_fault.hpp"
#include "endurance/simulated.hpp"
#include "learning/experience.hpp"
#include "shared/signals.hpp"
#include "sim/boards_config.hpp"
#include "sim/simulated_boards.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/sensor.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/realtime/clock.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulation_options.hpp"

namespace {

using trifinger::ManualClock;
using trifinger::Nanoseconds;
using trifinger::SimulatedBoards;
using trifinger::apps::InjectedFault;
using trifinger::apps::Signals;

// The time that passes after each session, before the next one: all faults are over by then.
constexpr Nanoseconds kRest = std::chrono::seconds(10);

// Plans faults of the boards, and returns their texts.
std::vector<std::string> plan_faults(SimulatedBoards& boards, Nanoseconds every,
                                     std::size_t count) {
  std::vector<std::string> texts;
  for (std::uint64_t number = 0; texts.size() < count; ++number) {
    const InjectedFault fault = trifinger::apps::fault_to_inject(
        number, 1, boards.options().interfaces.size(), boards.options().motors.size());
    if (fault.kind != InjectedFault::Kind::kBoards) continue;
    texts.push_back(fault.text);
    trifinger::boards::EmulatedFault planned = trifinger::boards::parse_fault(fault.text);
    planned.at = every * static_cast<std::int64_t>(texts.size());
    boards.add(planned);
  }
  return texts;
}

void run(const std::string& name, Nanoseconds every, std::size_t count) {
  const Signals signals;
  trifinger::RobotConfig config = trifinger::load_robot_config("trifinger_edu_emulated");
  ManualClock clock(trifinger::MonotonicClock::instance().now());
  const trifinger::Instant start = clock.now();
  auto owned = std::make_unique<SimulatedBoards>(config.boards->options, config.simulation, clock);
  SimulatedBoards& boards = *owned;
  const std::vector<std::string> faults = plan_faults(boards, every, count);
  trifinger::DriverWithSensors driver(std::move(owned), name,
                                      {trifinger::learning::experience_companion()});
  for (trifinger::Document& document : trifinger::model_documents(config.simulation)) {
    config.session.documents.push_back(std::move(document));
  }
  trifinger::SessionHost host = trifinger::SessionHost::named(name, config.session);
  config.backend.mode = trifinger::BackendOptions::Mode::kNonRealTime;
  trifinger::Backend backend(driver, host, config.backend, clock);
  backend.set_after_session([&boards](const trifinger::Fault&) { boards.pass(kRest); });
  const trifinger::BackendThread loop(backend, {.demand = trifinger::Demand::kOff},
                                      Signals::notify);
  std::size_t said = 0;
  while (!loop.wait_for_end(trifinger::Timeout::zero()) &&
         !signals.wait(std::chrono::milliseconds(20))) {
    const auto passed = static_cast<std::size_t>((clock.now() - start) / every);
    for (; said < std::min(passed, faults.size()); ++said) {
      fmt::print("{}\n", faults[said]);
      std::fflush(stdout);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc != 4) throw trifinger::InvalidArgument("NAME SECONDS_BETWEEN_FAULTS FAULTS");
    run(argv[1], std::chrono::seconds(std::strtol(argv[2], nullptr, 10)),
        std::strtoul(argv[3], nullptr, 10));
    return EXIT_SUCCESS;
  } catch (const std::exception& error) {
    fmt::print(stderr, "boards_in_simulated_time: {}\n", error.what());
    return EXIT_FAILURE;
  }
}
