// SPDX-License-Identifier: BSD-3-Clause
#include "shared/exit_code.hpp"

#include <fmt/core.h>

#include <csignal>
#include <cstdio>
#include <exception>
#include <string>

#include "base/printable.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/config/node.hpp"

namespace trifinger::apps {

int run_and_report(const std::string& program, const std::function<int()>& work) {
  // A file that reaches the size limit (ulimit -f) should make its write fail, like a full disk.
  // The signal would end the robot's program.
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
    // Line 0 means that the error is not in the file but in a value typed after --set.
    exit_code = error.location().line == 0 ? kWrongUsage : kFailed;
  } catch (const std::exception& error) {
    problem = error.what();
  }
  std::fflush(stdout);
  fmt::print(stderr, "{}: {}\n", program, printable_lines(problem));
  return exit_code;
}

}  // namespace trifinger::apps
