// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <Eigen/Core>
#include <cstddef>
#include <initializer_list>
#include <span>
#include <string>
#include <utility>

#include "array.hpp"
#include "numpy.hpp"
#include "shown.hpp"
#include "trifinger/base/error.hpp"

// Lists of numbers whose length only their owners know.

namespace trifinger::bindings {

/// @throws InvalidArgument if an argument has not as many numbers as are expected
inline void require_length(const char* what, std::size_t found, std::size_t expected) {
  if (found == expected) return;
  throw InvalidArgument(std::string(what) + " has " + std::to_string(found) +
                        " numbers, must have " + std::to_string(expected));
}

/// A vector of any length.
using Numbers = Array<Eigen::VectorXd>;

/// A new array with these numbers.
[[nodiscard]] inline Numbers copy_of(std::span<const double> numbers) {
  return {Eigen::VectorXd::Map(numbers.data(), static_cast<Eigen::Index>(numbers.size()))};
}

/// Lengths of an array along its axes.
using Shape = std::initializer_list<npy_intp>;

/// A new array of this shape and of a type such as NPY_DOUBLE, and its memory.
[[nodiscard]] std::pair<nanobind::object, void*> new_array(Shape shape, int type);

/// A new array of this shape with these numbers.
[[nodiscard]] ShownArray copy_of(std::span<const double> numbers, Shape shape);

/// Numbers, and the array that keeps them.
struct Doubles {
  nanobind::object array;
  std::span<const double> numbers;
};

/// Converts whatever NumPy accepts as an array of doubles of this shape, in place if it is one. A
/// length of -1 may be any.
/// @throws InvalidArgument about `what`, whatever NumPy raises
[[nodiscard]] Doubles doubles_of(nanobind::handle object, Shape shape, const std::string& what);

/// These numbers in place, as an array of this shape that keeps `owner` alive.
[[nodiscard]] ShownArray view_of(std::span<double> numbers, Shape shape, nanobind::handle owner);

}  // namespace trifinger::bindings
