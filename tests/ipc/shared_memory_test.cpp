// SPDX-License-Identifier: BSD-3-Clause
#include "ipc/shared_memory.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "ipc/file_lock.hpp"
#include "support/child_process.hpp"
#include "support/interruptions.hpp"
#include "support/sanitizers.hpp"
#include "support/session_folder.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::ipc {
namespace {

constexpr std::size_t kPage = 4096;
constexpr std::size_t kSize = 4 * kPage;

class SharedMemoryFile : public ::testing::Test {
 protected:
  [[nodiscard]] SharedMemory create(const std::string& name = "memory",
                                    unsigned mode = 0600) const {
    return SharedMemory::create_file(folder_.path(), name, kSize, mode);
  }
  [[nodiscard]] std::size_t files() const {
    return static_cast<std::size_t>(
        std::distance(std::filesystem::directory_iterator(folder_.path()), {}));
  }

  test::SessionFolder folder_;
  std::filesystem::path path_{folder_.path() / "memory"};
};

int error_of(const auto& call) {
  try {
    static_cast<void>(call());
  } catch (const SystemError& error) {
    return error.error_number();
  }
  return 0;
}

TEST(AnonymousMemory, BeginsWithZeros) {
  const SharedMemory memory = SharedMemory::create_anonymous(kSize);
  EXPECT_EQ(memory.size(), kSize);
  EXPECT_TRUE(std::all_of(memory.data(), memory.data() + kSize,
                          [](std::byte b) { return b == std::byte{0}; }));
}

// The kernel can interrupt allocating memory from it, too, because that takes a while.
TEST(AnonymousMemory, fault_23_IsThereHoweverOftenASignalInterruptsWhoMakesIt) {
  constexpr std::size_t kLarge = std::size_t{64} << 20U;
  const std::int64_t enough = test::Interruptions::count() + (test::kHasSanitizer ? 200 : 1000);
  test::Interruptions interruptions;
  interruptions.begin();
  while (test::Interruptions::count() < enough) {
    ASSERT_EQ(SharedMemory::create_anonymous(kLarge).size(), kLarge);
  }
}

TEST(AnonymousMemory, IsSeenByEveryMapping) {
  SharedMemory memory = SharedMemory::create_anonymous(kSize);
  const SharedMemory other = memory.reopen(Access::kReadOnly);
  EXPECT_NE(other.data(), memory.data());
  memory.data()[kSize - 1] = std::byte{42};
  EXPECT_EQ(other.data()[kSize - 1], std::byte{42});
}

TEST(AnonymousMemory, HasALockPerMapping) {
  const SharedMemory memory = SharedMemory::create_anonymous(kSize);
  const SharedMemory other = memory.reopen(Access::kReadWrite);
  ASSERT_TRUE(try_lock(memory.file()));
  EXPECT_FALSE(try_lock(other.file()));
}

TEST_F(SharedMemoryFile, CannotBeFoundBeforeItIsPublished) {
  SharedMemory memory = create();
  memory.data()[0] = std::byte{1};
  EXPECT_EQ(error_of([&] { return SharedMemory::open(path_, Access::kReadOnly); }), ENOENT);
  memory.publish();
  EXPECT_EQ(SharedMemory::open(path_, Access::kReadOnly).data()[0], std::byte{1});
}

TEST_F(SharedMemoryFile, LeavesNothingBehindIfItIsNeverPublished) {
  {
    const SharedMemory memory = create();
  }
  EXPECT_EQ(files(), 0U);
}

TEST_F(SharedMemoryFile, TakesThePlaceOfAnOlderFileWhoseReadersKeepTheirs) {
  SharedMemory older = create();
  older.data()[0] = std::byte{1};
  older.publish();
  const SharedMemory reader = SharedMemory::open(path_, Access::kReadOnly);
  SharedMemory newer = create();
  newer.data()[0] = std::byte{2};
  newer.publish();
  EXPECT_EQ(reader.data()[0], std::byte{1});
  EXPECT_EQ(SharedMemory::open(path_, Access::kReadOnly).data()[0], std::byte{2});
  EXPECT_EQ(files(), 3U) << "this name, and a hidden one of each";
}

TEST_F(SharedMemoryFile, IsAlwaysThereWhileItIsReplaced) {
  SharedMemory first = create();
  first.publish();
  // The file is replaced again and again. Whoever opens it finds a whole one.
  test::ChildProcess writer([&] {
    while (true) {
      SharedMemory memory = create();
      std::fill(memory.data(), memory.data() + kSize, std::byte{7});
      memory.publish();
    }
    return 0;
  });
  for (int i = 0; i < 2000; ++i) {
    const SharedMemory memory = SharedMemory::open(path_, Access::kReadOnly);
    ASSERT_EQ(memory.size(), kSize);
    ASSERT_EQ(memory.data()[0], memory.data()[kSize - 1]);
  }
}

TEST_F(SharedMemoryFile, fault_33_IsMadeAnewInTheSameMemory) {
  SharedMemory older = create();
  older.publish();
  std::fill(older.data(), older.data() + kSize, std::byte{7});
  SharedMemory newer = create();
  newer.publish();
  {
    const SharedMemory reader = SharedMemory::open(path_, Access::kReadOnly);
    newer.retire();
    EXPECT_FALSE(newer.make_anew("memory", 0600)) << "somebody reads it";
  }
  older.retire();
  ASSERT_TRUE(older.make_anew("another", 0640));
  EXPECT_TRUE(std::all_of(older.data(), older.data() + kSize,
                          [](std::byte b) { return b == std::byte{0}; }));
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "another"));
  older.data()[0] = std::byte{9};
  older.publish();
  const SharedMemory reader = SharedMemory::open(folder_.path() / "another", Access::kReadOnly);
  EXPECT_EQ(reader.data()[0], std::byte{9});
  EXPECT_TRUE(older.has_name());
}

