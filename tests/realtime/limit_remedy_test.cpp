// SPDX-License-Identifier: BSD-3-Clause
#include "realtime/limit_remedy.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "support/folder.hpp"

namespace trifinger {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class LimitRemedy : public ::testing::Test {
 protected:
  void put(const std::string& file, const std::string& text = "") const {
    const std::filesystem::path path = folder_.path() / file;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path) << text << '\n';
  }
  [[nodiscard]] std::string priority() const {
    return remedy_for(RealtimeLimit::kPriority, folder_.path());
  }
  [[nodiscard]] std::string memory() const {
    return remedy_for(RealtimeLimit::kLockedMemory, folder_.path());
  }

  test::Folder folder_;
};

TEST_F(LimitRemedy, fault_58_IsAFileOfTheMachineForAUserOfIt) {
  put("proc/self/cgroup", "0::/user.slice/user-1000.slice/user@1000.service/app.slice/a.service");
  EXPECT_THAT(priority(), HasSubstr("'@realtime - rtprio 99' to /etc/security/limits.conf"));
  EXPECT_THAT(memory(), HasSubstr("'@realtime - memlock unlimited' to /etc/security/limits.conf"));
}

TEST_F(LimitRemedy, fault_58_IsAnOptionOfDockerAndOfPodman) {
  for (const char* const mark : {".dockerenv", "run/.containerenv"}) {
    put(mark);
    EXPECT_THAT(priority(), HasSubstr("'--ulimit rtprio=99' or '--cap-add=SYS_NICE'")) << mark;
    EXPECT_THAT(memory(), HasSubstr("'--ulimit memlock=-1' or '--cap-add=IPC_LOCK'")) << mark;
    EXPECT_THAT(priority() + memory(), Not(HasSubstr("limits.conf"))) << mark;
    std::filesystem::remove(folder_.path() / mark);
  }
}

TEST_F(LimitRemedy, fault_58_IsALineInTheUnitOfAService) {
  put("proc/self/cgroup", "0::/system.slice/system-trifinger.slice/trifinger@sim.service");
  EXPECT_THAT(priority(), HasSubstr("'LimitRTPRIO=99'"));
  EXPECT_THAT(memory(), HasSubstr("'LimitMEMLOCK=infinity'"));
}

}  // namespace
}  // namespace trifinger
