// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

// Texts that go from Python to C++ and back. In C++ they are bytes, which need not be UTF-8: names
// of files, what others have written. In Python such a byte is a lone surrogate, as it is in the
// names of files that Python itself gives ("surrogateescape"), and goes back as the same byte.

namespace trifinger::python {

[[nodiscard]] nanobind::object to_str(std::string_view text);
/// Bytes that are no UTF-8 are shown as in "\xff": for messages, which are printed.
[[nodiscard]] nanobind::object to_message(std::string_view text);
/// str(object), whatever characters are in it: for messages.
[[nodiscard]] std::string text_of(nanobind::handle object);

/// What Python takes for a path: str, bytes or os.PathLike.
/// @throws TypeError, UnicodeEncodeError, InvalidArgument if it has a zero byte in it.
[[nodiscard]] std::filesystem::path to_path(nanobind::handle path);
/// A pathlib.Path.
[[nodiscard]] nanobind::object to_python(const std::filesystem::path& path);

namespace detail {

/// False, and no Python error is set, if `text` is no str or cannot be bytes.
[[nodiscard]] bool read_str(nanobind::handle text, std::string& bytes) noexcept;

}  // namespace detail
}  // namespace trifinger::python

namespace nanobind::detail {

template <>
struct type_caster<std::string> {
  NB_TYPE_CASTER(std::string, const_name("str"))

  bool from_python(handle source, std::uint32_t /*flags*/, cleanup_list* /*cleanup*/) noexcept {
    return trifinger::python::detail::read_str(source, value);
  }
  static handle from_cpp(const std::string& text, rv_policy /*policy*/,
                         cleanup_list* /*cleanup*/) noexcept {
    return PyUnicode_DecodeUTF8(text.data(), static_cast<Py_ssize_t>(text.size()),
                                "surrogateescape");
  }
};

// Nobody would own its bytes: take a std::string.
template <>
struct type_caster<std::string_view>;

}  // namespace nanobind::detail