TEST_F(SharedMemoryFile, fault_32_IsNotMadeAnewOfWhatSomebodyHasDamaged) {
  SharedMemory cut = create("cut");
  cut.publish();
  std::filesystem::resize_file(folder_.path() / "cut", 1);
  cut.retire();
  EXPECT_FALSE(cut.make_anew("cut", 0600));

  SharedMemory removed = create("removed");
  removed.publish();
  std::filesystem::remove_all(folder_.path());
  removed.retire();
  EXPECT_FALSE(removed.make_anew("removed", 0600));
}

TEST_F(SharedMemoryFile, fault_73_IsMadeUnderANameThatNobodyCanGuess) {
  const SharedMemory first = create();
  const SharedMemory second = create();
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
    names.insert(entry.path().filename().string());
  }
  EXPECT_EQ(names.size(), 2U);
  for (const std::string& name : names) EXPECT_EQ(name.rfind(".memory.", 0), 0U) << name;
}

TEST_F(SharedMemoryFile, fault_64_KeepsItsHiddenNameIfAForkedChildEnds) {
  SharedMemory memory = create();
  memory.publish();
  test::ChildProcess child([&] {
    const SharedMemory inherited = std::move(memory);
    return 0;
  });
  EXPECT_EQ(child.wait(), 0);
  memory.retire();
  EXPECT_TRUE(memory.make_anew("memory", 0600));
}

TEST_F(SharedMemoryFile, IsPublishedOnceIfAbsent) {
  SharedMemory first = create();
  SharedMemory second = create();
  EXPECT_TRUE(first.publish_if_absent());
  second.data()[0] = std::byte{2};
  EXPECT_FALSE(second.publish_if_absent());
  EXPECT_EQ(SharedMemory::open(path_, Access::kReadOnly).data()[0], std::byte{0});
}

