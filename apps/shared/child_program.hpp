// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/types.h>

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "trifinger/base/time.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::apps {

[[nodiscard]] inline Instant now() noexcept { return std::chrono::steady_clock::now(); }

// This program with other words, as a child process in a process group of its own: Ctrl-C on a
// terminal does not reach it. What it prints comes here. It does not end by itself when this object
// or this process does.
class ChildProgram {
 public:
  // Throws SystemError.
  explicit ChildProgram(std::vector<std::string> words);

  [[nodiscard]] pid_t pid() const noexcept { return pid_; }
  // Its standard input.
  [[nodiscard]] int input() const noexcept { return input_.get(); }
  // Waits until it has printed something or ends. Afterwards `take_lines` must be called. Only for
  // a short time if it has closed its output: then it ends soon, or it hangs.
  void wait(Nanoseconds timeout) const noexcept;

  // Returns the whole lines that it has printed since the last call.
  [[nodiscard]] std::vector<std::string> take_lines();
  // Returns how it has ended, as waitpid does; nothing while it runs. Do not call it again after it
  // has ended.
  [[nodiscard]] std::optional<int> has_ended() const;
  void signal(int number) const noexcept;

 private:
  pid_t pid_{0};
  ipc::FileDescriptor input_;
  ipc::FileDescriptor output_;  // none if it has closed it
  std::string text_;            // output that is not a whole line yet
};

// Kills this program when the process `parent`, which has started it, ends: it was killed itself,
// for otherwise it would have waited for an orderly end.
void end_with_parent(pid_t parent) noexcept;

// Describes how a child has ended, for a sentence about it: "was killed by signal 9".
[[nodiscard]] std::string ending_text(int status);

}  // namespace trifinger::apps
