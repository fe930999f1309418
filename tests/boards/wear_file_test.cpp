// SPDX-License-Identifier: BSD-3-Clause
#include "boards/wear_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>
#include <string>
#include <thread>

#include "boards/wear.hpp"
#include "rig.hpp"
#include "support/child_process.hpp"
#include "support/folder.hpp"
#include "support/nobody.hpp"
#include "support/soak.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::boards::test {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using trifinger::test::ChildProcess;
using trifinger::test::Folder;

using Total = WearElement<3>;
const WearFile::Owner kOwner{.robot = "left", .type = "finger_wear"};

// Files do not keep the stamp.
Total zero() {
  Total total;
  std::memset(static_cast<void*>(&total), 0, sizeof(total));
  return total;
}

// A record whose numbers all tell `number`.
Total total_of(std::uint64_t number) {
  Total total = zero();
  total.starts = total.homings = total.faults = number;
  const double third = static_cast<double>(number) / 3.0;
  for (auto* values :
       {&total.powered_time, &total.revolutions, &total.work, &total.squared_current}) {
    values->fill(third);
  }
  total.index_slips.fill(number);
  return total;
}

std::span<const std::byte> bytes_of(const Total& total) {
  return std::as_bytes(std::span(&total, 1));
}

WearFile open(const fs::path& path, const WearFile::Owner& owner = kOwner) {
  return {path, owner, describe<Total>()};
}

void append(WearFile& file, std::uint64_t number) { file.append(bytes_of(total_of(number))); }

// The number of the newest record, which must be whole; 0 without a record.
std::uint64_t newest(const fs::path& path) {
  const WearFile file = open(path);
  if (file.newest().empty()) return 0;
  Total total;
  EXPECT_EQ(file.newest().size(), sizeof(total));
  std::memcpy(&total, file.newest().data(), sizeof(total));
  const Total expected = total_of(total.starts);
  EXPECT_EQ(std::memcmp(&total, &expected, sizeof(total)), 0);
  return total.starts;
}

