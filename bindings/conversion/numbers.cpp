// SPDX-License-Identifier: BSD-3-Clause
#include "numbers.hpp"

#include <algorithm>

#include "text.hpp"

namespace nb = nanobind;

namespace trifinger::bindings {
namespace {

PyArrayObject* checked(const nb::object& array) {
  if (!array.is_valid()) throw nb::python_error();
  return reinterpret_cast<PyArrayObject*>(array.ptr());
}

// "(n, 3)", as NumPy writes a shape.
std::string text_of_shape(Shape shape) {
  std::string text;
  for (const npy_intp length : shape) {
    text += (text.empty() ? "(" : ", ") + (length < 0 ? "n" : std::to_string(length));
  }
  return text + (shape.size() == 1 ? ",)" : ")");
}

}  // namespace

std::pair<nb::object, void*> new_array(Shape shape, int type) {
  nb::object array =
      nb::steal(PyArray_SimpleNew(static_cast<int>(shape.size()), std::data(shape), type));
  void* const memory = PyArray_DATA(checked(array));
  return {std::move(array), memory};
}

ShownArray copy_of(std::span<const double> numbers, Shape shape) {
  auto [array, memory] = new_array(shape, NPY_DOUBLE);
  std::ranges::copy(numbers, static_cast<double*>(memory));
  return array;
}

Doubles doubles_of(nb::handle object, Shape shape, const std::string& what) {
  nb::object array = nb::steal(PyArray_FROM_OTF(object.ptr(), NPY_DOUBLE, NPY_ARRAY_IN_ARRAY));
  PyArrayObject* const found = checked(array);
  const std::span lengths(PyArray_DIMS(found), static_cast<std::size_t>(PyArray_NDIM(found)));
  const auto fits = [](npy_intp length, npy_intp wanted) { return wanted < 0 || length == wanted; };
  if (!std::ranges::equal(lengths, shape, fits)) {
    throw InvalidArgument(what + " has shape " + text_of(array.attr("shape")) + ", must have " +
                          text_of_shape(shape));
  }
  const std::span numbers(static_cast<const double*>(PyArray_DATA(found)),
                          static_cast<std::size_t>(PyArray_SIZE(found)));
  return {std::move(array), numbers};
}

ShownArray view_of(std::span<double> numbers, Shape shape, nb::handle owner) {
  nb::object array = nb::steal(PyArray_SimpleNewFromData(
      static_cast<int>(shape.size()), std::data(shape), NPY_DOUBLE, numbers.data()));
  PyArrayObject* const made = checked(array);
  Py_INCREF(owner.ptr());  // the call takes one reference
  if (PyArray_SetBaseObject(made, owner.ptr()) != 0) throw nb::python_error();
  return array;
}

}  // namespace trifinger::bindings
