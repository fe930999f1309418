// SPDX-License-Identifier: BSD-3-Clause
#include "shared/external_command.hpp"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <set>
#include <sstream>
#include <string_view>
#include <system_error>

#include "shared/exit_code.hpp"
#include "trifinger/base/error.hpp"

namespace trifinger::apps {
namespace {

constexpr std::string_view kPrefix = "trifinger-";

struct Command {
  const char* verb;     // What follows "trifinger-" in the name of the program.
  const char* help;     // One line.
  const char* package;  // The Python package that brings it; empty: it is built with this program.
  const char* folder;   // Where the sources of TriFinger have that package.
};

constexpr Command kCommands[] = {
#include "external_commands.inc"
};
constexpr Command kPython{.verb = "", .help = "", .package = "trifinger", .folder = "."};

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

// Returns the folders in which programs are searched.
std::vector<std::string> search_folders() {
  std::vector<std::string> folders;
  std::istringstream path(search_path());
  for (std::string folder; std::getline(path, folder, ':');) folders.push_back(folder);
  return folders;
}

bool is_installed(const std::string& verb, const std::vector<std::string>& folders) {
  return std::ranges::any_of(folders, [&verb](const std::string& folder) {
    return ::access((folder + "/" + std::string(kPrefix) + verb).c_str(), X_OK) == 0;
  });
}

// True if `verb` belongs to a command with others below it, or is a part of a program:
// trifinger-log-plot is the program of `trifinger log plot`, and trifinger-run-policy-of-python a
// part of `trifinger run-policy`.
bool is_below_a_command(const CLI::App& program, const std::string& verb) {
  return std::ranges::any_of(program.get_subcommands({}), [&verb](const CLI::App* command) {
    const bool has_parts = !command->get_subcommands({}).empty() || command->get_prefix_command();
    return has_parts && verb.starts_with(command->get_name() + "-");
  });
}

std::string how_to_install(const Command& command) {
  return std::string("'pip install ") + command.folder + "' in the sources of TriFinger";
}

// Returns the heading of a command in --help.
std::string heading(const Command& command, bool is_there) {
  if (*command.package == '\0') return "Programs of their own";
  std::string package = std::string("Python package ") + command.package;
  if (is_there) return package;
  return std::string("Not installed, 'pip install ") + command.folder +
         "' in the sources of TriFinger adds them";
}

[[noreturn]] void refuse_missing(const std::string& path, const Command& command) {
  throw UsageError("'trifinger " + path + "' is part of the Python package " + command.package +
                   ", which is not installed here, or not on the PATH: " + how_to_install(command) +
                   " installs it");
}

// Replaces this process by a program that is written in Python; returns if it is missing.
void start_python(const std::string& verb, const std::vector<std::string>& arguments) {
  // While Python itself starts, Ctrl-C would end it with a traceback. The package
  // trifinger_launcher lets the signal come.
  set_interrupt(SIG_BLOCK);
  run_external(verb, arguments);
  set_interrupt(SIG_UNBLOCK);
}

}  // namespace

void declare_external(CLI::App& parent) {
  const bool is_program = parent.get_parent() == nullptr;
  const std::string above = is_program ? "" : parent.get_name() + "-";
  const std::vector<std::string> folders = search_folders();
  for (const Command& command : kCommands) {
    const std::string verb = command.verb;
    if (is_program ? is_below_a_command(parent, verb) : !verb.starts_with(above)) continue;
    parent.add_subcommand(verb.substr(above.size()), command.help)
        ->prefix_command()
        ->group(heading(command, is_installed(verb, folders)));
  }
}

std::vector<std::string> foreign_verbs(const CLI::App& program) {
  std::set<std::string> verbs;
  for (const std::string& folder : search_folders()) {
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
      const std::string file = entry.path().filename().string();
      if (file.starts_with(kPrefix) && ::access(entry.path().c_str(), X_OK) == 0) {
        verbs.insert(file.substr(kPrefix.size()));
      }
    }
  }
  for (const CLI::App* command : program.get_subcommands({})) verbs.erase(command->get_name());
  std::erase_if(verbs, [&](const std::string& verb) { return is_below_a_command(program, verb); });
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
  start_python(verb, arguments);
  refuse_missing(command, kPython);
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
  const auto* const declared = std::ranges::find(kCommands, verb, &Command::verb);
  if (declared != std::end(kCommands) && *declared->package != '\0') {
    start_python(verb, arguments);
    refuse_missing(path, *declared);
  }
  run_external(verb, arguments);
  throw UsageError("'trifinger " + path + "' is a program of its own, trifinger-" + verb +
                   ", which is neither beside this one nor on the PATH");
}

}  // namespace trifinger::apps
