// SPDX-License-Identifier: BSD-3-Clause
#include "base/user_folder.hpp"

#include <sys/stat.h>

#include <cerrno>
#include <cstdlib>
#include <system_error>

#include "trifinger/base/error.hpp"

namespace trifinger {
namespace {

std::filesystem::path path_in(const std::string& variable) {
  const char* const value = std::getenv(variable.c_str());
  return value != nullptr ? value : "";
}

}  // namespace

std::filesystem::path UserFolder::path() const {
  if (const auto folder = path_in(variable); !folder.empty()) {
    std::error_code error;
    const std::filesystem::path absolute = std::filesystem::absolute(folder, error);
    return error ? folder : absolute;
  }
  // The specification says that a relative path must be ignored.
  if (const auto base = path_in(xdg_variable); base.is_absolute()) {
    return below.empty() ? base / "trifinger" : base / "trifinger" / below;
  }
  if (const auto home = path_in("HOME"); home.is_absolute()) {
    const std::filesystem::path base = home / at_home / "trifinger";
    return below.empty() ? base : base / below;
  }
  throw InvalidArgument("there is no folder for " + purpose + ": " + variable +
                        " is not set, and neither " + xdg_variable +
                        " nor HOME is an absolute path");
}

std::filesystem::path UserFolder::make() const {
  const std::filesystem::path folder = path();
  std::filesystem::path made;
  for (const std::filesystem::path& part : folder) {
    made /= part;
    if (::mkdir(made.c_str(), 0700) != 0 && errno != EEXIST) {
      throw SystemError("make the folder " + made.string(), errno);
    }
  }
  std::error_code ignored;
  if (!std::filesystem::is_directory(folder, ignored)) {
    throw SystemError("use " + folder.string() + " as folder for " + purpose, ENOTDIR);
  }
  return folder;
}

}  // namespace trifinger
