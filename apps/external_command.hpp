// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

// Commands that are programs of their own: `trifinger film` is the program trifinger-film.
namespace trifinger::apps {

// The verbs of all programs that are called trifinger-VERB, sorted; they are on the PATH or beside
// this one.
[[nodiscard]] std::vector<std::string> external_verbs();

// Becomes the program trifinger-`verb` with the further `arguments`. Returns if there is none.
// Throws SystemError if there is one that cannot be started.
void run_external(const std::string& verb, const std::vector<std::string>& arguments);

// Where a program comes from; --help has a heading for each.
enum class Package : unsigned char { kPrograms, kPython };

// Lets `parent` know the command `verb`: trifinger-`verb`, or trifinger-log-`verb` below "log".
void declare_external(CLI::App& parent, const std::string& verb, const std::string& description,
                      Package package);

// Becomes the program of a declared command if `words` begin with one; what follows, --help too, is
// for that program. Throws UsageError, which says how to get it, if it is not there.
void run_declared_external(const CLI::App& program, const std::vector<std::string>& words);

}  // namespace trifinger::apps
