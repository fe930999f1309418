// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::log::detail {

// Counts the sessions that appear in the session folder, including those that disappear before
// anybody can look at them.
class SessionCounter {
 public:
  // Counts from now on. Without robots, nothing is watched.
  explicit SessionCounter(const std::vector<std::string>& robots);

  // False if the kernel cannot watch the folder: then sessions have to be searched for.
  [[nodiscard]] bool is_working() const noexcept { return static_cast<bool>(file_); }
  // Becomes readable when there is something new; -1 if watching does not work.
  [[nodiscard]] int descriptor() const noexcept { return file_ ? file_.get() : -1; }
  // Returns how many sessions of each robot have appeared since this counter was made.
  [[nodiscard]] const std::map<std::string, int>& count();

 private:
  ipc::FileDescriptor file_;
  std::map<std::string, int> counts_;
};

}  // namespace trifinger::log::detail
