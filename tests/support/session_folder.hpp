// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "trifinger/base/error.hpp"

namespace trifinger::test {

/// A separate folder for the sessions of one test, so that tests may run in parallel.
class SessionFolder {
 public:
  SessionFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "trifinger_test_XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw SystemError("make a folder for sessions", errno);
    path_ = name;
    ::setenv("TRIFINGER_SESSION_DIR", path_.c_str(), 1);
  }
  SessionFolder(const SessionFolder&) = delete;
  SessionFolder& operator=(const SessionFolder&) = delete;
  ~SessionFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace trifinger::test
