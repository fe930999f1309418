// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "shown.hpp"

// Texts that go from Python to C++ and back. In C++ they are bytes that need not be UTF-8, such as
// names of files. In Python a byte that is no UTF-8 is a lone surrogate, like in the names of files
// that Python itself gives ("surrogateescape"). It goes back as the same byte.

namespace trifinger::bindings {

[[nodiscard]] nanobind::str to_str(std::string_view text);
/// Converts a text from a file. Bytes that are no UTF-8 become U+FFFD.
[[nodiscard]] nanobind::str to_text(std::string_view text);
/// Converts a text for a message. Bytes that are no UTF-8 are shown like "\xff".
[[nodiscard]] nanobind::str to_message(std::string_view text);
/// Returns str(object) with any characters, for a message.
[[nodiscard]] std::string text_of(nanobind::handle object);

/// Converts a path of Python: str, bytes or os.PathLike.
/// @throws TypeError, UnicodeEncodeError, InvalidArgument if it has a zero byte in it.
[[nodiscard]] std::filesystem::path to_path(nanobind::handle path);
/// Converts to a pathlib.Path.
[[nodiscard]] Shown<"pathlib.Path"> to_python(const std::filesystem::path& path);

/// Adds to the comment of C++'s headers what only Python's users need to know. The text stays as
/// long as the module.
[[nodiscard]] const char* also(const std::string& comment, const char* python);

/// Returns false, without setting an error in Python, if `text` is no str or cannot become bytes.
[[nodiscard]] bool read_str(nanobind::handle text, std::string& bytes) noexcept;

}  // namespace trifinger::bindings

namespace nanobind::detail {

template <>
struct type_caster<std::string> {
  NB_TYPE_CASTER(std::string, const_name("str"))

  bool from_python(handle source, std::uint32_t /*flags*/, cleanup_list* /*cleanup*/) noexcept {
    return trifinger::bindings::read_str(source, value);
  }
  static handle from_cpp(const std::string& text, rv_policy /*policy*/,
                         cleanup_list* /*cleanup*/) noexcept {
    return PyUnicode_DecodeUTF8(text.data(), static_cast<Py_ssize_t>(text.size()),
                                "surrogateescape");
  }
};

// Not available, because nobody would own the bytes. Take a std::string instead.
template <>
struct type_caster<std::string_view>;

}  // namespace nanobind::detail
