// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <grp.h>
#include <sys/types.h>
#include <unistd.h>

#include <cerrno>

#include "support/child_process.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::test {

/// The user who owns nothing.
inline constexpr uid_t kNobody = 65534;

/// Makes this process run as the user nobody, as a member of `group` alone. It must be a child of
/// the test that runs as the administrator.
inline void become_nobody(gid_t group = kNobody) {
  if (::setgroups(0, nullptr) != 0 || ::setgid(group) != 0 || ::setuid(kNobody) != 0) {
    throw SystemError("become nobody", errno);
  }
}

/// True if a child may do that: the administrator of a container may lack the right.
inline bool may_become_nobody() {
  ChildProcess child([] {
    become_nobody();
    return 0;
  });
  return child.wait() == 0;
}

}  // namespace trifinger::test
