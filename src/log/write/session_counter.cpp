// SPDX-License-Identifier: BSD-3-Clause
#include "log/write/session_counter.hpp"

#include <sys/inotify.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <string_view>

#include "trifinger/core/session.hpp"

namespace trifinger::log::detail {
namespace {

constexpr std::string_view kPrefix = "trifinger.";
constexpr std::string_view kSuffix = ".state";

}  // namespace

SessionCounter::SessionCounter(const std::vector<std::string>& robots) {
  if (robots.empty()) return;
  file_ = ipc::FileDescriptor([] { return ::inotify_init1(IN_CLOEXEC | IN_NONBLOCK); });
  for (const std::string& robot : robots) counts_[robot] = 0;
  // A new session is moved to its name, which also replaces the session before.
  if (file_ && ::inotify_add_watch(file_.get(), session_folder().c_str(), IN_MOVED_TO) < 0) {
    file_ = ipc::FileDescriptor();
  }
}

const std::map<std::string, int>& SessionCounter::count() {
  alignas(inotify_event) std::array<char, 4096> buffer;
  while (file_) {
    const ssize_t size = ::read(file_.get(), buffer.data(), buffer.size());
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) break;
    for (ssize_t at = 0; at < size;) {
      inotify_event event;
      std::memcpy(&event, buffer.data() + at, sizeof(event));
      at += static_cast<ssize_t>(sizeof(event));
      std::string_view name(buffer.data() + at, ::strnlen(buffer.data() + at, event.len));
      at += static_cast<ssize_t>(event.len);
      if (!name.starts_with(kPrefix) || !name.ends_with(kSuffix)) continue;
      name.remove_prefix(kPrefix.size());
      name.remove_suffix(std::min(name.size(), kSuffix.size()));
      const auto robot = counts_.find(std::string(name));
      if (robot != counts_.end()) ++robot->second;
    }
  }
  return counts_;
}

}  // namespace trifinger::log::detail
