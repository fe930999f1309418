// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

namespace trifinger {

/// Number of processors that the calling thread was given, at least 1: those of its affinity
/// (taskset, cpusets of containers and of batch systems), but no more than the quota of its control
/// groups, rounded up (`docker run --cpus`, `CPUQuota=` of systemd).
[[nodiscard]] int num_processors();

namespace detail {

/// The quota of the control groups of this process, in processors and rounded up; 0 without one.
/// `root` is where the files /proc/self/cgroup and /sys/fs/cgroup are.
[[nodiscard]] int processor_quota(const std::filesystem::path& root);

}  // namespace detail
}  // namespace trifinger
