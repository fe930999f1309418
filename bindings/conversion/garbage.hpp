// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

namespace trifinger::bindings {

/// Slots of a type whose objects may be part of a cycle of references. `T` has the functions
/// `traverse`, which visits the Python objects that it owns, and `clear`, which releases them.
template <class T>
PyType_Slot* garbage_collected() {
  static PyType_Slot slots[] = {
      {Py_tp_traverse, reinterpret_cast<void*>(+[](PyObject* self, visitproc visit, void* arg) {
         Py_VISIT(Py_TYPE(self));
         // Skips an object that is being made or destroyed.
         if (!nanobind::inst_ready(self)) return 0;
         return nanobind::inst_ptr<T>(self)->traverse(visit, arg);
       })},
      {Py_tp_clear, reinterpret_cast<void*>(+[](PyObject* self) {
         nanobind::inst_ptr<T>(self)->clear();
         return 0;
       })},
      {0, nullptr},
  };
  return slots;
}

}  // namespace trifinger::bindings
