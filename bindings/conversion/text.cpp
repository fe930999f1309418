// SPDX-License-Identifier: BSD-3-Clause
#include "text.hpp"

#include <deque>

#include "base/printable.hpp"
#include "trifinger/base/error.hpp"

namespace nb = nanobind;

namespace trifinger::bindings {
namespace {

nb::str decoded(std::string_view text, const char* errors) {
  auto string = nb::steal<nb::str>(
      PyUnicode_DecodeUTF8(text.data(), static_cast<Py_ssize_t>(text.size()), errors));
  if (!string.is_valid()) throw nb::python_error();
  return string;
}

std::string bytes_of(nb::handle bytes) {
  return {PyBytes_AsString(bytes.ptr()), static_cast<std::size_t>(PyBytes_Size(bytes.ptr()))};
}

}  // namespace

nb::str to_str(std::string_view text) { return decoded(text, "surrogateescape"); }

nb::str to_text(std::string_view text) { return decoded(text, "replace"); }

nb::str to_message(std::string_view text) {
  return decoded(printable_lines(text), "backslashreplace");
}

std::string text_of(nb::handle object) {
  const nb::object bytes =
      nb::steal(PyUnicode_AsEncodedString(nb::str(object).ptr(), "utf-8", "backslashreplace"));
  if (!bytes.is_valid()) throw nb::python_error();
  return bytes_of(bytes);
}

std::filesystem::path to_path(nb::handle path) {
  std::string bytes = bytes_of(nb::module_::import_("os").attr("fsencode")(path));
  if (bytes.find('\0') != std::string::npos) {
    throw InvalidArgument("the path " + std::string(nb::repr(path).c_str()) +
                          " has a zero byte in it, which no path can have");
  }
  return bytes;
}

Shown<"pathlib.Path"> to_python(const std::filesystem::path& path) {
  return nb::module_::import_("pathlib").attr("Path")(to_str(path.native()));
}

const char* also(const std::string& comment, const char* python) {
  static std::deque<std::string> texts;
  return texts.emplace_back(comment + "\n\n" + python).c_str();
}

bool read_str(nb::handle text, std::string& bytes) noexcept {
  if (PyUnicode_Check(text.ptr()) == 0) return false;
  const nb::object encoded =
      nb::steal(PyUnicode_AsEncodedString(text.ptr(), "utf-8", "surrogateescape"));
  if (!encoded.is_valid()) {
    PyErr_Clear();
    return false;
  }
  bytes = bytes_of(encoded);
  return true;
}

}  // namespace trifinger::bindings
