// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/system_call_filter.hpp"

#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/syscall.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>

namespace trifinger::apps {
namespace {

#if defined(__x86_64__)
constexpr std::uint32_t kProcessor = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr std::uint32_t kProcessor = AUDIT_ARCH_AARCH64;
#else
constexpr std::uint32_t kProcessor = 0;  // The order of arguments is not known.
#endif

constexpr std::uint32_t kNamespaces = CLONE_NEWUSER | CLONE_NEWNS | CLONE_NEWPID | CLONE_NEWIPC |
                                      CLONE_NEWNET | CLONE_NEWUTS | CLONE_NEWCGROUP;

constexpr sock_filter load(std::size_t offset) {
  return {BPF_LD | BPF_W | BPF_ABS, 0, 0, static_cast<std::uint32_t>(offset)};
}
// Jumps over so many steps if the number is equal.
constexpr sock_filter if_equal(std::uint32_t number, std::uint8_t over) {
  return {BPF_JMP | BPF_JEQ | BPF_K, over, 0, number};
}
constexpr sock_filter refuse(std::uint32_t error) {
  return {BPF_RET | BPF_K, 0, 0, SECCOMP_RET_ERRNO | error};
}
constexpr sock_filter kAllow{BPF_RET | BPF_K, 0, 0, SECCOMP_RET_ALLOW};

// The lower half of the first argument.
constexpr std::size_t kFlags = offsetof(seccomp_data, args);

}  // namespace

bool can_forbid_hidden_memory() noexcept { return kProcessor != 0 && ::prctl(PR_GET_SECCOMP) >= 0; }

bool forbid_hidden_memory() noexcept {
  // Another set of system calls of the same processor, x32, has this bit.
  constexpr std::uint32_t kOtherSet = 0x40000000;
  std::array program{
      load(offsetof(seccomp_data, arch)),
      if_equal(kProcessor, 1),
      refuse(ENOSYS),
      load(offsetof(seccomp_data, nr)),
      sock_filter{BPF_JMP | BPF_JGE | BPF_K, 6, 0, kOtherSet},
      // Its flags are in memory, where this cannot look. Everybody then tries clone.
      if_equal(SYS_clone3, 5),
      if_equal(SYS_shmget, 5),
      if_equal(SYS_msgget, 4),
      if_equal(SYS_clone, 4),
      if_equal(SYS_unshare, 3),
      kAllow,
      refuse(ENOSYS),
      refuse(EPERM),
      load(kFlags),
      sock_filter{BPF_JMP | BPF_JSET | BPF_K, 0, 1, kNamespaces},
      refuse(EPERM),
      kAllow,
  };
  const sock_fprog filter{.len = program.size(), .filter = program.data()};
  return ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) == 0;
}

}  // namespace trifinger::apps
