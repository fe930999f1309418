// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace trifinger::test {

/// Returns the text of the `Exception` that `call` throws; "nothing" if it returns.
template <class Exception, class Call>
[[nodiscard]] std::string message_of(const Call& call) {
  try {
    static_cast<void>(call());
  } catch (const Exception& error) {
    return error.what();
  }
  return "nothing";
}

}  // namespace trifinger::test
