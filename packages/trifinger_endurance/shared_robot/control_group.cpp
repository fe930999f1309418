// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/control_group.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <linux/magic.h>
#include <sys/stat.h>
#include <sys/vfs.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::apps {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kOfJob = "trifinger_job_";
constexpr std::string_view kOfSupervisor = "trifinger_turn_";

// errno says why it failed.
bool write(const fs::path& path, std::string_view text) {
  const ipc::FileDescriptor file([&path] { return ::open(path.c_str(), O_WRONLY | O_CLOEXEC); });
  return file && ::write(file.get(), text.data(), text.size()) == static_cast<ssize_t>(text.size());
}

// Returns the numbers after `keys` in a file with lines such as "anon 4096"; 0 if there is none.
template <std::size_t kCount>
std::array<std::uint64_t, kCount> numbers_in(const fs::path& path,
                                             const std::array<std::string_view, kCount>& keys) {
  std::array<std::uint64_t, kCount> numbers{};
  std::ifstream file(path);
  std::string word;
  for (std::uint64_t number = 0; file >> word >> number;) {
    const auto* const key = std::ranges::find(keys, word);
    if (key != keys.end()) numbers.at(static_cast<std::size_t>(key - keys.begin())) = number;
  }
  return numbers;
}

bool has_word(const fs::path& path, std::string_view wanted) {
  std::ifstream file(path);
  for (std::string word; file >> word;) {
    if (word == wanted) return true;
  }
  return false;
}

// Returns the group of this process; empty where there are no groups of version 2.
fs::path own_group() {
  const fs::path root = "/sys/fs/cgroup";
  struct statfs system{};
  if (::statfs(root.c_str(), &system) != 0 || system.f_type != CGROUP2_SUPER_MAGIC) return {};
  std::ifstream groups("/proc/self/cgroup");
  constexpr std::string_view kBeforePath = "0::/";
  for (std::string line; std::getline(groups, line);) {
    if (line.starts_with(kBeforePath)) return root / line.substr(kBeforePath.size());
  }
  return {};
}

// Removes groups that supervisors have left which were killed. Numbers of processes return, so one
// of them may have had that of this process.
void remove_left(const fs::path& above) {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(above, ignored)) {
    const std::string name = entry.path().filename().string();
    for (const std::string_view prefix : {kOfJob, kOfSupervisor}) {
      if (!name.starts_with(prefix)) continue;
      const std::string owner = name.substr(prefix.size());
      if (owner == std::to_string(::getpid()) || !fs::exists("/proc/" + owner, ignored)) {
        ::rmdir(entry.path().c_str());
      }
    }
  }
}

bool has_job(const fs::path& above) {
  std::error_code ignored;
  return std::ranges::any_of(fs::directory_iterator(above, ignored), [](const auto& entry) {
    return entry.path().filename().string().starts_with(kOfJob);
  });
}

}  // namespace

std::unique_ptr<ControlGroup> ControlGroup::make(std::uint64_t memory) {
  const fs::path above = own_group();
  if (above.empty() || !has_word(above / "cgroup.controllers", "memory")) return nullptr;
  remove_left(above);
  std::unique_ptr<ControlGroup> group(new ControlGroup);
  const fs::path job = above / fmt::format("{}{}", kOfJob, ::getpid());
  if (::mkdir(job.c_str(), 0755) != 0) return nullptr;
  group->above_ = above;
  group->job_ = job;
  if (!group->let_limit() || !write(job / "memory.max", std::to_string(memory)) ||
      !write(job / "memory.oom.group", "1")) {
    return nullptr;
  }
  // The kernel may have been built without it.
  write(job / "memory.swap.max", "0");
  group->entry_ = ::open((job / "cgroup.procs").c_str(), O_WRONLY | O_CLOEXEC);
  return group->entry_ >= 0 ? std::move(group) : nullptr;
}

bool ControlGroup::let_limit() {
  const fs::path control = above_ / "cgroup.subtree_control";
  if (has_word(control, "memory")) return true;
  has_enabled_ = write(control, "+memory");
  if (has_enabled_) return true;
  const fs::path supervisor = above_ / fmt::format("{}{}", kOfSupervisor, ::getpid());
  if (errno != EBUSY || ::mkdir(supervisor.c_str(), 0755) != 0) return false;
  supervisor_ = supervisor;
  has_enabled_ = write(supervisor / "cgroup.procs", "0") && write(control, "+memory");
  return has_enabled_;
}

ControlGroup::~ControlGroup() {
  if (job_.empty()) return;
  if (entry_ >= 0) ::close(entry_);
  write(job_ / "cgroup.kill", "1");
  // Those that were killed need a moment.
  for (int tries = 0; ::rmdir(job_.c_str()) != 0 && errno == EBUSY && tries < 500; ++tries) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  // In the root group another supervisor may have begun meanwhile, whose job would lose its limit.
  if (has_enabled_ && (!supervisor_.empty() || !has_job(above_))) {
    write(above_ / "cgroup.subtree_control", "-memory");
  }
  if (supervisor_.empty()) return;
  write(above_ / "cgroup.procs", "0");
  ::rmdir(supervisor_.c_str());
}

bool ControlGroup::enter() const noexcept { return ::write(entry_, "0", 1) == 1; }

std::uint64_t ControlGroup::memory() const {
  std::uint64_t current = 0;
  std::ifstream(job_ / "memory.current") >> current;
  const auto [file, shmem, reclaimable] =
      numbers_in<3>(job_ / "memory.stat", {"file", "shmem", "slab_reclaimable"});
  // `memory.current` was read at another moment.
  const auto without = [](std::uint64_t all, std::uint64_t part) {
    return all - std::min(all, part);
  };
  // Files in shared memory count as files as well, but nothing can be given back of them.
  return without(current, without(file, shmem) + reclaimable);
}

bool ControlGroup::was_too_large() const {
  // Kills alone may be for want of memory in the machine: "oom" counts those at this limit.
  const auto [kills, at_limit] = numbers_in<2>(job_ / "memory.events", {"oom_kill", "oom"});
  return kills > 0 && at_limit > 0;
}

}  // namespace trifinger::apps
