// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "conversion/element_type.hpp"
#include "trifinger/core/payload.hpp"

namespace trifinger::bindings {

/// A payload for Python, with the NumPy type of its fields.
struct PythonPayload {
  PayloadView view;
  ElementType type;
};

}  // namespace trifinger::bindings
