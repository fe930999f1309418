// SPDX-License-Identifier: BSD-3-Clause
#include "element.hpp"

#include <array>

#include "numpy.hpp"

namespace nb = nanobind;

namespace trifinger::python {
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
  if (value != nullptr && is_field(self, name)) return PyObject_SetItem(self, name, value);
  return PyObject_GenericSetAttr(self, name, value);
}

}  // namespace

void bind_element(nb::module_& m) {
  static const char doc[] =
      R"(One element of a series: a record of NumPy whose fields are attributes, too.

`y.position` and `y["position"]` are the same, `y.stamp.capture_time` is a field of a field.)";
  static std::array slots{
      PyType_Slot{Py_tp_doc, const_cast<char*>(doc)},
      PyType_Slot{Py_tp_getattro, reinterpret_cast<void*>(get_attribute)},
      PyType_Slot{Py_tp_setattro, reinterpret_cast<void*>(set_attribute)},
      PyType_Slot{0, nullptr},
  };
  static PyType_Spec spec{.name = "trifinger._trifinger.Element",
                          .basicsize = 0,  // as its base
                          .itemsize = 0,
                          .flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE,
                          .slots = slots.data()};
  PyObject* const type =
      PyType_FromSpecWithBases(&spec, reinterpret_cast<PyObject*>(&PyVoidArrType_Type));
  if (type == nullptr) throw nb::python_error();
  m.attr("Element") = nb::steal(type);
}

}  // namespace trifinger::python
