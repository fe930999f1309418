// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <stdexcept>
#include <string>
#include <string_view>

namespace trifinger {

/// Base of all exceptions that this library throws. The text is one sentence. It names the thing,
/// the value found and the value allowed, or the remedy.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// An argument makes no sense: a wrong name, range, size or unit.
class InvalidArgument : public Error {
 public:
  using Error::Error;
};

/// A wait took longer than its `Timeout`. The awaited value may still come later.
class TimedOut : public Error {
 public:
  using Error::Error;
};

/// A call to the operating system failed.
class SystemError : public Error {
 public:
  /// `doing` says what was tried, for example "open /dev/shm/trifinger.sim.state". The text of
  /// `error_number` follows it.
  SystemError(const std::string& doing, int error_number);

  [[nodiscard]] int error_number() const noexcept { return error_number_; }

 private:
  int error_number_;
};

namespace detail {

inline void require(bool holds, const std::string& text) {
  if (!holds) throw InvalidArgument(text);
}

// These three may be called at 1 kHz: they allocate only for an error.

inline void require_positive(std::string_view what, double value) {
  if (std::isfinite(value) && value > 0.0) return;
  throw InvalidArgument(std::string(what) + " is " + std::to_string(value) + ", must be above 0");
}

inline void require_not_negative(std::string_view what, double value) {
  if (std::isfinite(value) && value >= 0.0) return;
  throw InvalidArgument(std::string(what) + " is " + std::to_string(value) +
                        ", must be at least 0");
}

// `numbers` is a vector or matrix of Eigen.
template <class Numbers>
void require_finite(std::string_view what, const Numbers& numbers) {
  if (numbers.allFinite()) return;
  throw InvalidArgument(std::string(what) + " has a number that is not finite");
}

}  // namespace detail
}  // namespace trifinger
