// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "ipc/shared_memory.hpp"
#include "session_directory.hpp"
#include "session_writer.hpp"
#include "trifinger/base/time.hpp"
#include "trifinger/core/driver.hpp"
#include "trifinger/core/session.hpp"
#include "trifinger/ipc/fork.hpp"
#include "trifinger/ipc/process.hpp"

namespace trifinger::detail {

// The right to make sessions under one name.
class SessionPlace {
 public:
  // Throws RobotOwned, InvalidArgument.
  SessionPlace(std::shared_ptr<Directory> directory, std::string name, SessionOptions options);
  ~SessionPlace();

  struct Writers {
    std::unique_ptr<SessionWriter> robot;
    std::vector<std::unique_ptr<SessionWriter>> companions;
  };
  // Begins the next session and its companions. `realtime_warnings`, see SessionInfo, counts only
  // in real-time mode. The first call takes the memory of two sessions. Each later session reuses
  // the memory of the last but one, unless others still use it. Throws SystemError, or RobotOwned
  // if the name was lost meanwhile.
  [[nodiscard]] Writers begin(const UntypedDriver& driver, bool is_real_time, Nanoseconds period,
                              const std::vector<std::string>& realtime_warnings = {});
  // Removes all files, but owns the name until the process ends. Any thread may call it.
  void withdraw() noexcept;
  // Expires with the back-end that makes the sessions: front-ends may run inside it.
  void set_backend_life(std::weak_ptr<const void> life) noexcept {
    backend_life_ = std::move(life);
  }
  [[nodiscard]] const std::weak_ptr<const void>& backend_life() const noexcept {
    return backend_life_;
  }
  // Later sessions begin as if they had run for ages: their step 0 has this index.
  void begin_at(TimeIndex first_index) noexcept { first_index_ = first_index; }

  [[nodiscard]] const std::shared_ptr<Directory>& directory() const noexcept { return directory_; }
  [[nodiscard]] const std::string& name() const noexcept { return name_; }

 private:
  // Throws RobotOwned, SystemError. `is_ours`: we had the name before, and the state file is our
  // session's.
  void take_name(bool is_ours);
  // Makes the claimed lock file, or a new one in its place, that of this process.
  void own(ipc::SharedMemory& lock, bool is_ours);
  // The process that runs a robot of this name, even if its lock was removed. Nothing if none is
  // found.
  [[nodiscard]] std::optional<std::string> find_owner() const;
  // The back-end of the session that can be found, if there is one.
  [[nodiscard]] std::optional<ipc::ProcessIdentity> last_backend() const;
  // True if a child of a dead back-end keeps the lock.
  [[nodiscard]] bool is_left_by_the_dead() const;
  // True if the back-end that has the name is being killed.
  [[nodiscard]] bool is_left_by_the_dying() const;
  [[noreturn]] void throw_owned(const std::string& owner) const;

  std::shared_ptr<Directory> directory_;
  std::string name_;
  SessionOptions options_;
  TimeIndex first_index_{0};
  std::optional<ipc::SharedMemory> lock_;
  std::mutex mutex_;  // guards lock_ against `withdraw`
  bool has_reserve_{false};
  std::weak_ptr<const void> backend_life_;
  ipc::ForkGuard fork_;
};

}  // namespace trifinger::detail
