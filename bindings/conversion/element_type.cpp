// SPDX-License-Identifier: BSD-3-Clause
#include "element_type.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "numpy.hpp"
#include "text.hpp"
#include "trifinger/base/error.hpp"

namespace nb = nanobind;

namespace trifinger::bindings {
namespace {

using Fields = std::span<const FieldDescription>;

nb::object number_dtype(const nb::object& numpy, const FieldDescription& field) {
  const std::string_view name = name_of(field.type);
  nb::object number = numpy.attr("dtype")(nb::str(name.data(), name.size()));
  if (field.shape.empty()) return number;
  nb::list shape;
  for (const std::size_t length : field.shape) shape.append(length);
  return nb::make_tuple(std::move(number), nb::tuple(shape));
}

// The dtype of `fields`, whose names share the first `prefix` characters. One of them is a `kind`.
nb::object record_dtype(const nb::object& numpy, Fields fields, std::size_t prefix,
                        const char* kind) {
  nb::list names;
  nb::list formats;
  nb::list offsets;
  const std::size_t start = fields.front().offset;
  std::size_t size = 0;
  for (std::size_t i = 0; i < fields.size();) {
    const std::string name = fields[i].name.substr(prefix);
    const std::size_t dot = name.find('.');
    std::size_t end = i + 1;
    if (dot == std::string::npos) {
      names.append(name.c_str());
      formats.append(number_dtype(numpy, fields[i]));
    } else {
      const std::string nested = fields[i].name.substr(0, prefix + dot + 1);
      while (end < fields.size() && fields[end].name.starts_with(nested)) ++end;
      names.append(name.substr(0, dot).c_str());
      formats.append(record_dtype(numpy, fields.subspan(i, end - i), nested.size(), "Element"));
    }
    offsets.append(fields[i].offset - start);
    const FieldDescription& last = fields[end - 1];
    size = last.offset - start + last.count() * size_of(last.type);
    i = end;
  }
  nb::dict layout;
  layout["names"] = names;
  layout["formats"] = formats;
  layout["offsets"] = offsets;
  layout["itemsize"] = size;
  const nb::object element = nb::module_::import_("trifinger._trifinger").attr(kind);
  return numpy.attr("dtype")(nb::make_tuple(element, layout));
}

// The types that were made last. Every session needs the types of its robot, and making them takes
// longer than everything else that Python does at its beginning.
struct KnownType {
  ElementDescription description;
  std::string kind;
  nb::object dtype;
};

nb::object dtype_of(const ElementDescription& description, const std::string& kind) {
  constexpr std::size_t kMaxKnown = 64;
  // Never destroyed: Python has ended before static objects are destroyed.
  static auto& known = *new std::vector<KnownType>();
  const auto is_it = [&](const KnownType& type) {
    return type.kind == kind && type.description == description;
  };
  const auto found = std::ranges::find_if(known, is_it);
  if (found != known.end()) return found->dtype;

  nb::object dtype =
      record_dtype(nb::module_::import_("numpy"), description.fields(), 0, kind.c_str());
  nb::dict units;
  for (const FieldDescription& field : description.fields()) {
    units[field.name.c_str()] = field.unit;
  }
  nb::module_::import_("trifinger.element_text").attr("learn")(dtype, units);
  if (known.size() == kMaxKnown) known.erase(known.begin());
  known.push_back({description, kind, dtype});
  return dtype;
}

PyArray_Descr* descr_of(const nb::object& dtype) {
  return reinterpret_cast<PyArray_Descr*>(dtype.ptr());
}

PyArrayObject* as_array(nb::handle object) {
  return reinterpret_cast<PyArrayObject*>(object.ptr());
}

std::string shape_of(nb::handle array) { return text_of(array.attr("shape")); }

nb::object new_numpy_array(const nb::object& dtype, std::span<npy_intp> shape) {
  PyArray_Descr* const descr = descr_of(dtype);
  dtype.inc_ref();  // the call takes one reference
  return nb::steal(PyArray_NewFromDescr(&PyArray_Type, descr, static_cast<int>(shape.size()),
                                        shape.data(), nullptr, nullptr, 0, nullptr));
}

std::byte* data_of(nb::handle array) {
  return static_cast<std::byte*>(PyArray_DATA(as_array(array)));
}

}  // namespace

ElementType::ElementType(const ElementDescription& description, const char* kind)
    : dtype_(dtype_of(description, kind)), size_(description.size()) {}

ElementType::New ElementType::new_element() const {
  const nb::object memory = new_numpy_array(dtype_, {});
  if (!memory.is_valid()) throw nb::python_error();
  std::byte* const data = data_of(memory);
  nb::object element = nb::steal(PyArray_Scalar(data, descr_of(dtype_), memory.ptr()));
  if (!element.is_valid()) throw nb::python_error();
  return {std::move(element), data};
}

ElementType::New ElementType::new_array(std::size_t count) const {
  auto length = static_cast<npy_intp>(count);
  nb::object array = new_numpy_array(dtype_, {&length, 1});
  if (!array.is_valid()) throw nb::python_error();
  std::byte* const data = data_of(array);
  return {std::move(array), data};
}

ElementType::New ElementType::new_scalar_array() const {
  nb::object array = new_numpy_array(dtype_, {});
  if (!array.is_valid()) throw nb::python_error();
  std::byte* const data = data_of(array);
  return {std::move(array), data};
}

nb::object ElementType::view(const std::byte* memory, const nb::object& owner) const {
  PyArray_Descr* const descr = descr_of(dtype_);
  dtype_.inc_ref();  // the call takes one reference
  // NumPy has no pointer to constants; without NPY_ARRAY_WRITEABLE it does not write.
  nb::object array = nb::steal(PyArray_NewFromDescr(&PyArray_Type, descr, 0, nullptr, nullptr,
                                                    const_cast<std::byte*>(memory), 0, nullptr));
  if (!array.is_valid()) throw nb::python_error();
  Py_INCREF(owner.ptr());  // the call takes one reference
  if (PyArray_SetBaseObject(as_array(array), owner.ptr()) != 0) throw nb::python_error();
  return array;
}

bool ElementType::is_same(const void* descr) const {
  const auto* const found = static_cast<const PyArray_Descr*>(descr);
  return found == descr_of(dtype_) ||
         PyArray_EquivTypes(const_cast<PyArray_Descr*>(found), descr_of(dtype_)) != 0;
}

std::string ElementType::expected() const {
  return "; expected is dtype " + text_of(dtype_.attr("descr"));
}

const std::byte* ElementType::bytes_of(nb::handle element) const {
  if (PyArray_IsScalar(element.ptr(), Void)) {
    const auto* const record = reinterpret_cast<const PyVoidScalarObject*>(element.ptr());
    if (is_same(record->descr)) return reinterpret_cast<const std::byte*>(record->obval);
    throw InvalidArgument("this element has dtype " + text_of(element.attr("dtype").attr("descr")) +
                          expected());
  }
  if (PyArray_Check(element.ptr())) {
    PyArrayObject* const array = as_array(element);
    if (!is_same(PyArray_DESCR(array))) {
      throw InvalidArgument("this array has dtype " + text_of(element.attr("dtype")) + expected());
    }
    if (PyArray_NDIM(array) == 0) return data_of(element);
    throw InvalidArgument("this array has shape " + shape_of(element) +
                          "; expected is one element");
  }
  throw InvalidArgument("this is " + text_of(nb::repr(element)) + " of type " +
                        nb::type_name(element.type()).c_str() + expected());
}

ElementType::Elements ElementType::contiguous(nb::handle elements) const {
  if (!PyArray_Check(elements.ptr())) {
    throw InvalidArgument(std::string("this is of type ") + nb::type_name(elements.type()).c_str() +
                          "; expected is a one-dimensional array" + expected());
  }
  PyArrayObject* const array = as_array(elements);
  if (!is_same(PyArray_DESCR(array))) {
    throw InvalidArgument("this array has dtype " + text_of(elements.attr("dtype")) + expected());
  }
  if (PyArray_NDIM(array) != 1) {
    throw InvalidArgument("this array has shape " + shape_of(elements) +
                          "; expected is one dimension: (number of elements,)");
  }
  nb::object copy = nb::steal(PyArray_FROM_OF(elements.ptr(), NPY_ARRAY_C_CONTIGUOUS));
  if (!copy.is_valid()) throw nb::python_error();
  const std::byte* const bytes = data_of(copy);
  return {std::move(copy), bytes, static_cast<std::size_t>(PyArray_DIM(array, 0))};
}

namespace {

template <class Float>
Float number_at(const std::byte* memory, std::size_t i) {
  Float number;
  std::memcpy(&number, memory + i * sizeof(Float), sizeof(Float));
  return number;
}

}  // namespace

NanCheck::NanCheck(const ElementDescription& description,
                   std::span<const std::byte> default_action) {
  for (const FieldDescription& field : description.fields()) {
    if (field.type != ScalarType::kFloat32 && field.type != ScalarType::kFloat64) continue;
    const bool is_double = field.type == ScalarType::kFloat64;
    bool goes_on = false;
    for (std::size_t i = 0; i < field.count(); ++i) {
      const Run run{field.name, i, field.offset + i * size_of(field.type), 1, is_double};
      if (run.has_nan(default_action.data())) {
        goes_on = false;
      } else if (goes_on) {
        ++runs_.back().count;
      } else {
        runs_.push_back(run);
        goes_on = true;
      }
    }
  }
}

bool NanCheck::Run::is_nan(const std::byte* action, std::size_t i) const {
  return is_double ? std::isnan(number_at<double>(action + offset, i))
                   : std::isnan(number_at<float>(action + offset, i));
}

bool NanCheck::Run::has_nan(const std::byte* action) const {
  for (std::size_t i = 0; i < count; ++i) {
    if (is_nan(action, i)) return true;
  }
  return false;
}

void NanCheck::throw_nan(const Run& run, const std::byte* action) {
  std::size_t i = 0;
  while (!run.is_nan(action, i)) ++i;
  throw InvalidArgument("number " + std::to_string(run.first + i) + " of field '" + run.field +
                        "' is NaN; allowed are numbers");
}

}  // namespace trifinger::bindings
