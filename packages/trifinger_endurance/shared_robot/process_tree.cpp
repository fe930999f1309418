// SPDX-License-Identifier: BSD-3-Clause
#include "shared_robot/process_tree.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <filesystem>
#include <set>
#include <string>
#include <system_error>
#include <thread>

#include "trifinger/ipc/file_descriptor.hpp"

namespace trifinger::apps {
namespace {

template <class Number>
Number number_of(std::string_view word) {
  Number number{};
  std::from_chars(word.data(), word.data() + word.size(), number);
  return number;
}

// Returns the sum of the values of `keys` in a text such as "Pss_Anon:   12 kB" [bytes].
std::uint64_t sum_of(const std::string& text, const std::vector<std::string_view>& keys) {
  std::uint64_t sum = 0;
  for (const std::string_view key : keys) {
    const std::size_t at = text.find("\n" + std::string(key) + ":");
    if (at == std::string::npos) continue;
    const std::size_t digits = text.find_first_of("0123456789", at + key.size() + 2);
    if (digits == std::string::npos) continue;
    sum += 1024 * number_of<std::uint64_t>(std::string_view(text).substr(digits));
  }
  return sum;
}

// Whether the thread that this text /proc/PID/stat describes has ended.
bool is_zombie(std::string_view stat) {
  const std::size_t end_of_name = stat.rfind(')');
  return end_of_name != std::string_view::npos && stat.substr(end_of_name).starts_with(") Z");
}

pid_t live_thread_of(pid_t process) {
  pid_t found = process;
  for_each_thread(process, [&found](const std::filesystem::path& thread) {
    const auto number = number_of<pid_t>(thread.filename().string());
    if (!is_zombie(proc_text(number, "stat"))) found = number;
  });
  return found;
}

// What the kernel says at once [bytes].
std::uint64_t quick_memory_of(const ProcessEntry& process) {
  return sum_of(proc_text(process.live_thread, "status"),
                {"RssAnon", "RssShmem", "VmPTE", "VmSwap"});
}

// Takes the ends of all children that have ended.
void reap() noexcept {
  while (::waitpid(-1, nullptr, WNOHANG) > 0) {
  }
}

}  // namespace

std::string proc_text(pid_t pid, const char* name, std::size_t most) {
  const std::string path = fmt::format("/proc/{}/{}", pid, name);
  const ipc::FileDescriptor file([&path] { return ::open(path.c_str(), O_RDONLY | O_CLOEXEC); });
  std::string text;
  std::array<char, 4096> buffer;
  while (text.size() < most) {
    const ssize_t size = file ? ::read(file.get(), buffer.data(), buffer.size()) : 0;
    if (size <= 0) return text;
    text.append(buffer.data(), static_cast<std::size_t>(size));
  }
  return text;
}

// The second field is the program's name in parentheses and may contain any characters, so parsing
// begins after the last parenthesis. State is field 3, parent 4, times 14 to 17, threads 20.
ProcessEntry parse_stat(std::string_view text) {
  ProcessEntry entry;
  const std::size_t end_of_name = text.rfind(')');
  if (end_of_name == std::string_view::npos || end_of_name + 2 >= text.size()) return {};
  std::string_view rest = text.substr(end_of_name + 2);
  entry.pid = number_of<pid_t>(text);
  static const std::int64_t ticks = ::sysconf(_SC_CLK_TCK);
  const auto time_of = [](std::string_view word) {
    return Nanoseconds(std::chrono::seconds(1)) * number_of<std::int64_t>(word) / ticks;
  };
  for (int field = 3; field <= 20; ++field) {
    const std::string_view word = rest.substr(0, rest.find(' '));
    if (field == 3) entry.has_ended = word == "Z" || word == "X";
    if (field == 4) entry.parent = number_of<pid_t>(word);
    if (field == 14 || field == 15) entry.cpu_time += time_of(word);
    if (field == 16 || field == 17) entry.children_cpu_time += time_of(word);
    if (field == 20) entry.threads = number_of<std::uint64_t>(word);
    rest.remove_prefix(std::min(rest.size(), word.size() + 1));
  }
  // The state is that of the first thread. Others may go on without it.
  entry.has_ended = entry.has_ended && entry.threads <= 1;
  entry.live_thread = entry.pid;
  return entry;
}

std::vector<ProcessEntry> all_processes() {
  std::vector<ProcessEntry> all;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator("/proc", ignored)) {
    const std::string name = entry.path().filename().string();
    if (std::isdigit(static_cast<unsigned char>(name.front())) == 0) continue;
    const std::string stat = proc_text(number_of<pid_t>(name), "stat");
    ProcessEntry process = parse_stat(stat);
    if (process.pid <= 0) continue;  // It may have ended meanwhile.
    if (is_zombie(stat)) process.live_thread = live_thread_of(process.pid);
    all.push_back(process);
  }
  return all;
}

