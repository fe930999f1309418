// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/system_call_filter.hpp"

#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/syscall.h>

#include <algorithm>
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

// Glibc 2.36 does not know the name. The number is the same for all processors.
constexpr std::uint32_t kMemfdSecret = 447;

// Who finds that the kernel has none of these tries another way. The flags of clone3 are in memory,
// where a filter cannot look; everybody then tries clone.
constexpr std::array<std::uint32_t, 3> kMissing{SYS_clone3, SYS_io_uring_setup, kMemfdSecret};
// docs/decisions/hold_of_jobs.md has what each of them could hide.
constexpr std::array<std::uint32_t, 6> kRefused{SYS_shmget,   SYS_msgget, SYS_semget,
                                                SYS_vmsplice, SYS_bpf,    SYS_perf_event_open};

constexpr sock_filter load(std::size_t offset) {
  return {BPF_LD | BPF_W | BPF_ABS, 0, 0, static_cast<std::uint32_t>(offset)};
}
// Jumps over so many steps if the number is equal, or if it is not.
constexpr sock_filter if_equal(std::uint32_t number, std::uint8_t over) {
  return {BPF_JMP | BPF_JEQ | BPF_K, over, 0, number};
}
constexpr sock_filter unless_equal(std::uint32_t number, std::uint8_t over) {
  return {BPF_JMP | BPF_JEQ | BPF_K, 0, over, number};
}
constexpr sock_filter refuse(std::uint32_t error) {
  return {BPF_RET | BPF_K, 0, 0, SECCOMP_RET_ERRNO | error};
}
constexpr sock_filter kAllow{BPF_RET | BPF_K, 0, 0, SECCOMP_RET_ALLOW};

// The lower half of the first argument.
constexpr std::size_t kFlags = offsetof(seccomp_data, args);

constexpr auto kProgram = [] {
  // Another set of system calls of the same processor, x32, has this bit.
  constexpr std::uint32_t kOtherSet = 0x40000000;
  constexpr std::array kBegin{
      load(offsetof(seccomp_data, arch)),
      if_equal(kProcessor, 1),
      refuse(ENOSYS),
      load(offsetof(seccomp_data, nr)),
      sock_filter{BPF_JMP | BPF_JGE | BPF_K, 0, 1, kOtherSet},
      refuse(ENOSYS),
  };
  constexpr std::array kEnd{
      if_equal(SYS_clone, 2),
      if_equal(SYS_unshare, 1),
      kAllow,
      load(kFlags),
      sock_filter{BPF_JMP | BPF_JSET | BPF_K, 0, 1, kNamespaces},
      refuse(EPERM),
      kAllow,
  };
  std::array<sock_filter, kBegin.size() + 2 * (kMissing.size() + kRefused.size()) + kEnd.size()>
      program{};
  auto* next = std::ranges::copy(kBegin, program.begin()).out;
  for (const std::uint32_t call : kMissing) {
    *next++ = unless_equal(call, 1);
    *next++ = refuse(ENOSYS);
  }
  for (const std::uint32_t call : kRefused) {
    *next++ = unless_equal(call, 1);
    *next++ = refuse(EPERM);
  }
  std::ranges::copy(kEnd, next);
  return program;
}();

}  // namespace

bool can_forbid_hidden_memory() noexcept { return kProcessor != 0 && ::prctl(PR_GET_SECCOMP) >= 0; }

bool forbid_hidden_memory() noexcept {
  std::array program = kProgram;
  const sock_fprog filter{.len = program.size(), .filter = program.data()};
  return ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) == 0;
}

}  // namespace trifinger::apps
