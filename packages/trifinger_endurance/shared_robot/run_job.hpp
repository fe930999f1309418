// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "shared_robot/job_limits.hpp"
#include "shared_robot/robot_preparation.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::apps {

struct JobOptions {
  std::string robot;
  std::vector<std::string> words;               // the program and its arguments
  std::optional<std::filesystem::path> output;  // default: a folder of its own in jobs/
  std::optional<std::string> user;
  std::vector<std::string> environment;  // "NAME=VALUE", or "NAME" of ours
  JobLimits limits;
  PreparationOptions preparation;
  bool with_namespaces{true};
};

// One user's job on a robot: the robot is made fit, the program runs, and the robot is made fit
// again. Prints what happens, leaves a report, and returns the exit code. Ends early, but in the
// same order, at SIGINT, SIGTERM or SIGHUP; a second one ends this program at once, and the user's
// program with it.
int run_job(const JobOptions& options);

// Makes the robot fit, as before and after a job. Returns the exit code.
int restore_robot(const std::string& robot, const PreparationOptions& preparation);

}  // namespace trifinger::apps
