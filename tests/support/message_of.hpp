// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace trifinger::test {

/// What `call` throws as an `Exception`; "nothing" if it returns.
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
