// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/base/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <string>

namespace trifinger {
namespace {

TEST(SystemError, SaysWhatWasTriedAndWhatTheSystemAnswered) {
  const SystemError error("open /nowhere", ENOENT);
  EXPECT_EQ(std::string(error.what()), "open /nowhere: No such file or directory");
  EXPECT_EQ(error.error_number(), ENOENT);
}

TEST(SystemError, fault_75_NamesTheLimitThatWasReached) {
  EXPECT_EQ(std::string(SystemError("open a", EMFILE).what()),
            "open a: Too many open files; 'ulimit -n' shows how many this process may open, and "
            "raises it");
  EXPECT_EQ(std::string(SystemError("write a", EFBIG).what()),
            "write a: File too large; 'ulimit -f' shows how large a file may be, and raises it");
}

TEST(Errors, CanAllBeCaughtAsOne) {
  EXPECT_THROW(throw InvalidArgument("x"), Error);
  EXPECT_THROW(throw TimedOut("x"), Error);
  EXPECT_THROW(throw SystemError("x", EPERM), Error);
}

}  // namespace
}  // namespace trifinger
