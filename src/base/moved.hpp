// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/base/error.hpp"

namespace trifinger {

/// What `pointer` owns, through which an object that can be moved reaches its implementation.
/// @throws InvalidArgument if the object was moved from. In a function that cannot throw, this ends
/// the program with that sentence.
template <class Pointer>
[[nodiscard]] auto* checked(const Pointer& pointer) {
  if (pointer == nullptr) {
    throw InvalidArgument(
        "an object was used after it had been moved: use the object that it was moved to");
  }
  return pointer.get();
}

}  // namespace trifinger
