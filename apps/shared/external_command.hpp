// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

// Commands that are programs of their own: `trifinger film` is the program trifinger-film. The
// project and its packages declare theirs (cmake/TrifingerCommands.cmake). Others need not.
namespace trifinger::apps {

// Declares the commands that belong below `parent`, which is the program itself or one of its
// commands: trifinger-log-plot is `plot` below "log". The program itself must be the last.
void declare_external(CLI::App& parent);

// Returns the verbs of all programs trifinger-VERB that nobody has declared, sorted. The programs
// are on the PATH or beside this one.
[[nodiscard]] std::vector<std::string> foreign_verbs(const CLI::App& program);

// Replaces this process by the program trifinger-`verb` with the further `arguments`. Returns if
// there is no such program. Throws SystemError if it cannot be started.
void run_external(const std::string& verb, const std::vector<std::string>& arguments);

// Replaces this process by the program trifinger-`verb` of the Python package. `command` is what
// the user calls it. Throws UsageError that says how to get it if it is missing.
[[noreturn]] void run_python(const std::string& verb, const std::string& command,
                             const std::vector<std::string>& arguments);

// Replaces this process by the program of a declared command if `words` begin with one. The words
// after it, including --help, belong to that program. If it is missing, throws UsageError, which
// says how to get it.
void run_declared_external(const CLI::App& program, const std::vector<std::string>& words);

}  // namespace trifinger::apps
