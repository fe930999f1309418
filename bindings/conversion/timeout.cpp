// SPDX-License-Identifier: BSD-3-Clause
#include "timeout.hpp"

#include <cmath>
#include <string>

namespace nb = nanobind;

namespace trifinger::bindings {
namespace {

// From here on [292 years], nanoseconds do not fit into 64 bits.
constexpr double kLimit = 9.2e9;  // [s]

}  // namespace

Timeout to_timeout(nb::handle seconds) {
  if (seconds.is_none()) return kForever;
  const double value = PyFloat_AsDouble(seconds.ptr());
  if (value == -1.0 && PyErr_Occurred() != nullptr) {
    PyErr_Clear();
    throw InvalidArgument("timeout is " + std::string(nb::repr(seconds).c_str()) +
                          "; allowed are seconds and None (as long as it takes)");
  }
  if (!(value >= 0.0)) {  // also refuses NaN
    throw InvalidArgument("timeout is " + std::string(nb::repr(seconds).c_str()) +
                          "; allowed are seconds from 0 on and None (as long as it takes)");
  }
  if (value >= kLimit) return kForever;
  return Timeout(static_cast<Timeout::rep>(value * 1e9));
}

Nanoseconds to_time(double seconds) {
  if (!(std::abs(seconds) < kLimit)) {
    throw InvalidArgument("a time of " + std::to_string(seconds) + " s is none");
  }
  return Nanoseconds(std::llround(seconds * 1e9));
}

}  // namespace trifinger::bindings
