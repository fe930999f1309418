// SPDX-License-Identifier: BSD-3-Clause
#include "core/job_claim.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <optional>

#include "support/child_process.hpp"
#include "support/session_folder.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/backend.hpp"
#include "trifinger/core/session.hpp"

namespace trifinger {
namespace {

TEST(JobClaim, IsNothingForARobotThatDoesNotRun) {
  const test::SessionFolder folder;
  EXPECT_FALSE(JobClaim::take("robot"));
  EXPECT_THROW((void)JobClaim::take("../robot"), InvalidArgument);
}

TEST(JobClaim, IsHeldByOneAtATimeAndDoesNotHinderTheRobot) {
  const test::SessionFolder folder;
  std::optional<SessionHost> host(SessionHost::named("robot"));
  std::optional<JobClaim> claim = JobClaim::take("robot");
  ASSERT_TRUE(claim);
  EXPECT_THROW((void)JobClaim::take("robot"), Error);
  // The back-end begins again meanwhile.
  host.reset();
  EXPECT_THROW((void)JobClaim::take("robot"), Error);
  host.emplace(SessionHost::named("robot"));
  EXPECT_THROW((void)JobClaim::take("robot"), Error);
  claim.reset();
  EXPECT_TRUE(JobClaim::take("robot"));
}

TEST(JobClaim, IsForThoseOnlyWhoMayDriveTheRobot) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can become another user";
  const test::SessionFolder folder;
  ASSERT_EQ(::chmod(folder.path().c_str(), 0777), 0);
  const SessionHost host = SessionHost::named("robot");
  test::ChildProcess other([] {
    constexpr uid_t kNobody = 65534;
    if (::setegid(kNobody) != 0 || ::seteuid(kNobody) != 0) return 2;
    try {
      (void)JobClaim::take("robot");
    } catch (const SystemError& error) {
      return error.error_number() == EACCES ? 0 : 3;
    }
    return 4;
  });
  EXPECT_EQ(other.wait(), 0);
  EXPECT_TRUE(JobClaim::take("robot"));
}

}  // namespace
}  // namespace trifinger
