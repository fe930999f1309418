// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/ipc/fork.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "ipc/forkable_mutex.hpp"
#include "support/child_process.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::ipc {
namespace {

bool is_open(int fd) { return ::fcntl(fd, F_GETFD) >= 0; }

FileDescriptor open_null() {
  return FileDescriptor([] { return ::open("/dev/null", O_RDWR | O_CLOEXEC); });
}

TEST(ForkGuard, KnowsAForkedChild) {
  const ForkGuard guard;
  EXPECT_FALSE(guard.is_inherited());
  test::ChildProcess child([&] {
    const ForkGuard of_child;
    return guard.is_inherited() && !of_child.is_inherited() ? 0 : 2;
  });
  EXPECT_EQ(child.wait(), 0);
  EXPECT_FALSE(guard.is_inherited());
}

TEST(ForkGuard, KnowsAGrandchild) {
  const ForkGuard guard;
  test::ChildProcess child([&] {
    test::ChildProcess grandchild([&] { return guard.is_inherited() ? 0 : 2; });
    return grandchild.wait();
  });
  EXPECT_EQ(child.wait(), 0);
}

TEST(FileDescriptor, IsClosedWithItsOwner) {
  int fd = -1;
  {
    const FileDescriptor file = open_null();
    fd = file.get();
    EXPECT_TRUE(is_open(fd));
  }
  EXPECT_FALSE(is_open(fd));
}

TEST(FileDescriptor, MovesWithItsOwner) {
  FileDescriptor first = open_null();
  const int fd = first.get();
  FileDescriptor second(std::move(first));
  EXPECT_FALSE(first);  // NOLINT(bugprone-use-after-move): that is the question
  EXPECT_EQ(second.get(), fd);
  FileDescriptor third = open_null();
  third = std::move(second);
  EXPECT_EQ(third.get(), fd);
  EXPECT_TRUE(is_open(fd));
}

// The file that a descriptor leads to.
std::filesystem::path target_of(int fd) {
  return std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(fd));
}

TEST(FileDescriptor, IsClosedInAForkedChildAtOnce) {
  const FileDescriptor file = open_null();
  test::ChildProcess child([&] { return target_of(file.get()) == "/dev/null" ? 2 : 0; });
  EXPECT_EQ(child.wait(), 0);
  EXPECT_EQ(target_of(file.get()), "/dev/null");
}

TEST(FileDescriptor, fault_64_NeverReachesALaterFileInAForkedChild) {
  std::optional<FileDescriptor> file = open_null();
  test::ChildProcess child([&] {
    const int fd = file->get();
    for (int i = 0; i < 100; ++i) {
      if (::open("/dev/zero", O_RDWR) == fd) return 2;
    }
    char byte = 1;
    if (::read(fd, &byte, 1) != -1 || errno != EBADF) return 3;
    if (::pwrite(fd, &byte, 1, 0) != -1 || errno != EBADF) return 4;
    file.reset();
    return ::open("/dev/zero", O_RDWR) == fd ? 0 : 5;  // nothing is left of it
  });
  EXPECT_EQ(child.wait(), 0);
  EXPECT_TRUE(is_open(file->get()));
}

TEST(FileDescriptor, fault_64_NeverReachesALaterFileWhereNoNumberWasFree) {
  test::ChildProcess process([] {
    const FileDescriptor first = open_null();
    const FileDescriptor second = open_null();
    rlimit limit{};
    if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return 2;
    const rlim_t usual = limit.rlim_cur;
    const auto allow = [&limit](rlim_t number) {
      limit.rlim_cur = number;
      return ::setrlimit(RLIMIT_NOFILE, &limit) == 0;
    };
    if (!allow(static_cast<rlim_t>(second.get()) + 1)) return 3;
    while (::open("/dev/null", O_RDWR | O_CLOEXEC) >= 0) {
    }
    test::ChildProcess child([&] {
      if (::open("/dev/zero", O_RDWR) >= 0) return 4;
      if (!allow(usual)) return 5;
      for (const int fd : {first.get(), second.get()}) {
        if (!is_open(fd) || target_of(fd) == "/dev/null") return 6;
      }
      return 0;
    });
    return child.wait();
  });
  EXPECT_EQ(process.wait(), 0);
}

TEST(FileDescriptor, fault_64_OfAGrandchildIsClosedToo) {
  const FileDescriptor file = open_null();
  test::ChildProcess child([&] {
    const FileDescriptor own = open_null();
    test::ChildProcess grandchild([&] {
      return target_of(own.get()) == "/dev/null" || target_of(file.get()) == "/dev/null" ? 2 : 0;
    });
    return grandchild.wait() == 0 && target_of(own.get()) == "/dev/null" ? 0 : 3;
  });
  EXPECT_EQ(child.wait(), 0);
}

TEST(FileDescriptor, OfAForkedChildIsItsOwn) {
  FileDescriptor file = open_null();
  test::ChildProcess child([&] {
    FileDescriptor own = open_null();
    file = std::move(own);
    return file && is_open(file.get()) ? 0 : 2;
  });
  EXPECT_EQ(child.wait(), 0);
}

TEST(ForkableMutex, fault_64_IsFreeInAForkedChildAndItsDataAreWhole) {
  ForkableMutex mutex;
  int first = 0;
  int second = 0;
  std::atomic<bool> is_done{false};
  std::jthread writer([&] {
    // relaxed: a flag that guards no data.
    while (!is_done.load(std::memory_order_relaxed)) {
      {
        const std::lock_guard lock(mutex);
        ++first;
        ++second;
      }
      std::this_thread::yield();
    }
  });
  for (int i = 0; i < 50; ++i) {
    test::ChildProcess child([&] {
      const std::lock_guard lock(mutex);
      return first == second ? 0 : 2;
    });
    EXPECT_EQ(child.wait(), 0);
  }
  is_done.store(true, std::memory_order_relaxed);
}

}  // namespace
}  // namespace trifinger::ipc
