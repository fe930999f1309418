// SPDX-License-Identifier: BSD-3-Clause
// The program `trifinger-job`: runs jobs of users on a robot that they share.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <csignal>
#include <functional>
#include <string>
#include <vector>

#include "controller/user_program.hpp"
#include "shared/exit_code.hpp"
#include "shared/options.hpp"
#include "shared_robot/confined_program.hpp"
#include "shared_robot/run_job.hpp"

namespace trifinger::apps {
namespace {

void add_preparation(CLI::App& command, PreparationOptions& preparation) {
  add_choice(command, "--self-test", preparation.self_test,
             {{"joints", SelfTest::kJoints}, {"hold", SelfTest::kHold}, {"off", SelfTest::kOff}},
             "joints: at its initial position each joint moves by 2 degrees and back (the "
             "default); hold: the robot holds its pose for half a second");
  add_choice(command, "--cube", preparation.cube,
             {{"try", CubeRecovery::kTry},
              {"demand", CubeRecovery::kDemand},
              {"leave", CubeRecovery::kLeave}},
             "Bring the cube of the scene back to the middle: try (the default) goes on if that "
             "fails, with demand the robot is then not fit");
  add_duration(command, "--ready-timeout", preparation.timeout,
               "How long the robot may take to be ready for a user; default: 60s");
}

void add_limits(CLI::App& command, JobLimits& limits, std::uint64_t& processes,
                std::uint64_t& files) {
  constexpr const char* kGroup = "Limits";
  const auto grouped = [](CLI::Option* option) { option->group(kGroup); };
  grouped(add_duration(command, "--time", limits.time,
                       "From the start of the program to its end; default: 10min"));
  grouped(add_duration(command, "--grace", limits.grace,
                       "From SIGTERM at that end to the kill; default: 5s"));
  grouped(add_duration(command, "--cpu-time", limits.cpu_time,
                       "Time of all processors together; default: 40min"));
  grouped(add_size(command, "--memory", limits.memory,
                   "Memory of all its processes together; default: 4GB"));
  grouped(add_size(command, "--address-space", limits.address_space,
                   "Addresses of each of its processes; default: 16GB"));
  grouped(command.add_option("--processes", processes, "Processes and threads; default: 256")
              ->check(CLI::Range(1, 1'000'000))
              ->option_text("N"));
  grouped(add_size(command, "--files", limits.files,
                   "Files in its folder and in shared memory together; default: 2GB"));
  grouped(command.add_option("--file-count", files, "Number of these files; default: 100000")
              ->check(CLI::Range(1, 100'000'000))
              ->option_text("N"));
  grouped(add_size(command, "--file-size", limits.file_size, "Each file; default: 1GB"));
  grouped(add_size(command, "--output-size", limits.output,
                   "What is kept of its output, half from the beginning; default: 10MB"));
  grouped(add_size(command, "--log-size", limits.log,
                   "The log of the robot; above it the oldest files are removed; default: 2GB"));
}

void add_job_options(CLI::App& command, JobOptions& job) {
  add_robot_option(command, job.robot);
  add_output(command, job.output,
             "A new folder for report, log, output and files of the job; default: one in jobs/",
             "FOLDER");
  command
      .add_option(
          "--user", job.user,
          "Whose job it is: the program runs as this user. Needed by root, and only for root")
      ->option_text("NAME");
  command
      .add_option("--env", job.environment,
                  "A variable for the program's environment, with a value or as it is here")
      ->allow_extra_args(false)
      ->option_text("NAME[=VALUE]");
  add_preparation(command, job.preparation);
  add_limits(command, job.limits, job.limits.processes, job.limits.file_count);
  command.add_flag_callback("--without-namespaces", [&job] { job.with_namespaces = false; })
      ->group("");
  command.footer(
      "Times are such as 30s, 10min, 1h; sizes such as 500MB, 2GiB.\n"
      "The program gets TRIFINGER_ROBOT, the name of the robot, and TRIFINGER_JOB_FOLDER, its "
      "working\nfolder. Ctrl-C and SIGTERM end it early and bring the robot back; a second one "
      "ends "
      "at once.\n"
      "Exit code 0: the program has succeeded, and the robot is fit. 10: the program has failed.\n"
      "11: a limit has ended it. 12: the robot was not fit, and the program was not started.\n"
      "13: the robot is not fit afterwards: somebody must look at it. 130, 143: interrupted.\n"
      "Example:\n"
      "  trifinger job run --robot sim --time 5min -- python3 my_experiment.py");
}

void check(const JobOptions& options) {
  constexpr std::uint64_t kSmallestLog = 8'000'000;
  if (options.limits.log < kSmallestLog) {
    throw UsageError("--log-size must be at least 8MB");
  }
  if (options.limits.time <= Nanoseconds::zero()) throw UsageError("--time must be above 0s");
  if (options.words.empty()) {
    throw UsageError("there is no program: 'trifinger job run --robot NAME -- PROGRAM ARGUMENTS'");
  }
  const bool is_root = ::geteuid() == 0;
  if (options.user && !is_root) throw UsageError("--user is for root only");
  // The kernel limits the processes of all users but root.
  if (is_root && (!options.user || SystemUser::find(*options.user).user == 0)) {
    throw UsageError("a program never runs as root: --user names the user whose job it is");
  }
}

int job_command(const std::vector<std::string>& all_words) {
  CLI::App program("Runs jobs of users on a robot that they share.", "trifinger job");
  set_up_help(program);
  program.require_subcommand(1);
  std::function<int()> work;

  JobOptions job;
  CLI::App& run = *program.add_subcommand(
      "run", "Check the robot, run a program within limits, and bring the robot back");
  add_job_options(run, job);
  run.callback([&] { work = [&] { return run_job(job); }; });

  std::string robot;
  PreparationOptions preparation;
  CLI::App& restore = *program.add_subcommand(
      "restore", "Clear the fault of a robot, test it, and bring its cube to the middle");
  add_robot(restore, robot);
  add_preparation(restore, preparation);
  restore.footer(
      "This is what 'trifinger job run' does before and after a program.\n"
      "Exit code 0: the robot is fit. 13: it is not; somebody must look at it.\n"
      "Example:\n"
      "  trifinger job restore sim");
  restore.callback([&] { work = [&] { return restore_robot(robot, preparation); }; });

  // What follows `--` is the program's, also if it looks like an option of ours.
  const auto end = std::ranges::find(all_words, "--");
  const std::vector<std::string> words(all_words.begin(), end);
  if (end != all_words.end()) job.words.assign(end + 1, all_words.end());
  return run_user_program(program, words, [&] {
    // Nobody may read what is printed any more, and a job cannot be paused.
    for (const int signal : {SIGTSTP, SIGTTOU, SIGPIPE}) std::signal(signal, SIG_IGN);
    if (run.parsed()) check(job);
    return work();
  });
}

}  // namespace
}  // namespace trifinger::apps

int main(int argument_count, char** arguments) {
  return trifinger::apps::job_command({arguments + 1, arguments + argument_count});
}
