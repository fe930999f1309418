// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/ipc/fork.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

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

TEST(FileDescriptor, IsClosedInAForkedChildAtOnce) {
  const FileDescriptor file = open_null();
  test::ChildProcess child([&] { return is_open(file.get()) ? 2 : 0; });
  EXPECT_EQ(child.wait(), 0);
  EXPECT_TRUE(is_open(file.get()));
}

TEST(FileDescriptor, ClosesNothingInAForkedChildThatHasTheNumberAgain) {
  FileDescriptor file = open_null();
  test::ChildProcess child([&] {
    const int again = ::open("/dev/null", O_RDWR);
    if (again != file.get()) return 2;
    {
      const FileDescriptor inherited = std::move(file);
    }
    return is_open(again) ? 0 : 3;
  });
  EXPECT_EQ(child.wait(), 0);
}

}  // namespace
}  // namespace trifinger::ipc
