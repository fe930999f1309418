// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ipc/shared_memory.hpp"
#include "trifinger/ipc/process.hpp"

namespace trifinger::detail {

// The place where the files of sessions lie, by name. This is the only difference between sessions
// inside a process and sessions across processes.
class Directory {
 public:
  Directory() = default;
  Directory(const Directory&) = delete;
  Directory& operator=(const Directory&) = delete;
  virtual ~Directory() = default;

  [[nodiscard]] virtual ipc::SharedMemory create(const std::string& file, std::size_t size,
                                                 unsigned mode) = 0;
  // After this call `open` finds the file. Returns the mapping to keep.
  [[nodiscard]] virtual ipc::SharedMemory publish(const std::string& file,
                                                  ipc::SharedMemory memory) = 0;
  // Opens the existing file, or makes a new one.
  [[nodiscard]] virtual ipc::SharedMemory open_or_create(const std::string& file,
                                                         unsigned mode) = 0;
  // Throws SystemError with ENOENT if there is no such file.
  [[nodiscard]] virtual ipc::SharedMemory open(const std::string& file, ipc::Access access) = 0;
  virtual void remove(const std::string& file) noexcept = 0;
  // Removes all files of the robot `name` except its lock, as far as this user may.
  virtual void remove_all(const std::string& name) noexcept = 0;

  // Throws SystemError, which names owner and remedy, if another user has left a file of the robot
  // `name` that must go before a session can begin and that this user may not remove.
  virtual void require_removed(const std::string& /*name*/) const {}
  // True if a process owns the file, whether or not this user may open it.
  [[nodiscard]] virtual bool is_owned(const std::string& /*file*/) const { return false; }

  // Keeps the memory of a file that was made here, for later files of the same size.
  virtual void give_back(ipc::SharedMemory /*memory*/) noexcept {}
  // Reserves memory for another file like this one.
  virtual void reserve(const std::string& /*file*/, std::size_t /*size*/) {}
  // The other processes that own a file of this name, oldest first. The file may have been removed.
  [[nodiscard]] virtual std::vector<ipc::ProcessIdentity> other_owners(
      const std::string& /*file*/) const {
    return {};
  }
};

// Session files in `folder`.
[[nodiscard]] std::shared_ptr<Directory> directory_in(const std::filesystem::path& folder);
// Session "files" of this process. Their memory is returned to the system, because no other process
// can fill it.
[[nodiscard]] std::shared_ptr<Directory> directory_of_process();

// Calls `open` until the lock file that it returns has its name and `Lock::kClaim` of it is ours.
// Nothing if another process keeps the claim for seconds.
[[nodiscard]] std::optional<ipc::SharedMemory> claim(
    const std::function<ipc::SharedMemory()>& open);
// Ends the use of a lock file that was claimed: see ipc::leave_lock_file.
void leave(const ipc::SharedMemory& lock) noexcept;

[[nodiscard]] std::string state_file(const std::string& name);
[[nodiscard]] std::string action_file(const std::string& name, std::uint64_t session_id);
[[nodiscard]] std::string lock_file(const std::string& name);
// The robot's name in the name of a session: "sim" of "sim.object".
[[nodiscard]] std::string robot_of(const std::string& name);
// The names of the sessions in `folder`, of robots and companions, sorted.
[[nodiscard]] std::vector<std::string> session_names(const std::filesystem::path& folder);
// A number by which everybody knows a session, or a memory with payloads. Never 0.
[[nodiscard]] std::uint64_t random_id();
// Throws InvalidArgument unless `name` can be the name of a robot.
void require_valid_name(const std::string& name);

}  // namespace trifinger::detail
