// SPDX-License-Identifier: BSD-3-Clause
#include "ipc/file_lock.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <filesystem>
#include <optional>
#include <string>

#include "support/child_process.hpp"
#include "support/session_folder.hpp"
#include "support/shared_value.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::ipc {
namespace {

class FileLock : public ::testing::Test {
 protected:
  [[nodiscard]] FileDescriptor open(int flags = O_RDWR) const {
    return FileDescriptor([&] { return ::open(path_.c_str(), flags | O_CREAT | O_CLOEXEC, 0600); });
  }

  test::SessionFolder folder_;
  std::filesystem::path path_{folder_.path() / "lock"};
};

// A pipe: the child signals that it has reached a point, and the parent waits for that.
class Signal {
 public:
  Signal() { EXPECT_EQ(::pipe(ends_.data()), 0); }
  Signal(const Signal&) = delete;
  Signal& operator=(const Signal&) = delete;
  ~Signal() {
    ::close(ends_[0]);
    ::close(ends_[1]);
  }
  void give() const { EXPECT_EQ(::write(ends_[1], "x", 1), 1); }
  void wait() const {
    char byte = 0;
    EXPECT_EQ(::read(ends_[0], &byte, 1), 1);
  }

 private:
  std::array<int, 2> ends_{};
};

TEST_F(FileLock, IsHeldByOneDescriptorAtATime) {
  const FileDescriptor first = open();
  const FileDescriptor second = open();
  EXPECT_FALSE(is_locked_by_other(second));
  EXPECT_TRUE(try_lock(first));
  EXPECT_TRUE(try_lock(first)) << "who has it has it";
  EXPECT_FALSE(try_lock(second));
  EXPECT_TRUE(is_locked_by_other(second));
  EXPECT_FALSE(is_locked_by_other(first)) << "its own lock";
  unlock(first);
  EXPECT_FALSE(is_locked_by_other(second));
  EXPECT_TRUE(try_lock(second));
}

TEST_F(FileLock, SurvivesTheClosingOfAnotherDescriptor) {
  const FileDescriptor holder = open();
  const FileDescriptor prober = open();
  ASSERT_TRUE(try_lock(holder));
  {
    const FileDescriptor other = open();
  }
  EXPECT_TRUE(is_locked_by_other(prober)) << "POSIX locks are lost here";
}

TEST_F(FileLock, CanBeProbedWithoutWritePermission) {
  const FileDescriptor holder = open();
  const FileDescriptor prober = open(O_RDONLY);
  EXPECT_FALSE(is_locked_by_other(prober));
  ASSERT_TRUE(try_lock(holder));
  EXPECT_TRUE(is_locked_by_other(prober));
}

TEST_F(FileLock, CannotBeTakenWithoutWritePermission) {
  const FileDescriptor writer = open();
  const FileDescriptor reader = open(O_RDONLY);
  EXPECT_THROW(static_cast<void>(try_lock(reader)), SystemError);
}

TEST_F(FileLock, EndsWithItsHolderHoweverItEnds) {
  const FileDescriptor prober = open();
  const Signal locked;
  test::ChildProcess child([&] {
    const FileDescriptor file = open();
    if (!try_lock(file)) return 1;
    locked.give();
    while (true) ::pause();
  });
  locked.wait();
  EXPECT_TRUE(is_locked_by_other(prober));
  EXPECT_FALSE(try_lock(prober));
  child.kill();
  EXPECT_FALSE(is_locked_by_other(prober));
  EXPECT_TRUE(try_lock(prober));
}

TEST_F(FileLock, OfOneKindDoesNotTouchThoseOfOthers) {
  const FileDescriptor first = open();
  const FileDescriptor second = open();
  ASSERT_TRUE(try_lock(first, Lock::kOwner));
  EXPECT_TRUE(try_lock(second, Lock::kClaim));
  EXPECT_FALSE(try_lock(first, Lock::kClaim));
  EXPECT_FALSE(is_locked_by_other(first, Lock::kUse));
}

TEST_F(FileLock, CanBeShared) {
  const FileDescriptor owner = open();
  const FileDescriptor reader = open(O_RDONLY);
  {
    const FileDescriptor another = open(O_RDONLY);
    EXPECT_TRUE(try_share(reader, Lock::kUse));
    EXPECT_TRUE(try_share(another, Lock::kUse));
  }
  EXPECT_FALSE(try_lock(owner, Lock::kUse));
  unlock(reader, Lock::kUse);
  EXPECT_TRUE(try_lock(owner, Lock::kUse));
  EXPECT_FALSE(try_share(reader, Lock::kUse));
}

TEST_F(FileLock, fault_32_ShowsItsOwnersAlsoWhenTheFileWasRemoved) {
  const Signal locked;
  test::ChildProcess child([&] {
    const FileDescriptor file = open();
    if (!try_lock(file)) return 1;
    locked.give();
    while (true) ::pause();
  });
  locked.wait();
  const auto expect_found = [&] {
    const auto owners = owners_of(path_);
    ASSERT_EQ(owners.size(), 1U);
    EXPECT_EQ(owners.front().pid, child.pid());
    EXPECT_TRUE(owners.front().is_alive());
  };
  // The parent has it open as well, and does not own it.
  const FileDescriptor reader = open();
  ASSERT_TRUE(try_share(reader, Lock::kUse));
  expect_found();
  std::filesystem::remove(path_);
  expect_found();
  // Another file with this name does not belong to the child either.
  const FileDescriptor other(
      [this] { return ::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600); });
  expect_found();
  child.kill();
  EXPECT_TRUE(owners_of(path_).empty());
  EXPECT_TRUE(owners_of("/nowhere/at/all").empty());
}

