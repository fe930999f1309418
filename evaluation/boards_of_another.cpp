// SPDX-License-Identifier: BSD-3-Clause
// A robot on emulated motor boards that is not as its configuration says, in simulated time and as
// fast as others use it, for evaluation/identify.py. Ends at SIGTERM.
//
//     boards_of_another DESCRIBED TRUE NAME
//
// DESCRIBED is the configuration that the robot says it has, TRUE the one of what the boards move.
#include <fmt/core.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>
#include <utility>

#include "shared/signals.hpp"
#include "sim/boards_config.hpp"
#include "sim/simulated_boards.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/realtime/clock.hpp"
#include "trifinger/sim/robot_config.hpp"
#include "trifinger/sim/simulation_options.hpp"

namespace {

using trifinger::apps::Signals;

void run(const std::string& described, const std::string& true_one, const std::string& name) {
  const Signals signals;
  trifinger::RobotConfig config = trifinger::load_robot_config(described);
  trifinger::detail::require(config.boards != nullptr, described + " has no boards");
  trifinger::ManualClock clock(trifinger::MonotonicClock::instance().now());
  trifinger::SimulatedBoards driver(config.boards->options,
                                    trifinger::load_robot_config(true_one).simulation, clock);
  for (trifinger::Document& document : trifinger::model_documents(config.simulation)) {
    config.session.documents.push_back(std::move(document));
  }
  trifinger::SessionHost host = trifinger::SessionHost::named(name, config.session);
  config.backend.mode = trifinger::BackendOptions::Mode::kNonRealTime;
  trifinger::Backend backend(driver, host, config.backend, clock);
  const trifinger::BackendThread loop(backend, {.demand = trifinger::Demand::kOff},
                                      Signals::notify);
  while (!loop.wait_for_end(trifinger::Timeout::zero()) &&
         !signals.wait(std::chrono::milliseconds(20))) {
  }
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc != 4) throw trifinger::InvalidArgument("DESCRIBED TRUE NAME");
    run(argv[1], argv[2], argv[3]);
    return EXIT_SUCCESS;
  } catch (const std::exception& error) {
    fmt::print(stderr, "boards_of_another: {}\n", error.what());
    return EXIT_FAILURE;
  }
}