std::string text_of(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

void put(const fs::path& path, const std::string& text) {
  fs::remove(path);  // Disks make haste to write a file that is cut off.
  std::ofstream(path, std::ios::trunc) << text;
}

template <class Function>
std::string message_of(const Function& function) {
  try {
    static_cast<void>(function());
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(WearFile, KeepsEveryNumberToTheLastBit) {
  const Folder folder;
  const bool holds = rc::check([&](std::array<std::uint32_t, 15> random) {
    Total total = zero();
    total.starts = random[0] * std::uint64_t{1'000'000};
    total.homings = random[1];
    for (std::size_t i = 0; i < 3; ++i) {
      total.powered_time[i] = random[2 + i] * 1e-3;
      total.revolutions[i] = std::ldexp(random[5 + i], static_cast<int>(random[2] % 60) - 40);
      total.work[i] = random[8 + i] / 3.0;
      total.squared_current[i] = random[11 + i] * 1e-300;
      total.index_slips[i] = random[14];
    }
    const fs::path path = folder / "left.wear";
    {
      WearFile file = open(path);
      file.append(bytes_of(total));
    }
    const WearFile file = open(path);
    RC_ASSERT(file.newest().size() == sizeof(total));
    RC_ASSERT(std::memcmp(file.newest().data(), &total, sizeof(total)) == 0);
  });
  EXPECT_TRUE(holds);
}

TEST(WearFile, IsALineForPeopleWithoutTheStamp) {
  const Folder folder;
  WearFile file = open(folder / "left.wear");
  EXPECT_TRUE(file.newest().empty());
  append(file, 3);
  EXPECT_THAT(text_of(folder / "left.wear"),
              AllOf(HasSubstr(R"("robot":"left","type":"finger_wear","wear":{"starts":3,)"),
                    HasSubstr(R"("powered_time":[1,1,1],"revolutions":[1,1,1])"),
                    HasSubstr(R"("index_slips":[3,3,3]},"crc32":")"), Not(HasSubstr("stamp"))));
}

// A process that appends one record after the other. It writes the number of each to a pipe when
// the record is safe.
TEST(WearFile, fault_70_AKillAtAnyInstantLosesOnlyTheRecordThatWasBeingWritten) {
  const Folder folder;
  const fs::path path = folder / "left.wear";
  std::mt19937 random(70);
  std::uniform_int_distribution<int> microseconds(0, 3000);
  std::uint64_t number = 0;
  const std::int64_t kills = trifinger::test::repetitions(100, 1000);
  for (std::int64_t kill = 0; kill < kills; ++kill) {
    std::array<int, 2> pipe{};
    ASSERT_EQ(::pipe(pipe.data()), 0);
    ChildProcess child([&] {
      WearFile file = open(path);
      for (std::uint64_t next = number + 1;; ++next) {
        append(file, next);
        if (::write(pipe[1], &next, sizeof(next)) != sizeof(next)) return 1;
      }
    });
    ::close(pipe[1]);
    std::uint64_t synced = 0;
    ASSERT_EQ(::read(pipe[0], &synced, sizeof(synced)), sizeof(synced));
    std::this_thread::sleep_for(std::chrono::microseconds(microseconds(random)));
    child.kill();
    while (::read(pipe[0], &synced, sizeof(synced)) == sizeof(synced)) {
    }
    ::close(pipe[0]);
    ASSERT_GT(synced, number);
    number = newest(path);
    ASSERT_GE(number, synced);
    ASSERT_LE(number, synced + 1);
  }
}

TEST(WearFile, fault_70_AnEndOfAnyLengthLeavesTheRecordBefore) {
  const Folder folder;
  const fs::path path = folder / "left.wear";
  {
    WearFile file = open(path);
    append(file, 1);
    append(file, 2);
  }
  const std::string whole = text_of(path);
  const std::size_t first = whole.find('\n') + 1;
  for (std::size_t size = first; size <= whole.size(); ++size) {
    put(path, whole.substr(0, size));
    // The record is whole without its line feed.
    const std::uint64_t expected = size + 1 >= whole.size() ? 2 : 1;
    ASSERT_EQ(newest(path), expected) << size;
    {
      WearFile file = open(path);
      append(file, 7);
    }
    ASSERT_EQ(newest(path), 7U) << size;
  }
}

TEST(WearFile, fault_70_ADamagedRecordIsNotBelieved) {
  const Folder folder;
  const fs::path path = folder / "left.wear";
  {
    WearFile file = open(path);
    append(file, 1);
    append(file, 2);
  }
  const std::string whole = text_of(path);
  for (std::size_t i = whole.find('\n') + 1; i < whole.size(); ++i) {
    std::string damaged = whole;
    damaged[i] = static_cast<char>(static_cast<unsigned char>(damaged[i]) ^ 1U << i % 8);
    put(path, damaged);
    ASSERT_EQ(newest(path), 1U) << "byte " << i;
  }
}

TEST(WearFile, fault_70_AFileWithoutAWholeRecordIsPutAside) {
  const Folder folder;
  const fs::path path = folder / "left.wear";
  for (const std::string& text : {std::string(), std::string("hours: 3\n"),
                                  std::string(200'000, '\0'), std::string(200'000, '\n')}) {
    put(path, text);
    {
      WearFile file = open(path);
      EXPECT_TRUE(file.newest().empty());
      EXPECT_THAT(file.damage(), AllOf(HasSubstr("left.wear had no whole record; it is now"),
                                       HasSubstr("left.wear.damaged")));
      append(file, 1);
    }
    EXPECT_EQ(text_of(folder / "left.wear.damaged"), text);
    EXPECT_EQ(newest(path), 1U);
  }
}

TEST(WearFile, fault_70_DoesNotGrowForEver) {
  const Folder folder;
  const fs::path path = folder / "left.wear";
  {
    WearFile file = open(path);
    append(file, 5);
  }
  const std::string line = text_of(path);
  std::string much;
  while (much.size() < (std::size_t{1} << 20U)) much += line;
  put(path, much);
  put(folder / "left.wear.new", "a kill has left this");
  WearFile file = open(path);
  append(file, 6);
  EXPECT_LE(fs::file_size(path), line.size() + 10);
  EXPECT_FALSE(fs::exists(folder / "left.wear.new"));
  // The new file is locked as the old one was.
  EXPECT_EQ(ChildProcess([&] {
              return message_of([&] { return open(path); }).find(") is writing ") ==
                     std::string::npos;
            }).wait(),
            0);
  append(file, 7);
  file = open(folder / "none");
  EXPECT_EQ(newest(path), 7U);
}

TEST(WearFile, fault_70_AFullDiskCostsNothingOnceThereIsRoom) {
  const Folder folder;
  const fs::path path = folder / "left.wear";
  // In a process of its own, because its files may not grow.
  ChildProcess child([&] {
    std::signal(SIGXFSZ, SIG_IGN);
    WearFile file = open(path);
    append(file, 1);
    const auto line = static_cast<rlim_t>(fs::file_size(path));
    rlimit limit{};
    ::getrlimit(RLIMIT_FSIZE, &limit);
    for (rlim_t room = 0; room < line; ++room) {
      const rlimit full{.rlim_cur = line + room, .rlim_max = limit.rlim_max};
      ::setrlimit(RLIMIT_FSIZE, &full);
      const std::string message = message_of([&] {
        append(file, 2);
        return 0;
      });
      if (message.find("write ") == std::string::npos) return 2;
    }
    ::setrlimit(RLIMIT_FSIZE, &limit);
    append(file, 3);
    return 0;
  });
  ASSERT_EQ(child.wait(), 0);
  EXPECT_EQ(newest(path), 3U);
  // Nothing of what was refused is left.
  const std::string text = text_of(path);
  EXPECT_EQ(std::ranges::count(text, '\n'), 2);
}

TEST(WearFile, fault_70_AFileThatIsRemovedIsMadeAgain) {
  const Folder folder;
  const fs::path path = folder / "left.wear";
  WearFile file = open(path);
  append(file, 1);
  fs::remove(path);
  append(file, 2);
  file = open(folder / "none");
  EXPECT_EQ(newest(path), 2U);
}

TEST(WearFile, fault_70_OfAnotherRobotIsNamedAndLeftAlone) {
  const Folder folder;
  const fs::path path = folder / "left.wear";
  {
    WearFile file = open(path);
    append(file, 4);
  }
  const std::string text = text_of(path);
  EXPECT_THAT(message_of([&] { return open(path, {.robot = "right", .type = "finger_wear"}); }),
              HasSubstr("has the running hours of 'left' (finger_wear) instead of 'right'"));
  EXPECT_THAT(message_of([&] { return WearFile(path, kOwner, Wear::describe(2)); }),
              HasSubstr("wear.powered_time has 3 numbers, must have 2"));
  EXPECT_EQ(text_of(path), text);
}

TEST(WearFile, fault_70_WhatIsNoFileOfOursIsNamedAtOnce) {
  const Folder folder;
  const fs::path fifo = folder / "fifo";
  ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
  EXPECT_THAT(message_of([&] { return open(fifo); }), HasSubstr("which is a FIFO"));
  const fs::path link = folder / "link";
  fs::create_symlink(folder / "elsewhere", link);
  EXPECT_THAT(message_of([&] { return open(link); }), HasSubstr("which is a symbolic link"));
  EXPECT_FALSE(fs::exists(folder / "elsewhere"));
  EXPECT_THAT(message_of([&] { return open(folder.path()); }), HasSubstr("which is a folder"));
  // A link in the place of the new file is removed, not followed.
  const fs::path path = folder / "left.wear";
  put(folder / "precious", "untouched");
  fs::create_symlink(folder / "precious", folder / "left.wear.new");
  WearFile file = open(path);
  append(file, 1);
  EXPECT_EQ(text_of(folder / "precious"), "untouched");
}

TEST(WearFile, fault_70_OfAnotherUserIsRefused) {
  if (::geteuid() != 0 || !trifinger::test::may_become_nobody()) {
    GTEST_SKIP() << "only the administrator can make files of others";
  }
  const Folder folder;
  const fs::path path = folder / "left.wear";
  {
    WearFile file = open(path);
    append(file, 1);
  }
  ASSERT_EQ(::chown(path.c_str(), 12345, 12345), 0);
  ASSERT_EQ(::chmod(path.c_str(), 0666), 0);
  ASSERT_EQ(::chmod(folder.path().c_str(), 0755), 0);
  ChildProcess child([&] {
    trifinger::test::become_nobody();
    const std::string message = message_of([&] { return open(path); });
    return message.find("which is a file of user 12345") == std::string::npos ? 1 : 0;
  });
  EXPECT_EQ(child.wait(), 0);
}

}  // namespace
}  // namespace trifinger::boards::test
