// SPDX-License-Identifier: BSD-3-Clause
// A job in a control group of a kernel. ./run check runs this in a virtual machine
// (tools/can_machine.py), because containers have no groups of their own.
#include "shared_robot/control_group.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/ipc.h>
#include <sys/mman.h>
#include <sys/sem.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "shared_robot/confined_program.hpp"
#include "support/folder.hpp"

namespace trifinger::apps {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kLimit = 40'000'000;
constexpr std::uint64_t kMuch = 3 * kLimit;
constexpr uid_t kNobody = 65534;
const fs::path kGroups = "/sys/fs/cgroup";

std::string text_of(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

// Groups that turns have made in `folder`.
std::vector<std::string> groups_in(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("trifinger_")) names.push_back(name);
  }
  return names;
}

// Returns how a child ends that does `work`.
int status_of(const std::function<void()>& work) {
  const pid_t child = ::fork();
  if (child == 0) {
    work();
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return status;
}

class ControlGroupTest : public testing::Test {
 protected:
  void SetUp() override {
    if (std::getenv("TRIFINGER_TEST_MACHINE") == nullptr) {
      GTEST_SKIP() << "needs a machine of its own";
    }
  }
};

void fill_sockets() {
  constexpr int kLarge = 1 << 26;
  std::vector<char> message(1 << 16, 'x');
  for (std::uint64_t sent = 0; sent < kMuch;) {
    std::array<int, 2> ends{};
    ::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends.data());
    ::setsockopt(ends[0], SOL_SOCKET, SO_SNDBUF, &kLarge, sizeof(kLarge));
    for (ssize_t size = 0; (size = ::write(ends[0], message.data(), message.size())) > 0;) {
      sent += static_cast<std::uint64_t>(size);
    }
  }
}

void make_semaphores() {
  constexpr int kEach = 32000;
  constexpr std::uint64_t kBytes = 64;  // of each semaphore
  for (std::uint64_t made = 0; made < kMuch; made += kEach * kBytes) {
    if (::semget(IPC_PRIVATE, kEach, 0600) < 0) return;
  }
}

// A file without a name that is under way, so that no process has it open.
void send_file_to_itself() {
  const int file = ::memfd_create("hidden", MFD_CLOEXEC);
  const std::vector<char> block(1 << 20, 'x');
  for (std::uint64_t written = 0; written < kMuch; written += block.size()) {
    if (::write(file, block.data(), block.size()) < 0) return;
  }
  std::array<int, 2> ends{};
  ::socketpair(AF_UNIX, SOCK_STREAM, 0, ends.data());
  char byte = 'x';
  iovec data{.iov_base = &byte, .iov_len = 1};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
  msghdr message{};
  message.msg_iov = &data;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  cmsghdr* const header = CMSG_FIRSTHDR(&message);
  header->cmsg_level = SOL_SOCKET;
  header->cmsg_type = SCM_RIGHTS;
  header->cmsg_len = CMSG_LEN(sizeof(int));
  std::memcpy(CMSG_DATA(header), &file, sizeof(file));
  ::sendmsg(ends[0], &message, 0);
  ::close(file);
}

TEST_F(ControlGroupTest, fault_79_EndsWhoeverTakesTooMuchMemoryInWhateverWay) {
  for (void (*const hide)() : {fill_sockets, make_semaphores, send_file_to_itself}) {
    const std::unique_ptr<ControlGroup> group = ControlGroup::make(kLimit);
    ASSERT_TRUE(group);
    EXPECT_FALSE(group->was_too_large());
    const int status = status_of([&] {
      if (group->enter()) hide();
    });
    EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL) << status;
    EXPECT_TRUE(group->was_too_large());
  }
}

TEST_F(ControlGroupTest, LeavesAloneWhoTakesLess) {
  const std::unique_ptr<ControlGroup> group = ControlGroup::make(kMuch);
  ASSERT_TRUE(group);
  const int status = status_of([&] {
    if (!group->enter()) ::_exit(1);
    const std::vector<char> memory(kLimit, 'x');
    ::_exit(group->memory() >= kLimit && group->memory() < kMuch ? 0 : 2);
  });
  EXPECT_EQ(status, 0);
  EXPECT_FALSE(group->was_too_large());
}

