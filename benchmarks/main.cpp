// SPDX-License-Identifier: BSD-3-Clause
// The measures of the C++ side. `./run bench` starts this program once for each of them. It prints
// JSON, one object per line: what the process may use of the machine, its progress, its rows.
#include <fmt/format.h>
#include <sys/prctl.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <span>
#include <string_view>

#include "harness.hpp"

namespace {

namespace benchmarks = trifinger::benchmarks;

struct NamedMeasure {
  std::string_view name;
  benchmarks::Measure* rows;
};

constexpr std::array kMeasures{
    NamedMeasure{"lateness", benchmarks::lateness},
    NamedMeasure{"lateness_beside_hogs", benchmarks::lateness_beside_hogs},
    NamedMeasure{"lateness_beside_planner", benchmarks::lateness_beside_planner},
    NamedMeasure{"append", benchmarks::append},
    NamedMeasure{"wake", benchmarks::wake},
    NamedMeasure{"loop", benchmarks::loop},
    NamedMeasure{"inline_loop", benchmarks::inline_loop},
    NamedMeasure{"can_frames", benchmarks::can_frames},
    NamedMeasure{"emulator", benchmarks::emulator},
    NamedMeasure{"motor_bus", benchmarks::motor_bus},
    NamedMeasure{"emulated_robot", benchmarks::emulated_robot},
    NamedMeasure{"safety_chain", benchmarks::safety_chain},
    NamedMeasure{"simulation", benchmarks::simulation},
    NamedMeasure{"cameras", benchmarks::cameras},
    NamedMeasure{"control_cycle", benchmarks::control_cycle},
    NamedMeasure{"planner", benchmarks::planner},
    NamedMeasure{"policy", benchmarks::policy},
    NamedMeasure{"single_precision_policy", benchmarks::single_precision_policy},
    NamedMeasure{"vector_environment_1_thread", benchmarks::vector_environment_1_thread},
    NamedMeasure{"vector_environment_2_threads", benchmarks::vector_environment_2_threads},
    NamedMeasure{"environment", benchmarks::environment},
    NamedMeasure{"any_robot", benchmarks::any_robot},
    NamedMeasure{"lift", benchmarks::lift},
    NamedMeasure{"log", benchmarks::log_files},
    NamedMeasure{"recorded_simulation", benchmarks::recorded_simulation},
    NamedMeasure{"recorded_images", benchmarks::recorded_images},
    NamedMeasure{"images", benchmarks::images},
    NamedMeasure{"dead_user", benchmarks::dead_user},
    NamedMeasure{"dead_user_with_repeats", benchmarks::dead_user_with_repeats},
    NamedMeasure{"dead_backend", benchmarks::dead_backend},
    NamedMeasure{"kills", benchmarks::kills}};

}  // namespace

int main(int argc, char** argv) {
  const std::span arguments(argv, static_cast<std::size_t>(argc));
  benchmarks::Effort effort{
      .rounds = 15, .windows = 30, .window_time = 2.0, .kills = 1000, .hold_time = 50.0};
  if (argc == 3 && std::string_view(arguments[2]) == "--quick") {
    effort = {
        .rounds = 1, .windows = 1, .window_time = 0.5, .kills = 20, .hold_time = 0.1, .share = 0.1};
  } else if (argc != 2) {
    fmt::print(stderr, "usage: {} MEASURE [--quick]\nmeasures:\n", arguments[0]);
    for (const NamedMeasure& measure : kMeasures) fmt::print(stderr, "  {}\n", measure.name);
    return 2;
  }
  const auto* const measure = std::ranges::find(kMeasures, arguments[1], &NamedMeasure::name);
  if (measure == kMeasures.end()) {
    fmt::print(stderr, "there is no measure '{}'\n", arguments[1]);
    return 2;
  }
  // This process ends when its `./run bench` ends.
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() == 1) return EXIT_FAILURE;  // it has ended already
  try {
    benchmarks::report_process();
    for (const benchmarks::Row& row : measure->rows(effort)) benchmarks::report_row(row);
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}: {}\n", measure->name, error.what());
    return 1;
  }
  return EXIT_SUCCESS;
}
