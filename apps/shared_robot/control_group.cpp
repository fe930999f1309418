// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/control_group.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <linux/magic.h>
#include <sys/stat.h>
#include <sys/vfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
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
constexpr std::string_view kOfTurn = "trifinger_turn_";

// errno says why it failed.
bool write(const fs::path& path, std::string_view text) {
  const ipc::FileDescriptor file([&path] { return ::open(path.c_str(), O_WRONLY | O_CLOEXEC); });
  return file && ::write(file.get(), text.data(), text.size()) == static_cast<ssize_t>(text.size());
}

// Returns the number after `key` in a file with lines such as "anon 4096"; 0 if there is none.
std::uint64_t number_in(const fs::path& path, std::string_view key) {
  std::ifstream file(path);
  std::string word;
  for (std::uint64_t number = 0; file >> word >> number;) {
    if (word == key) return number;
  }
  return 0;
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

// Removes groups that turns have left which were killed. Numbers of processes return, so one of
// them may have had that of this process.
void remove_left(const fs::path& above) {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(above, ignored)) {
    const std::string name = entry.path().filename().string();
    for (const std::string_view prefix : {kOfJob, kOfTurn}) {
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
  const fs::path turn = above_ / fmt::format("{}{}", kOfTurn, ::getpid());
  if (errno != EBUSY || ::mkdir(turn.c_str(), 0755) != 0) return false;
  turn_ = turn;
  has_enabled_ = write(turn / "cgroup.procs", "0") && write(control, "+memory");
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
  // In the root group another turn may have begun meanwhile, whose job would lose its limit.
  if (has_enabled_ && (!turn_.empty() || !has_job(above_))) {
    write(above_ / "cgroup.subtree_control", "-memory");
  }
  if (turn_.empty()) return;
  write(above_ / "cgroup.procs", "0");
  ::rmdir(turn_.c_str());
}

bool ControlGroup::enter() const noexcept { return ::write(entry_, "0", 1) == 1; }

std::uint64_t ControlGroup::memory() const {
  std::uint64_t current = 0;
  std::ifstream(job_ / "memory.current") >> current;
  const fs::path parts = job_ / "memory.stat";
  // Each number is of another moment.
  const auto without = [](std::uint64_t all, std::uint64_t part) {
    return all - std::min(all, part);
  };
  // Files in shared memory count as files as well, but nothing can be given back of them.
  const std::uint64_t files = without(number_in(parts, "file"), number_in(parts, "shmem"));
  return without(current, files + number_in(parts, "slab_reclaimable"));
}

bool ControlGroup::was_too_large() const {
  // Kills alone may be for want of memory in the machine: "oom" counts those at this limit.
  const fs::path events = job_ / "memory.events";
  return number_in(events, "oom_kill") > 0 && number_in(events, "oom") > 0;
}

}  // namespace trifinger::apps
