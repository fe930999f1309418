// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/core.h>

#include <cstdio>
#include <string>
#include <string_view>
#include <type_traits>

#include "base/printable.hpp"

namespace trifinger::apps {

template <class T>
constexpr bool kIsText = std::is_convertible_v<const T&, std::string_view>;

template <class T>
std::conditional_t<kIsText<T>, std::string, T> as_printable(const T& value) {
  if constexpr (kIsText<T>) {
    return printable(value);
  } else {
    return value;
  }
}

// Prints as fmt::print does. Texts among the arguments may be anybody's: they are shown as
// `printable` says. Use fmt::print for texts that are painted already, and for data.
template <class... Arguments>
void print_safely(std::FILE* file, fmt::format_string<const Arguments&...> format,
                  const Arguments&... arguments) {
  fmt::print(file, fmt::runtime(fmt::string_view(format)), as_printable(arguments)...);
}

template <class... Arguments>
void print_safely(fmt::format_string<const Arguments&...> format, const Arguments&... arguments) {
  print_safely(stdout, format, arguments...);
}

// Prints what happens to a robot, at once.
inline void say(const std::string& robot, const std::string& sentence) {
  print_safely("{}: {}\n", robot, sentence);
  std::fflush(stdout);
}

}  // namespace trifinger::apps
