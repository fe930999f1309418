// SPDX-License-Identifier: BSD-3-Clause
#include "element.hpp"

#include <string>
#include <vector>

#include "numpy.hpp"
#include "text.hpp"

namespace nb = nanobind;

namespace trifinger::bindings {

std::string wrong_shape(const nb::object& name, const nb::object& dtype, const nb::object& value) {
  const std::string field = "field '" + text_of(name) + "' ";
  const nb::object expected = dtype.attr("shape");
  const auto are = [](const nb::object& shape) {
    if (nb::len(shape) == 1) return text_of(shape[nb::int_(0)]) + " numbers";
    return nb::len(shape) == 0 ? "one number" : "numbers of the shape " + text_of(shape);
  };
  try {
    const nb::object found = nb::module_::import_("numpy").attr("shape")(value);
    if (nb::len(found) == 0 || found.equal(expected)) return {};
    return field + "has " + are(expected) + "; given are " + are(found);
  } catch (const nb::python_error& error) {
    if (!error.matches(PyExc_ValueError)) throw;
    return field + "has " + are(expected) + "; given are lists of several lengths";
  }
}

namespace {

bool is_field(PyObject* self, PyObject* name) {
  const auto* const descr = reinterpret_cast<const PyVoidScalarObject*>(self)->descr;
  PyObject* const fields = PyDataType_FIELDS(reinterpret_cast<const PyArray_Descr*>(descr));
  return fields != nullptr && fields != Py_None && PyDict_Contains(fields, name) == 1;
}

PyObject* get_attribute(PyObject* self, PyObject* name) {
  return is_field(self, name) ? PyObject_GetItem(self, name) : PyObject_GenericGetAttr(self, name);
}

int set_attribute(PyObject* self, PyObject* name, PyObject* value) {
  if (value == nullptr || !is_field(self, name)) return PyObject_GenericSetAttr(self, name, value);
  const int result = PyObject_SetItem(self, name, value);
  if (result == 0 || PyErr_ExceptionMatches(PyExc_ValueError) == 0) return result;
  try {
    const nb::python_error error;  // takes NumPy's
    const nb::object dtype = nb::borrow(self).attr("dtype")[nb::borrow(name)];
    const std::string wrong = wrong_shape(nb::borrow(name), dtype, nb::borrow(value));
    const nb::object type = wrong.empty()
                                ? nb::borrow(error.type())
                                : nb::module_::import_("trifinger.errors").attr("InvalidArgument");
    const std::string text = wrong.empty() ? text_of(error.value()) : wrong;
    PyErr_SetObject(type.ptr(), to_message(text).ptr());
  } catch (nb::python_error& error) {
    error.restore();
  }
  return -1;
}

// An element can always be printed, even if this fails, for example while the interpreter ends.
PyObject* print_element(PyObject* self) {
  const nb::object module = nb::steal(PyImport_ImportModule("trifinger.element_text"));
  if (module.is_valid()) {
    PyObject* const text = PyObject_CallMethod(module.ptr(), "text_of", "O", self);
    if (text != nullptr) return text;
  }
  // Ctrl-C is not swallowed.
  if (PyErr_ExceptionMatches(PyExc_Exception) == 0) return nullptr;
  PyErr_Clear();
  return PyUnicode_FromString("<Element>");
}

}  // namespace

namespace {

// Makes a class without memory of its own: instances are as large as their base, and have no
// __dict__.
void make_class(nb::module_& m, const std::string& name, const char* doc, PyObject* base,
                std::vector<PyType_Slot> slots) {
  const std::string full_name = "trifinger._trifinger." + name;
  slots.push_back({Py_tp_doc, const_cast<char*>(doc)});
  slots.push_back({0, nullptr});
  PyType_Spec spec{.name = full_name.c_str(),
                   .basicsize = 0,
                   .itemsize = 0,
                   .flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE,
                   .slots = slots.data()};
  PyObject* const type = PyType_FromSpecWithBases(&spec, base);
  if (type == nullptr) throw nb::python_error();
  m.attr(name.c_str()) = nb::steal(type);
}

}  // namespace

void bind_element(nb::module_& m) {
  make_class(m, "Element",
             R"(One element of a series: a record of NumPy whose fields are attributes, too.

`y.position` and `y["position"]` are the same, `y.stamp.capture_time` is a field of a field.)",
             reinterpret_cast<PyObject*>(&PyVoidArrType_Type),
             {{Py_tp_repr, reinterpret_cast<void*>(print_element)},
              {Py_tp_str, reinterpret_cast<void*>(print_element)},
              {Py_tp_getattro, reinterpret_cast<void*>(get_attribute)},
              {Py_tp_setattro, reinterpret_cast<void*>(set_attribute)}});
  const nb::object element = m.attr("Element");
  make_class(m, "Action", "The action that a user requests for a step.", element.ptr(), {});
  make_class(m, "AppliedAction", "The action that a robot has applied in a step.", element.ptr(),
             {});
  make_class(m, "Observation", "The measurements of a robot or a companion.", element.ptr(), {});
  make_class(m, "StatusElement", "The status that the back-end has written for a step.",
             element.ptr(), {});
}

const char* class_of(Series series) noexcept {
  switch (series) {
    case Series::kDesiredAction:
      return "Action";
    case Series::kAppliedAction:
      return "AppliedAction";
    case Series::kObservation:
    case Series::kHolding:
    case Series::kStopping:
      return "Observation";
    case Series::kStatus:
      return "StatusElement";
  }
  return "Element";
}

}  // namespace trifinger::bindings
