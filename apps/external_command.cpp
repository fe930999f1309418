// SPDX-License-Identifier: BSD-3-Clause
#include "external_command.hpp"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <set>
#include <string_view>

#include "trifinger/base/error.hpp"

namespace trifinger::apps {
namespace {

constexpr std::string_view kPrefix = "trifinger-";

}  // namespace

std::vector<std::string> external_verbs() {
  const char* const path = std::getenv("PATH");
  std::string_view folders = path == nullptr ? "" : path;
  std::set<std::string> verbs;
  while (!folders.empty()) {
    const std::string_view folder = folders.substr(0, folders.find(':'));
    folders.remove_prefix(std::min(folders.size(), folder.size() + 1));
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
      const std::string file = entry.path().filename().string();
      if (file.starts_with(kPrefix) && ::access(entry.path().c_str(), X_OK) == 0) {
        verbs.insert(file.substr(kPrefix.size()));
      }
    }
  }
  return {verbs.begin(), verbs.end()};
}

void run_external(const std::string& verb, const std::vector<std::string>& arguments) {
  const std::string program = std::string(kPrefix) + verb;
  std::vector<char*> words{const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments)
    words.push_back(const_cast<char*>(argument.c_str()));
  words.push_back(nullptr);
  ::execvp(program.c_str(), words.data());
  // EACCES: a folder on the PATH that is not ours to search.
  if (errno != ENOENT && errno != EACCES) throw SystemError("start " + program, errno);
}

}  // namespace trifinger::apps
