// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/job_files.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <string>

#include "support/folder.hpp"
#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::apps {
namespace {

constexpr FilesUsage kAny{.bytes = std::numeric_limits<std::uint64_t>::max(),
                          .count = std::numeric_limits<std::uint64_t>::max()};

void write(const std::filesystem::path& path, std::size_t size) {
  std::ofstream(path) << std::string(size, 'x');
}

std::vector<ProcessEntry> this_process() { return {{.pid = ::getpid()}}; }

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
  EXPECT_EQ(files.usage(kAny).count, 2U);
  EXPECT_EQ(files.remove_leftovers(), std::vector{(shared / "left").string()});
  for (const char* const name : {"before", "open", "of_others"}) {
    EXPECT_TRUE(std::filesystem::exists(shared / name)) << name;
  }
}

}  // namespace
}  // namespace trifinger::apps
