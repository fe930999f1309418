// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <algorithm>
#include <cstddef>
#include <utility>

namespace trifinger::bindings {

/// A text that is known when the program is compiled.
template <std::size_t N>
struct TypeName {
  // NOLINTNEXTLINE(misc-explicit-constructor): a literal is an argument of a template.
  consteval TypeName(const char (&name)[N]) { std::copy_n(name, N, text); }

  char text[N]{};
};

/// An object of Python that signatures show as the type `kName`, for example "os.PathLike[str]".
/// It is not checked: whoever gets it converts it.
template <TypeName kName>
class Shown : public nanobind::object {
 public:
  // NOLINTNEXTLINE(readability-identifier-naming): nanobind looks for it
  static constexpr auto Name = nanobind::detail::const_name(kName.text);
  static bool check_(nanobind::handle /*object*/) noexcept { return true; }

  using nanobind::object::object;
  // NOLINTNEXTLINE(misc-explicit-constructor): functions that return one convert an object.
  Shown(nanobind::object shown) noexcept : nanobind::object(std::move(shown)) {}
};

/// A time in seconds, or None where the argument says so: see `to_timeout`.
using ShownSeconds = Shown<"float">;
/// See `to_path`.
using ShownPath = Shown<"str | os.PathLike[str]">;
using ShownArray = Shown<"numpy.typing.NDArray[numpy.float64]">;
using ShownNumbers = Shown<"numpy.typing.ArrayLike">;

/// Texts by their names.
using ShownTexts = Shown<"dict[str, str]">;
/// Values of a configuration by their keys.
using Overrides = nanobind::typed<nanobind::dict, nanobind::str, nanobind::object>;

}  // namespace trifinger::bindings
