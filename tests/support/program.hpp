// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "support/child_process.hpp"

namespace trifinger::test {

using Command = std::vector<std::string>;

/// A program that runs beside the test; it is looked for in $PATH. What it prints goes to a file.
class Program {
 public:
  Program(const Command& command, std::filesystem::path output)
      : output_(emptied(std::move(output))), process_([&] { return become(command, output_); }) {}

  /// Everything that it has printed so far.
  [[nodiscard]] std::string text() const {
    std::ifstream file(output_);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  /// Returns when it has printed `words`. The test's watchdog ends a wait for words that do not
  /// come.
  /// @throws std::runtime_error with all that it has printed if it ends before
  void wait_for(std::string_view words) {
    while (text().find(words) == std::string::npos) {
      if (!process_.is_running() && text().find(words) == std::string::npos) {
        throw std::runtime_error("the program has ended without '" + std::string(words) +
                                 "': " + text());
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }
  /// Ends it and returns its exit code, or minus the number of the signal that ended it.
  int end(int signal = SIGINT) {
    process_.send(signal);
    return process_.wait();
  }
  /// Waits until it ends by itself, and returns the same.
  int wait() { return process_.wait(); }

 private:
  // What an earlier program has printed must not be taken for words of this one.
  static std::filesystem::path emptied(std::filesystem::path file) {
    if (!std::ofstream(file, std::ios::trunc)) throw SystemError("write " + file.string(), errno);
    return file;
  }
  static int become(const Command& command, const std::filesystem::path& output) {
    const int file = ::open(output.c_str(), O_WRONLY | O_CLOEXEC);
    if (file < 0) throw SystemError("write " + output.string(), errno);
    ::dup2(file, STDOUT_FILENO);
    ::dup2(file, STDERR_FILENO);
    std::vector<const char*> words;
    for (const std::string& word : command) words.push_back(word.c_str());
    words.push_back(nullptr);
    ::execvp(words[0], const_cast<char**>(words.data()));
    throw SystemError("start " + command[0], errno);
  }

  std::filesystem::path output_;
  ChildProcess process_;
};

/// Runs a program whose output nobody needs, and returns its exit code.
inline int run(const Command& command) { return Program(command, "/dev/null").wait(); }

}  // namespace trifinger::test
