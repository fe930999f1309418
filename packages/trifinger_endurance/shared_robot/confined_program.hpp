// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "shared_robot/job_limits.hpp"
#include "trifinger/base/time.hpp"

namespace trifinger::apps {

class ControlGroup;

// Gives the calling thread a real-time priority above all that a confined program may have, but
// below that of a back-end (80), so that a program which never waits can still be watched and
// ended. Threads and processes that it starts later are ordinary ones. Returns the priority; 0 if
// this user may have none.
int watch_in_real_time() noexcept;
// Makes the calling thread an ordinary one again.
void watch_ordinarily() noexcept;

// A user of the system, with all groups.
struct SystemUser {
  std::string name;
  uid_t user{0};
  gid_t group{0};
  std::vector<gid_t> groups;

  // Throws InvalidArgument if there is no such user.
  [[nodiscard]] static SystemUser find(const std::string& name);
};

// A program, and what it may do.
struct Confinement {
  std::vector<std::string> words;        // the program and its arguments
  std::filesystem::path folder;          // its working folder
  std::vector<std::string> environment;  // all of it: "NAME=VALUE"
  std::optional<SystemUser> user;        // only root can run it as another user
  JobLimits limits;
  // Folders in which it may write besides its own, where the rest can be made read-only.
  std::vector<std::filesystem::path> writable;
  // Where its processes belong, or nullptr. It outlives the program.
  const ControlGroup* group{nullptr};
  // Hide all other processes from it, where the kernel lets us. False only for tests.
  bool with_namespaces{true};
};

// What holds the program.
struct ConfinedBy {
  bool own_processes{false};    // A namespace of its own: it sees no other processes.
  bool own_users{false};        // A namespace of users was needed for this.
  bool read_only{false};        // It can write only where it should.
  bool hides_processes{false};  // Its /proc shows its own processes only.
  bool hides_places{false};     // It does not see what others have in /tmp and the like.
  bool filters_calls{false};    // It cannot make namespaces or memory that no process shows.
  bool counts_memory{false};    // The kernel counts its memory, in a control group.
};

// How a program has ended.
struct ProgramEnd {
  // Why it could not be started, errno; 0: it was.
  int start_error{0};
  int status{0};  // as waitpid gives it
};

// A program in a process of its own, with a session, a folder and limits of its own. A *guard*, a
// process between it and this one, inherits all that the program starts and leaves behind. When the
// program ends, when `kill` is called, or when this process dies, the guard ends them all.
//
// In a namespace of its own for processes the guard is the first process, with which the kernel
// ends all others, whatever they do. Where the kernel allows no namespaces, the guard looks for all
// descendants and kills them; a program of the same user could then kill the guard first.
class ConfinedProgram {
 public:
  // Makes the guard, but does not start the program yet. Call it before any thread is started.
  // Throws SystemError.
  explicit ConfinedProgram(Confinement confinement);
  ConfinedProgram(const ConfinedProgram&) = delete;
  ConfinedProgram& operator=(const ConfinedProgram&) = delete;
  // Ends all its processes.
  ~ConfinedProgram();

  [[nodiscard]] const ConfinedBy& confined_by() const noexcept { return confined_by_; }
  // The number of the guard, from which all processes of the program descend.
  [[nodiscard]] pid_t guard() const noexcept { return guard_; }

  void start() const;
  // Waits until there is output or a message, then takes both. Returns at most some kilobytes of
  // what the program has printed.
  [[nodiscard]] std::string take_output(Nanoseconds timeout);
  // Sends SIGTERM to all its processes.
  void ask_to_end() const noexcept;
  // Kills all its processes, without waiting for their ends.
  void kill() const noexcept;

  // How the program itself has ended; nothing while it runs.
  [[nodiscard]] const std::optional<ProgramEnd>& end() const noexcept { return end_; }
  // True when none of its processes is left and all output was taken.
  [[nodiscard]] bool is_gone() const noexcept { return is_guard_gone_ && output_ < 0; }

 private:
  void take_messages();
  void forget_guard();

  pid_t house_{-1};  // our child: the guard, or its parent outside the namespace
  pid_t guard_{-1};
  int control_{-1};
  int output_{-1};
  bool is_guard_gone_{false};
  ConfinedBy confined_by_;
  std::optional<ProgramEnd> end_;
};

}  // namespace trifinger::apps
