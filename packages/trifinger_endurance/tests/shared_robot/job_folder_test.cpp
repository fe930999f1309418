// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/job_folder.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <optional>

#include "shared/exit_code.hpp"
#include "support/folder.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::apps {
namespace {

namespace fs = std::filesystem;

bool is_root() { return ::geteuid() == 0; }

uid_t owner_of(const fs::path& path) {
  struct stat status{};
  EXPECT_EQ(::lstat(path.c_str(), &status), 0) << path;
  return status.st_uid;
}

TEST(JobFolder, IsMadeWithItsWorkingFolder) {
  const test::Folder place;
  const fs::path folder = make_job_folder(place / "jobs/./1/");
  EXPECT_EQ(folder, fs::canonical(place.path()) / "jobs/1");
  const auto user = is_root() ? std::optional(SystemUser::find("nobody")) : std::nullopt;
  make_work_folder(folder, user);
  EXPECT_TRUE(fs::is_directory(folder / "work/tmp"));
  const uid_t owner = user ? user->user : ::geteuid();
  EXPECT_EQ(owner_of(folder / "work"), owner);
  EXPECT_EQ(owner_of(folder / "work/tmp"), owner);
  EXPECT_EQ(owner_of(folder), ::geteuid());
}

TEST(JobFolder, IsNotTheOneOfAnotherJob) {
  const test::Folder place;
  const fs::path folder = make_job_folder(place / "job");
  make_work_folder(folder, std::nullopt);
  EXPECT_THROW(make_work_folder(folder, std::nullopt), UsageError);
}

TEST(JobFolder, HasAWorkingFolderThatIsNoLink) {
  const test::Folder place;
  const test::Folder elsewhere;
  const fs::path folder = make_job_folder(place / "job");
  fs::create_directory_symlink(elsewhere.path(), folder / "work");
  EXPECT_THROW(make_work_folder(folder, std::nullopt), UsageError);
  EXPECT_TRUE(fs::is_empty(elsewhere.path()));
}

TEST(JobFolder, OfRootIsNotMadeWhereALinkLeads) {
  if (!is_root()) GTEST_SKIP() << "only root must not follow links";
  const test::Folder place;
  const test::Folder elsewhere;
  fs::create_directory_symlink(elsewhere.path(), place / "link");
  EXPECT_THROW((void)make_job_folder(place / "link"), UsageError);
  EXPECT_THROW((void)make_job_folder(place / "link/job"), UsageError);
  fs::create_symlink(elsewhere / "absent", place / "dangling");
  EXPECT_THROW((void)make_job_folder(place / "dangling/job"), UsageError);
  EXPECT_TRUE(fs::is_empty(elsewhere.path()));
}

TEST(JobFolder, OfRootIsNotMadeWhereOthersMayExchangeIt) {
  if (!is_root()) GTEST_SKIP() << "only root makes folders for others";
  const test::Folder place;
  const fs::path open = place / "open";
  fs::create_directory(open);
  const auto is_refused = [&] {
    try {
      (void)make_job_folder(open / "job");
      return false;
    } catch (const UsageError&) {
      return true;
    }
  };
  fs::permissions(open, fs::perms(0777));
  EXPECT_TRUE(is_refused());
  fs::permissions(open, fs::perms(0775));
  EXPECT_TRUE(is_refused());
  EXPECT_FALSE(fs::exists(open / "job"));
  // As in /tmp, nobody can exchange what belongs to others.
  fs::permissions(open, fs::perms(01777));
  EXPECT_FALSE(is_refused());
  // But whoever was there first has it.
  ASSERT_EQ(::chown((open / "job").c_str(), 65534, 65534), 0);
  EXPECT_TRUE(is_refused());
  ASSERT_EQ(::chown(open.c_str(), 65534, 65534), 0);
  fs::permissions(open, fs::perms(0755));
  EXPECT_TRUE(is_refused());
}

}  // namespace
}  // namespace trifinger::apps
