// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/base/error.hpp"

namespace trifinger {

/// Returns `pointer`, through which an object that can be moved reaches what it owns.
/// @throws InvalidArgument if the object was moved from. In a function that cannot throw, this ends
/// the program with that sentence.
template <class Pointer>
[[nodiscard]] const Pointer& checked(const Pointer& pointer) {
  if (pointer == nullptr) {
    throw InvalidArgument(
        "an object was used after it had been moved: use the object that it was moved to");
  }
  return pointer;
}

}  // namespace trifinger
