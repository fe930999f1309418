// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "trifinger/config/node.hpp"

namespace trifinger::test {

/// Returns the text of the ConfigError that `function` throws, or "no error".
template <class Function>
std::string message_of(const Function& function) {
  try {
    function();
  } catch (const config::ConfigError& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace trifinger::test
