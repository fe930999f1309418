// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

namespace trifinger::python {

/// Makes the class Element: NumPy's record with attributes of its own. numpy.record prefers what
/// every scalar has, so that the field `flags` of a status could not be read, and takes three times
/// as long.
void bind_element(nanobind::module_& m);

}  // namespace trifinger::python