void for_each_thread(pid_t pid, const std::function<void(const std::filesystem::path&)>& use) {
  std::error_code ignored;
  const std::filesystem::path folder = fmt::format("/proc/{}/task", pid);
  for (std::filesystem::directory_iterator entry(folder, ignored), end; entry != end && !ignored;
       entry.increment(ignored)) {
    use(entry->path());
  }
}

std::vector<ProcessEntry> descendants_of(pid_t ancestor, const std::vector<ProcessEntry>& all) {
  std::set<pid_t> family{ancestor};
  std::vector<ProcessEntry> found;
  // Numbers are used again, so a child may have a smaller number than its parent.
  for (std::size_t before = 0; before != family.size();) {
    before = family.size();
    for (const ProcessEntry& process : all) {
      if (family.contains(process.parent) && family.insert(process.pid).second) {
        found.push_back(process);
      }
    }
  }
  return found;
}

std::uint64_t memory_of(const std::vector<ProcessEntry>& processes, std::uint64_t enough) {
  std::uint64_t sum = 0;
  for (const ProcessEntry& process : processes) sum += quick_memory_of(process);
  if (sum <= enough) return sum;
  // Whoever makes this slow is counted without it.
  constexpr auto kLongest = std::chrono::milliseconds(200);
  const Deadline deadline(kLongest);
  std::uint64_t exact = 0;
  for (const ProcessEntry& process : processes) {
    const std::string rollup =
        deadline.passed() ? "" : proc_text(process.live_thread, "smaps_rollup");
    exact += rollup.empty() ? quick_memory_of(process)
                            : sum_of(rollup, {"Pss_Anon", "Pss_Shmem", "SwapPss"}) +
                                  sum_of(proc_text(process.live_thread, "status"), {"VmPTE"});
  }
  return exact;
}

std::uint64_t threads_of(uid_t user) {
  std::uint64_t threads = 0;
  for (const ProcessEntry& process : all_processes()) {
    struct stat status{};
    const std::string path = fmt::format("/proc/{}", process.pid);
    if (::stat(path.c_str(), &status) == 0 && status.st_uid == user) threads += process.threads;
  }
  return threads;
}

bool end_descendants() {
  constexpr int kMaxSweeps = 500;  // 10 s
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    reap();
    // Those that are stopped start no others, so the rounds end.
    std::set<pid_t> stopped;
    for (bool has_new = true; has_new;) {
      has_new = false;
      for (const ProcessEntry& process : descendants_of(::getpid(), all_processes())) {
        if (process.has_ended || !stopped.insert(process.pid).second) continue;
        has_new = ::kill(process.pid, SIGSTOP) == 0 || has_new;
      }
    }
    if (stopped.empty()) {
      reap();  // those that have ended since
      return true;
    }
    for (const pid_t pid : stopped) ::kill(pid, SIGKILL);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return false;
}

}  // namespace trifinger::apps
