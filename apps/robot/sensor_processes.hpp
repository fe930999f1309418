// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "shared/child_program.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::apps {

// Programs beside the robot that this program runs, such as its cameras: `trifinger cameras NAME`.
// They can neither slow the robot nor stop it. One that dies is started again; all of them end with
// this process.
class SensorProcesses {
 public:
  // Starts nothing yet. `commands` are words after `trifinger`.
  explicit SensorProcesses(std::vector<std::vector<std::string>> commands);
  SensorProcesses(const SensorProcesses&) = delete;
  SensorProcesses& operator=(const SensorProcesses&) = delete;
  // Ends them and waits for their end, but kills one that hangs.
  ~SensorProcesses();

  // Asks them to end and waits for it up to `timeout`. True if all have ended. One that still runs
  // some seconds after the first call is killed.
  [[nodiscard]] bool finish(Nanoseconds timeout);

  // Looks after them. Returns what they have printed and what has happened to them, in sentences.
  [[nodiscard]] std::vector<std::string> look();

 private:
  struct Process {
    std::vector<std::string> words;
    std::optional<ChildProgram> program;
    Instant started;
    Instant next_start;
    Nanoseconds pause;
  };
  void start(Process& process, std::vector<std::string>& messages);
  void see_end(Process& process, int status, std::vector<std::string>& messages);

  std::vector<Process> processes_;
  Instant kill_at_{Instant::max()};
};

}  // namespace trifinger::apps
