// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/core/log_folder.hpp"

#include <sys/stat.h>

#include <cerrno>
#include <cstdlib>
#include <system_error>

#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

std::filesystem::path path_in(const char* variable) {
  const char* const value = std::getenv(variable);
  return value != nullptr ? value : "";
}

std::filesystem::path chosen_folder() {
  if (const auto folder = path_in("TRIFINGER_LOG_DIR"); !folder.empty()) {
    std::error_code error;
    const std::filesystem::path absolute = std::filesystem::absolute(folder, error);
    return error ? folder : absolute;
  }
  // The XDG base directory specification says that a relative path must be ignored.
  if (const auto state = path_in("XDG_STATE_HOME"); state.is_absolute()) {
    return state / "trifinger";
  }
  if (const auto home = path_in("HOME"); home.is_absolute()) {
    return home / ".local" / "state" / "trifinger";
  }
  throw InvalidArgument(
      "there is no folder for logs: TRIFINGER_LOG_DIR is not set, and neither XDG_STATE_HOME nor "
      "HOME is an absolute path");
}

}  // namespace

std::filesystem::path log_folder() {
  const std::filesystem::path folder = chosen_folder();
  std::filesystem::path made;
  for (const std::filesystem::path& part : folder) {
    made /= part;
    if (::mkdir(made.c_str(), 0700) != 0 && errno != EEXIST) {
      throw SystemError("make the folder " + made.string(), errno);
    }
  }
  std::error_code ignored;
  if (!std::filesystem::is_directory(folder, ignored)) {
    throw SystemError("use " + folder.string() + " as folder for logs", ENOTDIR);
  }
  return folder;
}

}  // namespace trifinger
