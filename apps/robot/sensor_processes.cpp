// SPDX-License-Identifier: BSD-3-Clause
#include "robot/sensor_processes.hpp"

#include <fmt/core.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <utility>

#include "trifinger/base/error.hpp"

namespace trifinger::apps {
namespace {

// Pauses before a process is started again: longer and longer if it ends at once.
constexpr Nanoseconds kShortestPause = std::chrono::seconds(1);
constexpr Nanoseconds kLongestPause = std::chrono::seconds(30);
constexpr Nanoseconds kLongLife = std::chrono::seconds(10);
constexpr Nanoseconds kTimeout = std::chrono::seconds(3);

// Takes what it has printed. Each line begins with the name of the robot, which is known here.
void take_sentences(ChildProgram& program, std::vector<std::string>& messages) {
  for (const std::string& line : program.take_lines()) {
    const std::size_t colon = line.find(": ");
    messages.push_back(colon == std::string::npos ? line : line.substr(colon + 2));
  }
}

}  // namespace

SensorProcesses::SensorProcesses(std::vector<std::vector<std::string>> commands) {
  for (std::vector<std::string>& words : commands) {
    processes_.push_back({.words = std::move(words),
                          .program = {},
                          .started = {},
                          .next_start = {},
                          .pause = kShortestPause});
  }
}

SensorProcesses::~SensorProcesses() {
  while (!finish(kTimeout)) {
  }
}

bool SensorProcesses::finish(Nanoseconds timeout) {
  if (kill_at_ == Instant::max()) {
    kill_at_ = now() + kTimeout;
    for (const Process& process : processes_) {
      if (process.program) process.program->signal(SIGTERM);
    }
  }
  const Deadline deadline(timeout);
  while (true) {
    const ChildProgram* running = nullptr;
    for (Process& process : processes_) {
      if (!process.program) continue;
      static_cast<void>(process.program->take_lines());
      if (now() > kill_at_) process.program->signal(SIGKILL);
      if (process.program->has_ended()) {
        process.program.reset();
      } else {
        running = &*process.program;
      }
    }
    if (running == nullptr) return true;
    if (deadline.passed()) return false;
    constexpr Nanoseconds kSlice = std::chrono::milliseconds(50);
    running->wait(deadline.remaining(kSlice));
  }
}

std::vector<std::string> SensorProcesses::look() {
  std::vector<std::string> messages;
  for (Process& process : processes_) {
    if (!process.program) {
      if (now() >= process.next_start) start(process, messages);
      continue;
    }
    take_sentences(*process.program, messages);
    if (const std::optional<int> status = process.program->has_ended()) {
      take_sentences(*process.program, messages);
      see_end(process, *status, messages);
    }
  }
  return messages;
}

void SensorProcesses::start(Process& process, std::vector<std::string>& messages) {
  process.started = now();
  try {
    std::vector<std::string> words = process.words;
    words.emplace_back("--with-process");
    words.push_back(std::to_string(::getpid()));
    process.program.emplace(std::move(words));
  } catch (const SystemError& error) {
    messages.emplace_back(error.what());
    process.next_start = now() + process.pause;
    process.pause = std::min(2 * process.pause, kLongestPause);
  }
}

void SensorProcesses::see_end(Process& process, int status, std::vector<std::string>& messages) {
  process.program.reset();
  if (now() - process.started > kLongLife) process.pause = kShortestPause;
  const std::string how =
      WIFEXITED(status) && WEXITSTATUS(status) == 0 ? "has ended" : ending_text(status);
  messages.push_back(
      fmt::format("'trifinger {}' {}; it is started again in {} s", process.words.front(), how,
                  std::chrono::duration_cast<std::chrono::seconds>(process.pause).count()));
  process.next_start = now() + process.pause;
  process.pause = std::min(2 * process.pause, kLongestPause);
}

}  // namespace trifinger::apps
