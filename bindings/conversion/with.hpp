// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <string>

namespace trifinger::bindings {

/// Gives the class `name` the functions of a `with` block. `exit(object, is_clean)` ends the block;
/// it is clean unless it raised an exception.
template <class T, class Exit>
void bind_with(nanobind::class_<T>& type, const std::string& name, const Exit& exit) {
  using namespace nanobind::literals;
  using nanobind::handle;
  type.def(
          "__enter__", [](nanobind::object self) { return self; },
          nanobind::sig(("def __enter__(self) -> " + name).c_str()))
      .def(
          "__exit__",
          [exit](T& object, handle raised, handle /*value*/, handle /*traceback*/) {
            exit(object, raised.is_none());
          },
          "type"_a.none(), "value"_a.none(), "traceback"_a.none(),
          nanobind::sig(
              "def __exit__(self, type: builtins.type[BaseException] | None, "
              "value: BaseException | None, traceback: types.TracebackType | None) -> None"));
}

}  // namespace trifinger::bindings