// Each memory file system counts its files from one.
TEST_F(FileLock, fault_80_OfAFileElsewhereWithTheSameNumberIsNotTakenForThis) {
  constexpr int kNotAllowed = 77;
  test::ChildProcess child([this] {
    if (::unshare(CLONE_NEWNS) != 0 ||
        ::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0) {
      return kNotAllowed;
    }
    std::array<FileDescriptor, 2> files;
    std::array<std::filesystem::path, 2> paths;
    std::array<struct stat, 2> found{};
    for (std::size_t i = 0; i < files.size(); ++i) {
      const std::filesystem::path folder = folder_.path() / std::to_string(i);
      std::filesystem::create_directory(folder);
      if (::mount("none", folder.c_str(), "tmpfs", 0, nullptr) != 0) return kNotAllowed;
      paths.at(i) = folder / "lock";
      files.at(i) = FileDescriptor(
          [&] { return ::open(paths.at(i).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600); });
      if (::fstat(files.at(i).get(), &found.at(i)) != 0) return 2;
    }
    if (found[0].st_ino != found[1].st_ino) return kNotAllowed;
    if (is_owned(paths[0]) || is_owned(paths[1])) return 3;
    if (!try_lock(files[0]) || !is_owned(paths[0])) return 4;
    return is_owned(paths[1]) ? 5 : 0;
  });
  const int code = child.wait();
  if (code == kNotAllowed) GTEST_SKIP() << "only the administrator can mount";
  EXPECT_EQ(code, 0);
}

TEST_F(FileLock, IsNotKeptByAForkedChildOfItsHolder) {
  const FileDescriptor prober = open();
  const Signal grandchild_lives;
  const test::SharedValue<pid_t> grandchild;
  test::ChildProcess holder([&] {
    const FileDescriptor file = open();
    if (!try_lock(file)) return 1;
    if (::fork() == 0) {
      *grandchild = ::getpid();
      grandchild_lives.give();
    }
    while (true) ::pause();
  });
  grandchild_lives.wait();
  EXPECT_TRUE(is_locked_by_other(prober));
  holder.kill();
  EXPECT_FALSE(is_locked_by_other(prober)) << "the grandchild keeps the lock of the dead";
  ::kill(*grandchild, SIGKILL);
}

}  // namespace
}  // namespace trifinger::ipc
