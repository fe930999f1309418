// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/types.h>

#include <cstdint>

#include "shared_robot/confined_program.hpp"

// The processes between `ConfinedProgram` and its program. They talk over a socket that keeps
// messages apart.
namespace trifinger::apps {

enum class Order : char { kStart, kAskToEnd, kKill };

struct GuardMessage {
  enum class Kind : int {
    kGuard,     // `value`: the number of the guard in our namespace
    kConfined,  // `confined_by`; the guard waits for kStart
    kEnded,     // the program has ended: `value` is its status, `error` why it was not started
    kAllGone,   // no process is left
  };
  Kind kind{Kind::kGuard};
  int value{0};
  int error{0};
  ConfinedBy confined_by{};
};

// What the guard needs besides the confinement.
struct GuardOptions {
  int control{-1};
  int output{-1};                  // what the program gets as standard output and as standard error
  pid_t parent{0};                 // the process that has made the guard
  std::uint64_t other_threads{0};  // of the program's user, for the kernel counts them together
};

// The work of the child process that `ConfinedProgram` makes: becomes the guard, or makes it in a
// namespace and waits for it. Never returns.
[[noreturn]] void keep_house(const Confinement& confinement, const GuardOptions& options);

}  // namespace trifinger::apps
