// SPDX-License-Identifier: BSD-3-Clause
#include "realtime/processors.hpp"

#include <gtest/gtest.h>
#include <sched.h>

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string>

#include "support/child_process.hpp"
#include "support/folder.hpp"

namespace trifinger {
namespace {

using detail::processor_quota;

class ControlGroups : public ::testing::Test {
 protected:
  void write(const std::filesystem::path& path, const std::string& text) {
    std::filesystem::create_directories((root_ / path).parent_path());
    std::ofstream(root_ / path) << text;
  }
  [[nodiscard]] int quota() const { return processor_quota(root_.path()); }

 private:
  test::Folder root_;
};

using Processors = ControlGroups;

TEST_F(Processors, OfAThreadAreThoseOfItsAffinity) {
  test::ChildProcess child([] {
    cpu_set_t before;
    CPU_ZERO(&before);
    if (::sched_getaffinity(0, sizeof(before), &before) != 0) return 2;
    std::size_t first = 0;
    while (!CPU_ISSET(first, &before)) ++first;
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(first, &one);
    if (::sched_setaffinity(0, sizeof(one), &one) != 0) return 3;
    return num_processors() == 1 ? 0 : 4;
  });
  EXPECT_EQ(child.wait(), 0);
}

TEST_F(Processors, HaveNoQuotaWithoutControlGroups) {
  EXPECT_EQ(quota(), 0);
  write("proc/self/cgroup", "garbage\n::\n0:\n");
  EXPECT_EQ(quota(), 0);
  write("proc/self/cgroup", "0::/group\n");
  EXPECT_EQ(quota(), 0);
  write("sys/fs/cgroup/group/cpu.max", "max 100000\n");
  EXPECT_EQ(quota(), 0);
  write("sys/fs/cgroup/group/cpu.max", "garbage\n");
  EXPECT_EQ(quota(), 0);
}

TEST_F(Processors, AreAsManyAsTheQuotaSays) {
  write("proc/self/cgroup", "0::/group\n");
  write("sys/fs/cgroup/group/cpu.max", "400000 100000\n");
  EXPECT_EQ(quota(), 4);
  write("sys/fs/cgroup/group/cpu.max", "150000 100000\n");
  EXPECT_EQ(quota(), 2);
  write("sys/fs/cgroup/group/cpu.max", "1000 100000\n");
  EXPECT_EQ(quota(), 1);
}

TEST_F(Processors, AreLimitedByEveryGroupAbove) {
  write("proc/self/cgroup", "0::/slice/unit/group\n");
  write("sys/fs/cgroup/slice/unit/group/cpu.max", "800000 100000\n");
  write("sys/fs/cgroup/slice/cpu.max", "300000 100000\n");
  EXPECT_EQ(quota(), 3);
  // A container whose own group is the top of what it sees.
  write("sys/fs/cgroup/cpu.max", "200000 100000\n");
  EXPECT_EQ(quota(), 2);
}

TEST_F(Processors, HaveAQuotaInVersionOneOfControlGroups) {
  write("proc/self/cgroup", "5:memory:/docker/1\n4:cpu,cpuacct:/docker/1\n0::/\n");
  write("sys/fs/cgroup/cpu/docker/1/cpu.cfs_period_us", "100000\n");
  write("sys/fs/cgroup/cpu/docker/1/cpu.cfs_quota_us", "-1\n");
  EXPECT_EQ(quota(), 0);
  write("sys/fs/cgroup/cpu/docker/1/cpu.cfs_quota_us", "250000\n");
  EXPECT_EQ(quota(), 3);
}

}  // namespace
}  // namespace trifinger
