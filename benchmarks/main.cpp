// SPDX-License-Identifier: BSD-3-Clause
// Measures the figures of the C++ side, each beside its reference, and prints them as JSON. `./run
// bench` calls it.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <exception>
#include <string_view>
#include <utility>
#include <vector>

#include "harness.hpp"

namespace {

using trifinger::benchmarks::Effort;
using trifinger::benchmarks::Row;

struct Part {
  std::string_view name;
  std::vector<Row> (*rows)(const Effort& effort);
};

// These three first: they must not inherit the affinity that the others set.
constexpr std::array kParts{Part{"realtime", trifinger::benchmarks::realtime_rows},
                            Part{"lift", trifinger::benchmarks::lift_rows},
                            Part{"faults", trifinger::benchmarks::fault_rows},
                            Part{"core", trifinger::benchmarks::core_rows},
                            Part{"simulation", trifinger::benchmarks::simulation_rows},
                            Part{"control", trifinger::benchmarks::control_rows},
                            Part{"learning", trifinger::benchmarks::learning_rows},
                            Part{"log", trifinger::benchmarks::log_rows}};

}  // namespace

int main(int argc, char** argv) {
  Effort effort{.rounds = 15, .windows = 30, .window_time = 2.0, .kills = 1000, .hold_time = 50.0};
  std::string_view only;
  for (int i = 1; i < argc; ++i) {
    const std::string_view argument = argv[i];
    if (argument == "--quick") {
      effort = {.rounds = 1, .windows = 1, .window_time = 0.5, .kills = 20, .hold_time = 0.1};
    } else if (std::ranges::find(kParts, argument, &Part::name) != kParts.end()) {
      only = argument;
    } else {
      fmt::print(stderr,
                 "usage: {} [--quick] [realtime | lift | faults | core | simulation | control | "
                 "learning | log]\n",
                 argv[0]);
      return 2;
    }
  }
  try {
    std::vector<Row> rows;
    for (const Part& part : kParts) {
      if (!only.empty() && part.name != only) continue;
      for (Row& row : part.rows(effort)) rows.push_back(std::move(row));
    }
    fmt::print("{}", trifinger::benchmarks::to_json(rows));
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
  return EXIT_SUCCESS;
}