TEST_F(SharedMemoryFile, HasTheModeAskedForWhateverTheUmask) {
  const mode_t umask = ::umask(0777);
  create("memory", 0640).publish();
  ::umask(umask);
  struct stat status{};
  ASSERT_EQ(::stat(path_.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0640U);
}

TEST_F(SharedMemoryFile, SaysWhyItCannotBeOpened) {
  EXPECT_EQ(error_of([&] { return SharedMemory::open(path_, Access::kReadOnly); }), ENOENT);
  std::filesystem::create_symlink("/dev/zero", path_);
  EXPECT_EQ(error_of([&] { return SharedMemory::open(path_, Access::kReadOnly); }), ELOOP)
      << "a link may lead anywhere";
}

TEST_F(SharedMemoryFile, RefusesAFileOfAnotherUser) {
  if (::geteuid() != 0) GTEST_SKIP() << "only the administrator can give files away";
  create().publish();
  constexpr uid_t kOtherUser = 54321;
  ASSERT_EQ(::chown(path_.c_str(), kOtherUser, kOtherUser), 0);
  EXPECT_THROW(static_cast<void>(SharedMemory::open(path_, Access::kReadOnly)), Error);

  // A file shared with our group is no other user's.
  ASSERT_EQ(::chown(path_.c_str(), kOtherUser, ::getegid()), 0);
  ASSERT_EQ(::chmod(path_.c_str(), 0660), 0);
  EXPECT_EQ(SharedMemory::open(path_, Access::kReadOnly).size(), kSize);
}

TEST_F(SharedMemoryFile, HasNothingOfAnEmptyFile) {
  create().publish();
  ASSERT_EQ(::truncate(path_.c_str(), 0), 0);
  const SharedMemory memory = SharedMemory::open(path_, Access::kReadOnly);
  EXPECT_EQ(memory.size(), 0U);
  EXPECT_FALSE(memory.is_damaged());
}

TEST_F(SharedMemoryFile, KnowsWhetherItCanStillBeFound) {
  SharedMemory older = create();
  older.publish();
  EXPECT_TRUE(older.has_name());
  SharedMemory newer = create();
  newer.publish();
  EXPECT_FALSE(older.has_name()) << "it was replaced";
  ASSERT_EQ(::unlink(path_.c_str()), 0);
  EXPECT_FALSE(newer.has_name()) << "it was removed";
}

TEST_F(SharedMemoryFile, ReadsAsZerosWhereItWasCutOff) {
  SharedMemory memory = create();
  std::fill(memory.data(), memory.data() + kSize, std::byte{7});
  memory.publish();
  const SharedMemory other = create("other");
  EXPECT_FALSE(memory.is_damaged());

  ASSERT_EQ(::truncate(path_.c_str(), kPage), 0);
  EXPECT_EQ(memory.data()[kPage - 1], std::byte{7});
  EXPECT_FALSE(memory.is_damaged()) << "nobody has missed anything yet";
  EXPECT_EQ(memory.data()[2 * kPage], std::byte{0});
  EXPECT_TRUE(memory.is_damaged());
  EXPECT_FALSE(other.is_damaged());
  // Writing has no effect but does not fail.
  memory.data()[kSize - 1] = std::byte{1};
  memory.data()[kPage] = std::byte{1};
}

TEST_F(SharedMemoryFile, StaysGuardedWhenItMoves) {
  SharedMemory memory = create();
  memory.publish();
  const SharedMemory moved = std::move(memory);
  ASSERT_EQ(::truncate(path_.c_str(), 0), 0);
  EXPECT_EQ(moved.data()[0], std::byte{0});
  EXPECT_TRUE(moved.is_damaged());
}

TEST_F(SharedMemoryFile, GivesGuardsBack) {
  create().publish();
  // More than one block of guards can hold.
  for (int i = 0; i < 10'000; ++i) {
    static_cast<void>(SharedMemory::open(path_, Access::kReadOnly));
  }
}

// Who owns the public name cannot know whether the process that made a hidden one still lives.
TEST_F(SharedMemoryFile, fault_80_WhoseHiddenNameWasRemovedIsNotPublished) {
  SharedMemory memory = create();
  for (const auto& entry : std::filesystem::directory_iterator(path_.parent_path())) {
    std::filesystem::remove(entry.path());
  }
  EXPECT_FALSE(memory.publish_if_absent());
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(SharedMemoryFile, fault_75_IsGuardedHoweverManyThereAre) {
  constexpr std::size_t kCount = 5000;
  rlimit limit{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &limit), 0);
  if (limit.rlim_max < kCount + 100) GTEST_SKIP() << "not so many files may be open";
  limit.rlim_cur = limit.rlim_max;
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &limit), 0);
  create().publish();
  std::vector<SharedMemory> memories;
  memories.reserve(kCount);
  for (std::size_t i = 0; i < kCount; ++i) {
    memories.push_back(SharedMemory::open(path_, Access::kReadOnly));
  }
  ASSERT_EQ(::truncate(path_.c_str(), 0), 0);
  for (const SharedMemory& memory : memories) {
    ASSERT_EQ(memory.data()[0], std::byte{0});
    ASSERT_TRUE(memory.is_damaged());
  }
}

TEST(BusError, StillEndsAProcessThatTouchesSomebodyElsesMemory) {
  const test::SessionFolder folder;
  test::ChildProcess child([&] {
    const SharedMemory guarded = SharedMemory::create_anonymous(kPage);
    // A sanitizer would print a long report about what is expected here.
    ::close(STDERR_FILENO);
    ::raise(SIGBUS);
    // The handler lets the next signal through.
    ::raise(SIGBUS);
    return 0;
  });
  EXPECT_NE(child.wait(), 0);
}

}  // namespace
}  // namespace trifinger::ipc
