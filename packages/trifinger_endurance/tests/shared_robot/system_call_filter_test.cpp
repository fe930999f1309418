// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/system_call_filter.hpp"

#include <gtest/gtest.h>
#include <linux/bpf.h>
#include <linux/perf_event.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <string>
#include <vector>

namespace trifinger::apps {
namespace {

struct Call {
  std::string name;
  long number;
  std::array<long, 3> arguments;
  int error;  // 0: the call is allowed
};

// A filter is for ever, so a child has it. Returns errno of the call there; -1: there is no filter.
int error_of(const Call& call) {
  const pid_t child = ::fork();
  if (child == 0) {
    if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 || !forbid_hidden_memory()) ::_exit(255);
    const auto [a, b, c] = call.arguments;
    ::_exit(::syscall(call.number, a, b, c) < 0 ? errno : 0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) != 255 ? WEXITSTATUS(status) : -1;
}

TEST(SystemCallFilter, fault_79_RefusesWhateverTakesMemoryThatNoProcessShows) {
  if (!can_forbid_hidden_memory()) GTEST_SKIP() << "the kernel has no such filters";
  constexpr long kMemfdSecret = 447;  // glibc 2.36 does not know the name
  bpf_attr map{};
  map.map_type = BPF_MAP_TYPE_ARRAY;
  map.key_size = sizeof(std::uint32_t);
  map.value_size = map.max_entries = 1024;
  perf_event_attr event{};
  event.size = sizeof(event);
  event.type = PERF_TYPE_SOFTWARE;
  std::array<std::uint32_t, 30> ring{};
  const auto at = [](auto& value) { return reinterpret_cast<long>(&value); };
  const std::vector<Call> calls{
      {"semget", SYS_semget, {0, 32000, 0600}, EPERM},
      {"shmget", SYS_shmget, {0, 4096, 0600}, EPERM},
      {"msgget", SYS_msgget, {0, 0600, 0}, EPERM},
      {"vmsplice", SYS_vmsplice, {STDOUT_FILENO, 0, 0}, EPERM},
      {"bpf", SYS_bpf, {BPF_MAP_CREATE, at(map), sizeof(map)}, EPERM},
      {"perf_event_open", SYS_perf_event_open, {at(event), 0, -1}, EPERM},
      {"memfd_secret", kMemfdSecret, {0, 0, 0}, ENOSYS},
      {"io_uring_setup", SYS_io_uring_setup, {8, at(ring), 0}, ENOSYS},
      {"unshare", SYS_unshare, {CLONE_NEWUSER, 0, 0}, EPERM},
      {"clone3", SYS_clone3, {0, 0, 0}, ENOSYS},
      {"getpid", SYS_getpid, {0, 0, 0}, 0},
  };
  for (const Call& call : calls) EXPECT_EQ(error_of(call), call.error) << call.name;
}

}  // namespace
}  // namespace trifinger::apps
