// SPDX-License-Identifier: BSD-3-Clause
#include "exit_code.hpp"

#include <fmt/core.h>

#include <csignal>
#include <cstdio>
#include <exception>
#include <string>

#include "trifinger/base/error.hpp"
#include "trifinger/config/node.hpp"

namespace trifinger::apps {

int run_and_report(std::string_view program, const std::function<int()>& work) {
  // A file that reaches the limit of sizes (ulimit -f) is to be an error of its write, like a full
  // disk, and not the end of a robot.
  std::signal(SIGXFSZ, SIG_IGN);
  std::string problem;
  int exit_code = kFailed;
  try {
    return work();
  } catch (const UsageError& error) {
    problem = error.what();
    exit_code = kWrongUsage;
  } catch (const InvalidArgument& error) {
    problem = error.what();
    exit_code = kWrongUsage;
  } catch (const config::ConfigError& error) {
    problem = error.what();
    // Line 0: not in the file, but in what was typed behind --set.
    exit_code = error.location().line == 0 ? kWrongUsage : kFailed;
  } catch (const std::exception& error) {
    problem = error.what();
  }
  std::fflush(stdout);
  fmt::print(stderr, "{}: {}\n", program, problem);
  return exit_code;
}

}  // namespace trifinger::apps
