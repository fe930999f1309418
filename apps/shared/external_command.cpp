// SPDX-License-Identifier: BSD-3-Clause
#include "shared/external_command.hpp"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <set>
#include <sstream>
#include <string_view>
#include <system_error>

#include "shared/exit_code.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::apps {
namespace {

constexpr std::string_view kPrefix = "trifinger-";
constexpr const char* kProgramsHeading = "Programs of their own";
constexpr const char* kPythonHeading = "Programs of the Python package";

// Returns where programs are searched: the PATH, then the folder of this program.
std::string search_path() {
  const char* const path = std::getenv("PATH");
  std::error_code ignored;
  const auto self = std::filesystem::canonical("/proc/self/exe", ignored);
  return (path == nullptr ? "" : std::string(path) + ":") + self.parent_path().string();
}

// Blocks Ctrl-C in this thread, or lets it come again.
void set_interrupt(int how) {
  sigset_t signals;
  ::sigemptyset(&signals);
  ::sigaddset(&signals, SIGINT);
  ::pthread_sigmask(how, &signals, nullptr);
}

}  // namespace

std::vector<std::string> external_verbs() {
  std::set<std::string> verbs;
  std::istringstream folders(search_path());
  for (std::string folder; std::getline(folders, folder, ':');) {
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
  ::setenv("PATH", search_path().c_str(), 1);
  ::execvp(program.c_str(), words.data());
  // EACCES: the PATH contains a folder that we may not search.
  if (errno != ENOENT && errno != EACCES) throw SystemError("start " + program, errno);
}

void run_python(const std::string& verb, const std::string& command,
                const std::vector<std::string>& arguments) {
  // While Python itself starts, Ctrl-C would end it with a traceback. The package
  // trifinger_launcher lets the signal come.
  set_interrupt(SIG_BLOCK);
  run_external(verb, arguments);
  set_interrupt(SIG_UNBLOCK);
  throw UsageError("'trifinger " + command +
                   "' is part of the Python package, which is not installed here, or not on the "
                   "PATH: 'pip install .' in the sources of TriFinger installs it");
}

void declare_external(CLI::App& parent, const std::string& verb, const std::string& description,
                      Package package) {
  parent.add_subcommand(verb, description)
      ->prefix_command()
      ->group(package == Package::kPython ? kPythonHeading : kProgramsHeading);
}

void run_declared_external(const CLI::App& program, const std::vector<std::string>& words) {
  const CLI::App* command = &program;
  std::string path;
  auto word = words.begin();
  for (; word != words.end() && !command->get_prefix_command(); ++word) {
    const auto commands = command->get_subcommands({});
    const auto found = std::ranges::find(commands, *word, &CLI::App::get_name);
    if (found == commands.end()) return;
    command = *found;
    path += (path.empty() ? "" : " ") + *word;
  }
  if (!command->get_prefix_command()) return;

  std::string verb = path;
  std::ranges::replace(verb, ' ', '-');
  const std::vector<std::string> arguments(word, words.end());
  if (command->get_group() == kPythonHeading) run_python(verb, path, arguments);
  run_external(verb, arguments);
  throw UsageError("'trifinger " + path + "' is a program of its own, trifinger-" + verb +
                   ", which is neither beside this one nor on the PATH");
}

}  // namespace trifinger::apps
