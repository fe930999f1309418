// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <string_view>

namespace trifinger::python {

[[nodiscard]] inline nanobind::str to_str(std::string_view text) {
  return nanobind::str(text.data(), text.size());
}

}  // namespace trifinger::python
