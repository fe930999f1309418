// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

namespace trifinger::apps {

// A control group (version 2) for the processes of a job. In it the kernel counts all memory that
// they take, in whatever way, and ends them all when it is more than their limit.
class ControlGroup {
 public:
  // Makes a group below that of this process, which itself goes to a second group below where it
  // must, because the kernel limits no groups beside processes. Returns nothing, and leaves this
  // process where it was, if there are no such groups, if this user may not make one, or if other
  // programs are in the group of this one.
  [[nodiscard]] static std::unique_ptr<ControlGroup> make(std::uint64_t memory);
  ControlGroup(const ControlGroup&) = delete;
  ControlGroup& operator=(const ControlGroup&) = delete;
  // Kills what is in the group, removes it, and leaves everything as it was.
  ~ControlGroup();

  // Puts the calling process into it. Takes no memory.
  [[nodiscard]] bool enter() const noexcept;
  // What they use, without what the kernel gives back when it needs it [bytes].
  [[nodiscard]] std::uint64_t memory() const;
  // Whether the kernel has ended them for it.
  [[nodiscard]] bool was_too_large() const;

 private:
  ControlGroup() = default;
  // Lets groups below `above_` have limits of memory.
  [[nodiscard]] bool let_limit();

  std::filesystem::path above_;       // the group in which this process was
  std::filesystem::path job_;         // empty: none was made
  std::filesystem::path supervisor_;  // where this process is now; empty: where it was
  bool has_enabled_{false};           // the control of memory in `above_`
  int entry_{-1};                     // open also in children, unlike a FileDescriptor
};

}  // namespace trifinger::apps