TEST_F(ControlGroupTest, HoldsAConfinedProgramAndLeavesNothingBehind) {
  const std::string before = text_of("/proc/self/cgroup");
  for (const bool with_namespaces : {true, false}) {
    const test::Folder folder;
    const std::unique_ptr<ControlGroup> group = ControlGroup::make(kMuch);
    ASSERT_TRUE(group);
    const SystemUser nobody{.name = "nobody", .user = kNobody, .group = kNobody, .groups = {}};
    Confinement confinement{.words = {"/bin/sh", "-c", "(cat /proc/self/cgroup)"},
                            .folder = folder.path(),
                            .environment = {"PATH=/bin"},
                            .user = nobody,
                            .limits = {},
                            .writable = {},
                            .group = group.get(),
                            .with_namespaces = with_namespaces};
    fs::permissions(folder.path(), fs::perms(0777));
    ConfinedProgram program(confinement);
    EXPECT_TRUE(program.confined_by().counts_memory);
    program.start();
    std::string output;
    while (!program.is_gone()) output += program.take_output(std::chrono::milliseconds(20));
    EXPECT_THAT(output, testing::HasSubstr("/trifinger_job_"));
  }
  EXPECT_THAT(groups_in(kGroups), testing::IsEmpty());
  EXPECT_EQ(text_of("/proc/self/cgroup"), before);
}

TEST_F(ControlGroupTest, LeavesTheControlOfMemoryAsItWas) {
  const fs::path control = kGroups / "cgroup.subtree_control";
  for (const char* const change : {"-memory", "+memory"}) {
    std::ofstream(control) << change << std::flush;
    const std::string before = text_of(control);
    EXPECT_TRUE(ControlGroup::make(kLimit));
    EXPECT_EQ(text_of(control), before);
  }
}

// In containers the numbers of processes are soon used again.
TEST_F(ControlGroupTest, IsMadeWhereOneOfTheSameNumberWasLeft) {
  fs::create_directory(kGroups / ("trifinger_job_" + std::to_string(::getpid())));
  EXPECT_TRUE(ControlGroup::make(kLimit));
  EXPECT_THAT(groups_in(kGroups), testing::IsEmpty());
}

// What `systemd-run --user --scope -p Delegate=yes` gives: a group that belongs to the user.
TEST_F(ControlGroupTest, HoldsInAGroupThatIsDelegatedToAUser) {
  const fs::path scope = kGroups / "scope";
  std::ofstream(kGroups / "cgroup.subtree_control") << "+memory" << std::flush;
  fs::create_directory(scope);
  for (const char* const name : {"", "cgroup.procs", "cgroup.subtree_control"}) {
    ASSERT_EQ(::chown((scope / name).c_str(), kNobody, kNobody), 0) << name;
  }
  const int status = status_of([&] {
    std::ofstream(scope / "cgroup.procs") << "0" << std::flush;
    if (::setresgid(kNobody, kNobody, kNobody) != 0 || ::setresuid(kNobody, kNobody, kNobody) != 0)
      ::_exit(1);
    {
      const std::unique_ptr<ControlGroup> group = ControlGroup::make(kLimit);
      if (!group) ::_exit(2);
      const int end = status_of([&] {
        if (group->enter()) fill_sockets();
      });
      if (!WIFSIGNALED(end) || !group->was_too_large()) ::_exit(3);
    }
    if (!groups_in(scope).empty()) ::_exit(4);
    if (text_of("/proc/self/cgroup").find("0::/scope\n") == std::string::npos) ::_exit(5);
    // A turn that was killed leaves its groups to the next one.
    const pid_t ended = ::fork();
    if (ended == 0) ::_exit(0);
    ::waitpid(ended, nullptr, 0);
    for (const char* const name : {"trifinger_job_", "trifinger_turn_"}) {
      fs::create_directory(scope / (name + std::to_string(ended)));
    }
    const bool is_made = ControlGroup::make(kLimit) != nullptr;
    if (!is_made || !groups_in(scope).empty()) ::_exit(6);
  });
  EXPECT_EQ(status, 0) << WEXITSTATUS(status);
  EXPECT_EQ(::rmdir(scope.c_str()), 0);
}

// Another program in the group of a turn would be limited with it.
TEST_F(ControlGroupTest, IsNotMadeBesideOtherPrograms) {
  const fs::path scope = kGroups / "scope";
  std::ofstream(kGroups / "cgroup.subtree_control") << "+memory" << std::flush;
  fs::create_directory(scope);
  const int status = status_of([&] {
    std::ofstream(scope / "cgroup.procs") << "0" << std::flush;
    const pid_t other = ::fork();
    if (other == 0) {
      for (;;) ::pause();
    }
    const bool is_made = ControlGroup::make(kLimit) != nullptr;
    const bool is_left = !groups_in(scope).empty();
    ::kill(other, SIGKILL);
    ::waitpid(other, nullptr, 0);
    ::_exit((is_made ? 1 : 0) + (is_left ? 2 : 0));
  });
  EXPECT_EQ(status, 0) << WEXITSTATUS(status);
  EXPECT_EQ(::rmdir(scope.c_str()), 0);
}

}  // namespace
}  // namespace trifinger::apps
