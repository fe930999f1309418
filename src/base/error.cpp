// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/base/error.hpp"

#include <system_error>

namespace trifinger {

SystemError::SystemError(const std::string& doing, int error_number)
    : Error(doing + ": " + std::generic_category().message(error_number)),
      error_number_(error_number) {}

}  // namespace trifinger
