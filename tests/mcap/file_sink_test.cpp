// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cerrno>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "mcap/files.hpp"
#include "support/child_process.hpp"
#include "support/session_folder.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/mcap/sink.hpp"

namespace trifinger::mcap::test {
namespace {

std::string text_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator(file), {}};
}

class FileSinkTest : public testing::Test {
 protected:
  // Any folder of its own will do.
  trifinger::test::SessionFolder folder_;
  std::filesystem::path path_{folder_.path() / "file.mcap"};
};

TEST_F(FileSinkTest, AppendsToANewFile) {
  FileSink sink = FileSink::create(path_);
  sink.append(bytes_of("one "));
  sink.append(bytes_of("two"));
  sink.sync();
  EXPECT_EQ(sink.size(), 7U);
  EXPECT_EQ(text_of(path_), "one two");
}

TEST_F(FileSinkTest, NeverReplacesAFile) {
  std::ofstream(path_) << "precious";
  try {
    static_cast<void>(FileSink::create(path_));
    FAIL();
  } catch (const SystemError& error) {
    EXPECT_EQ(error.error_number(), EEXIST);
    EXPECT_THAT(error.what(), testing::HasSubstr(path_.string()));
  }
  EXPECT_EQ(text_of(path_), "precious");
}

TEST_F(FileSinkTest, GoesOnAtAGivenPlace) {
  std::ofstream(path_) << "whole torn";
  FileSink sink = FileSink::resume(path_, 6);
  sink.append(bytes_of("again"));
  EXPECT_EQ(text_of(path_), "whole again");
}

TEST_F(FileSinkTest, RefusesToGoOnAfterTheEnd) {
  std::ofstream(path_) << "short";
  EXPECT_THROW(static_cast<void>(FileSink::resume(path_, 6)), InvalidArgument);
  EXPECT_EQ(text_of(path_), "short");
}

TEST_F(FileSinkTest, DoesNotMakeAFileToGoOnWith) {
  EXPECT_THROW(static_cast<void>(FileSink::resume(path_, 0)), SystemError);
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(FileSinkTest, LetsNobodyElseWriteMeanwhile) {
  {
    const FileSink sink = FileSink::create(path_);
    EXPECT_THROW(static_cast<void>(FileSink::resume(path_, 0)), InvalidArgument);
  }
  EXPECT_NO_THROW(static_cast<void>(FileSink::resume(path_, 0)));
}

// The limit on the size of a file causes both a short write and a refusal.
TEST_F(FileSinkTest, fault_22_LeavesTheSizeAsItWasWhenTheFileCannotGrow) {
  trifinger::test::ChildProcess child([this] {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit before{.rlim_cur = 10, .rlim_max = RLIM_INFINITY};
    if (::setrlimit(RLIMIT_FSIZE, &before) != 0) return 2;
    FileSink sink = FileSink::create(path_);
    sink.append(bytes_of("12345678"));
    for (int i = 0; i < 3; ++i) {
      try {
        sink.append(bytes_of("abcd"));
        return 3;
      } catch (const SystemError& error) {
        if (error.error_number() != EFBIG) return 4;
      }
      if (sink.size() != 8 || std::filesystem::file_size(path_) != 8) return 5;
    }
    const rlimit after{.rlim_cur = RLIM_INFINITY, .rlim_max = RLIM_INFINITY};
    if (::setrlimit(RLIMIT_FSIZE, &after) != 0) return 6;
    sink.append(bytes_of("abcd"));
    return 0;
  });
  EXPECT_EQ(child.wait(), 0);
  EXPECT_EQ(text_of(path_), "12345678abcd");
}

TEST_F(FileSinkTest, NamesTheFileThatCannotBeMade) {
  const auto path = folder_.path() / "no_folder" / "file.mcap";
  try {
    static_cast<void>(FileSink::create(path));
    FAIL();
  } catch (const SystemError& error) {
    EXPECT_EQ(error.error_number(), ENOENT);
    EXPECT_THAT(error.what(), testing::HasSubstr(path.string()));
  }
}

}  // namespace
}  // namespace trifinger::mcap::test
