// SPDX-License-Identifier: BSD-3-Clause
// Measures the figures of the C++ side, each beside its reference, and prints them as JSON. `./run
// bench` calls it.
#include <fmt/format.h>

#include <cstdlib>
#include <exception>
#include <string_view>

#include "harness.hpp"

int main(int argc, char** argv) {
  using namespace trifinger::benchmarks;
  Effort effort{.rounds = 15, .windows = 30, .window_time = 2.0};
  for (int i = 1; i < argc; ++i) {
    if (std::string_view(argv[i]) == "--quick") {
      effort = {.rounds = 3, .windows = 2, .window_time = 0.5};
    } else {
      fmt::print(stderr, "usage: {} [--quick]\n", argv[0]);
      return 2;
    }
  }
  try {
    std::vector<Row> rows;
    // Real time first: it must not inherit the affinity that the others set.
    for (const auto& part : {realtime_rows, core_rows, simulation_rows}) {
      for (Row& row : part(effort)) rows.push_back(std::move(row));
    }
    fmt::print("{}", to_json(rows));
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
  return EXIT_SUCCESS;
}
