// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <poll.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <string>
#include <vector>

namespace trifinger::apps {

// The lines that are typed while a program runs.
class TypedLines {
 public:
  // Whole lines that have been typed since the last call. Waits for some up to `timeout`.
  std::vector<std::string> take(std::chrono::milliseconds timeout = {}) {
    std::vector<std::string> lines;
    pollfd input{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
    if (has_ended_ || ::poll(&input, 1, static_cast<int>(timeout.count())) <= 0) return lines;
    std::array<char, 4096> bytes{};
    const ssize_t count = ::read(STDIN_FILENO, bytes.data(), bytes.size());
    // A program in the background may not read from its terminal (EIO), but may come back.
    has_ended_ = count == 0 || (count < 0 && errno != EIO && errno != EINTR);
    if (has_ended_) text_ += '\n';  // the end of the last line
    if (count > 0) text_.append(bytes.data(), static_cast<std::size_t>(count));
    for (std::size_t end = 0; (end = text_.find('\n')) != std::string::npos;) {
      if (end > 0) lines.push_back(text_.substr(0, end));
      text_.erase(0, end + 1);
    }
    return lines;
  }

  // Whether there will be no others.
  [[nodiscard]] bool has_ended() const noexcept { return has_ended_; }

 private:
  std::string text_;
  bool has_ended_{false};
};

}  // namespace trifinger::apps
