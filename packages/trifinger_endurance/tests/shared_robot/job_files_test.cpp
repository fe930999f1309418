// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/job_files.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <latch>
#include <limits>
#include <string>
#include <thread>

#include "support/child_process.hpp"
#include "support/folder.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::apps {
namespace {

constexpr FilesUsage kAny{.bytes = std::numeric_limits<std::uint64_t>::max(),
                          .count = std::numeric_limits<std::uint64_t>::max()};

void write(const std::filesystem::path& path, std::size_t size) {
  std::ofstream(path) << std::string(size, 'x');
}

std::vector<ProcessEntry> this_process() {
  return {{.pid = ::getpid(), .live_thread = ::getpid()}};
}

TEST(JobFiles, CountWhatIsInTheFolderWithoutFollowingLinks) {
  const test::Folder folder;
  const test::Folder elsewhere;
  write(elsewhere / "large", 1'000'000);
  std::filesystem::create_directories(folder / "a/b");
  write(folder / "a/b/file", 100'000);
  std::filesystem::create_symlink(elsewhere.path(), folder / "link");
  std::filesystem::create_symlink(folder.path(), folder / "a/loop");
  const JobFiles files(folder.path(), {}, ::geteuid());
  const FilesUsage usage = files.usage(kAny);
  EXPECT_EQ(usage.count, 5U);
  EXPECT_GE(usage.bytes, 100'000U);
  EXPECT_LT(usage.bytes, 500'000U);
}

TEST(JobFiles, StopCountingAboveTheLimit) {
  const test::Folder folder;
  for (int i = 0; i < 100; ++i) write(folder / std::to_string(i), 1);
  const JobFiles files(folder.path(), {}, ::geteuid());
  EXPECT_EQ(files.usage({.bytes = kAny.bytes, .count = 10}).count, 11U);
}

TEST(JobFiles, CountAFileThatWasRemovedButIsStillOpen) {
  const test::Folder folder;
  const std::filesystem::path path = folder / "file";
  write(path, 1'000'000);
  const ipc::FileDescriptor open([&path] { return ::open(path.c_str(), O_RDONLY | O_CLOEXEC); });
  std::filesystem::remove(path);
  JobFiles files(folder.path(), {}, ::geteuid());
  EXPECT_LT(files.usage(kAny).bytes, 1'000'000U);
  files.look_at(this_process());
  EXPECT_GE(files.usage(kAny).bytes, 1'000'000U);
}

TEST(JobFiles, fault_79_CountAFileThatOnlyAnotherThreadHasOpen) {
  const test::Folder folder;
  JobFiles files(folder.path(), {}, ::geteuid());
  std::latch is_open(1);
  std::latch is_done(1);
  const std::jthread thread([&] {
    ASSERT_EQ(::unshare(CLONE_FILES), 0);  // Its table of open files is its own now.
    const std::filesystem::path path = folder / "file";
    write(path, 1'000'000);
    const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    std::filesystem::remove(path);
    is_open.count_down();
    is_done.wait();
    ::close(file);
  });
  is_open.wait();
  files.look_at(this_process());
  is_done.count_down();
  EXPECT_GE(files.usage(kAny).bytes, 1'000'000U);
}

TEST(JobFiles, RemoveFromSharedMemoryWhatTheJobHasMadeAndNobodyUses) {
  const test::Folder folder;
  const test::Folder shared;
  write(shared / "before", 1);
  JobFiles files(folder.path(), {shared.path()}, ::geteuid());
  for (const char* const name : {"left", "open", "of_others"}) write(shared / name, 1);
  const auto open = [&](const char* name) {
    const std::filesystem::path path = shared / name;
    return ipc::FileDescriptor([&path] { return ::open(path.c_str(), O_RDONLY | O_CLOEXEC); });
  };
  const ipc::FileDescriptor held = open("open");
  {
    const ipc::FileDescriptor left = open("left");
    files.look_at(this_process());
  }
  // All that the user makes meanwhile counts, but only what the job had open is its own for sure.
  EXPECT_EQ(files.usage(kAny).count, 3U);
  EXPECT_EQ(files.remove_leftovers(), std::vector{(shared / "left").string()});
  for (const char* const name : {"before", "open", "of_others"}) {
    EXPECT_TRUE(std::filesystem::exists(shared / name)) << name;
  }
}

TEST(JobFiles, CountAndRemoveWhatLiesInFoldersOfSharedMemory) {
  const test::Folder folder;
  const test::Folder shared;
  std::filesystem::create_directories(shared / "before/deep");
  JobFiles files(folder.path(), {shared.path()}, ::geteuid());
  std::filesystem::create_directories(shared / "new/deep");
  std::filesystem::create_directories(shared / "empty");
  for (const char* const name : {"new/deep/file", "before/deep/file"}) {
    const std::filesystem::path path = shared / name;
    write(path, 100'000);
    const ipc::FileDescriptor open([&path] { return ::open(path.c_str(), O_RDONLY | O_CLOEXEC); });
    files.look_at(this_process());
  }
  EXPECT_EQ(files.usage(kAny).count, 5U);
  EXPECT_GE(files.usage(kAny).bytes, 200'000U);
  const std::vector<std::string> removed = files.remove_leftovers();
  EXPECT_EQ(removed.size(), 4U);
  for (const char* const name : {"new", "before/deep/file"})
    EXPECT_FALSE(std::filesystem::exists(shared / name)) << name;
  for (const char* const name : {"before/deep", "empty"})
    EXPECT_TRUE(std::filesystem::exists(shared / name)) << name;
}

TEST(JobFiles, CountAFileOnceIfItsFolderLiesInAnotherSharedOne) {
  const test::Folder folder;
  const test::Folder shared;
  std::filesystem::create_directory(shared / "sessions");
  const JobFiles files(folder.path(), {shared.path(), shared / "sessions"}, ::geteuid());
  write(shared / "sessions/file", 1);
  EXPECT_EQ(files.usage(kAny).count, 1U);
}

TEST(JobFiles, LeaveOutSessionsThatOthersUseAndNoOtherFileOfSuchAName) {
  const test::Folder folder;
  const test::Folder shared;
  JobFiles files(folder.path(), {shared.path()}, ::geteuid());
  for (const char* const name : {"trifinger.robot.state", "trifinger.job.state"})
    write(shared / name, 1);
  const auto open = [&](const char* name) {
    const std::filesystem::path path = shared / name;
    return ipc::FileDescriptor([&path] { return ::open(path.c_str(), O_RDONLY | O_CLOEXEC); });
  };
  const ipc::FileDescriptor robots = open("trifinger.robot.state");
  // This process is not one of the job.
  files.look_at({});
  EXPECT_EQ(files.usage(kAny).count, 1U);
  // And here it is.
  JobFiles others(folder.path(), {shared.path()}, ::geteuid());
  write(shared / "trifinger.job.action", 1);
  const ipc::FileDescriptor jobs = open("trifinger.job.action");
  others.look_at(this_process());
  EXPECT_EQ(others.usage(kAny).count, 1U);
}

TEST(JobFiles, TellThatSomeAreHidden) {
  const test::Folder folder;
  std::filesystem::permissions(folder.path(), std::filesystem::perms(0777));
  test::ChildProcess child([&] {
    // Root may read everything.
    constexpr uid_t kNobody = 65534;
    if (::geteuid() == 0 && (::setegid(kNobody) != 0 || ::seteuid(kNobody) != 0)) return 2;
    const JobFiles files(folder.path(), {}, ::geteuid());
    std::filesystem::create_directories(folder / "open/closed");
    if (files.usage(kAny).is_hidden) return 3;
    for (const unsigned mode : {0300U, 0600U, 0000U}) {
      std::filesystem::permissions(folder / "open/closed", std::filesystem::perms(0777));
      write(folder / "open/closed/file", 1);
      std::filesystem::permissions(folder / "open/closed", std::filesystem::perms(mode));
      if (!files.usage(kAny).is_hidden) return 4;
    }
    std::filesystem::permissions(folder / "open/closed", std::filesystem::perms(0777));
    return files.usage(kAny).is_hidden ? 5 : 0;
  });
  EXPECT_EQ(child.wait(), 0);
}

TEST(JobFiles, AreFoundBehindANameThatIsTooLongForASystemCall) {
  const test::Folder folder;
  const JobFiles files(folder.path(), {}, ::geteuid());
  const std::string name(200, 'x');
  // Each one step from the one before it: the whole path has 10 000 characters, later 50 000.
  ipc::FileDescriptor here(
      [&] { return ::open(folder.path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC); });
  const auto go_deeper = [&](int steps) {
    for (int i = 0; i < steps; ++i) {
      ASSERT_EQ(::mkdirat(here.get(), name.c_str(), 0755), 0);
      here = ipc::FileDescriptor(
          [&] { return ::openat(here.get(), name.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC); });
    }
  };
  go_deeper(50);
  EXPECT_EQ(files.usage(kAny).count, 50U);
  EXPECT_FALSE(files.usage(kAny).is_hidden);
  go_deeper(200);
  EXPECT_TRUE(files.usage(kAny).is_hidden);
}

TEST(JobFiles, AreFoundWhereverTheFolderIs) {
  const test::Folder folder;
  std::filesystem::create_directory(folder / "work");
  const JobFiles files(folder / "work", {}, ::geteuid());
  write(folder / "work/file", 1);
  std::filesystem::rename(folder / "work", folder / "elsewhere");
  EXPECT_EQ(files.usage(kAny).count, 1U);
}

}  // namespace
}  // namespace trifinger::apps
