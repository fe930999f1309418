// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/base/error.hpp"

#include <cerrno>
#include <string>
#include <string_view>
#include <system_error>

namespace trifinger {
namespace {

// How to raise the limit that this process has reached.
std::string_view remedy_of(int error_number) {
  switch (error_number) {
    case EMFILE:
      return "; 'ulimit -n' shows how many this process may open, and raises it";
    case EFBIG:
      return "; 'ulimit -f' shows how large a file may be, and raises it";
    default:
      return {};
  }
}

}  // namespace

SystemError::SystemError(const std::string& doing, int error_number)
    : Error(doing + ": " + std::generic_category().message(error_number) +
            std::string(remedy_of(error_number))),
      error_number_(error_number) {}

}  // namespace trifinger
