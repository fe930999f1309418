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

TEST(Errors, CanAllBeCaughtAsOne) {
  EXPECT_THROW(throw InvalidArgument("x"), Error);
  EXPECT_THROW(throw TimedOut("x"), Error);
  EXPECT_THROW(throw SystemError("x", EPERM), Error);
}

}  // namespace
}  // namespace trifinger
