// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include <Eigen/Core>

#include "numpy.hpp"

namespace trifinger::bindings {

/// A matrix or vector `M` of doubles as an argument or result. An argument is whatever NumPy
/// accepts as an array of this shape. A result is an array that belongs to Python.
template <class M>
struct Array {
  M value;

  operator const M&() const noexcept { return value; }  // NOLINT(misc-explicit-constructor)
};

template <class M>
Array(M) -> Array<M>;

using Vector3 = Array<Eigen::Vector3d>;
using Vector9 = Array<Eigen::Vector<double, 9>>;

/// Default of an argument of three numbers.
inline nanobind::tuple zeros() { return nanobind::make_tuple(0.0, 0.0, 0.0); }

/// A matrix in the layout of NumPy.
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Reads a member that is a matrix or vector.
template <class T, class M>
auto array_of(M T::* member) {
  return [member](const T& object) { return Array<M>{object.*member}; };
}

/// Copies the numbers of `object` to `value`. Vectors must have one dimension, matrices two. The
/// number of rows must be that of `M` or, if `M` leaves it open, at most the maximum of `M`, if
/// any; columns must be those of `M`, unless it leaves them open. Returns false, without setting an
/// error in Python, if `object` does not fit.
template <class M>
bool read_array(nanobind::handle object, M& value) noexcept {
  const nanobind::object array =
      nanobind::steal(PyArray_FROM_OTF(object.ptr(), NPY_DOUBLE, NPY_ARRAY_IN_ARRAY));
  if (!array.is_valid()) {
    PyErr_Clear();
    return false;
  }
  constexpr int kDimensions = M::ColsAtCompileTime == 1 ? 1 : 2;
  auto* const numbers = reinterpret_cast<PyArrayObject*>(array.ptr());
  if (PyArray_NDIM(numbers) != kDimensions) return false;
  const Eigen::Index rows = PyArray_DIM(numbers, 0);
  const Eigen::Index columns = kDimensions == 1 ? 1 : PyArray_DIM(numbers, kDimensions - 1);
  constexpr bool kAnyRows = M::RowsAtCompileTime == Eigen::Dynamic;
  constexpr int kMaxRows = M::MaxRowsAtCompileTime;
  constexpr bool kHasMax = kMaxRows != Eigen::Dynamic;
  if (kAnyRows ? kHasMax && rows > kMaxRows : rows != M::RowsAtCompileTime) return false;
  if (M::ColsAtCompileTime != Eigen::Dynamic && columns != M::ColsAtCompileTime) return false;
  value =
      Eigen::Map<const RowMajor>(static_cast<const double*>(PyArray_DATA(numbers)), rows, columns);
  return true;
}

/// Returns a new array with the numbers of `value`; null with an error in Python if there is no
/// memory.
template <class M>
PyObject* write_array(const M& value) noexcept {
  constexpr int kDimensions = M::ColsAtCompileTime == 1 ? 1 : 2;
  npy_intp shape[] = {value.rows(), value.cols()};
  PyObject* const array = PyArray_SimpleNew(kDimensions, shape, NPY_DOUBLE);
  if (array == nullptr) return nullptr;
  auto* const numbers = reinterpret_cast<PyArrayObject*>(array);
  Eigen::Map<RowMajor>(static_cast<double*>(PyArray_DATA(numbers)), value.rows(), value.cols()) =
      value;
  return array;
}

}  // namespace trifinger::bindings

namespace nanobind::detail {

template <class M>
struct type_caster<trifinger::bindings::Array<M>> {
  NB_TYPE_CASTER(trifinger::bindings::Array<M>,
                 io_name("numpy.typing.ArrayLike", "numpy.typing.NDArray[numpy.float64]"))

  bool from_python(handle source, uint8_t, cleanup_list*) noexcept {
    return trifinger::bindings::read_array(source, value.value);
  }

  static handle from_cpp(const trifinger::bindings::Array<M>& array, rv_policy,
                         cleanup_list*) noexcept {
    return trifinger::bindings::write_array(array.value);
  }
};

}  // namespace nanobind::detail
