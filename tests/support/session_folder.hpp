// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdlib>
#include <filesystem>

#include "support/folder.hpp"

namespace trifinger::test {

/// A separate folder for the sessions of one test, so that tests may run in parallel.
class SessionFolder {
 public:
  SessionFolder() { ::setenv("TRIFINGER_SESSION_DIR", folder_.path().c_str(), 1); }

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return folder_.path(); }

 private:
  Folder folder_;
};

}  // namespace trifinger::test
