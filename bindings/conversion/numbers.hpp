// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <initializer_list>
#include <span>
#include <string>

#include "array.hpp"
#include "numpy.hpp"
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

/// A new array of this shape with these numbers.
[[nodiscard]] inline nanobind::object copy_of(std::span<const double> numbers,
                                              std::initializer_list<npy_intp> shape) {
  nanobind::object array = nanobind::steal(
      PyArray_SimpleNew(static_cast<int>(shape.size()), std::data(shape), NPY_DOUBLE));
  if (!array.is_valid()) throw nanobind::python_error();
  std::ranges::copy(
      numbers, static_cast<double*>(PyArray_DATA(reinterpret_cast<PyArrayObject*>(array.ptr()))));
  return array;
}

/// These numbers in place, as an array of this shape that keeps `owner` alive.
[[nodiscard]] inline nanobind::object view_of(std::span<double> numbers,
                                              std::initializer_list<npy_intp> shape,
                                              nanobind::handle owner) {
  nanobind::object array = nanobind::steal(PyArray_SimpleNewFromData(
      static_cast<int>(shape.size()), std::data(shape), NPY_DOUBLE, numbers.data()));
  if (!array.is_valid()) throw nanobind::python_error();
  Py_INCREF(owner.ptr());  // the call takes one reference
  if (PyArray_SetBaseObject(reinterpret_cast<PyArrayObject*>(array.ptr()), owner.ptr()) != 0)
    throw nanobind::python_error();
  return array;
}

}  // namespace trifinger::bindings
