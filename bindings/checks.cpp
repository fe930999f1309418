// SPDX-License-Identifier: BSD-3-Clause
#include "checks.hpp"

#include <cstring>

#include "trifinger/base/error.hpp"

namespace nb = nanobind;

namespace trifinger::python {

void Checks::Check::call(const void* observation, void* action) const {
  const nb::gil_scoped_acquire gil;
  if (!function_.is_valid()) throw Error("a safety check was collected, and its robot with it");
  try {
    const auto [y, y_bytes] = observation_.new_element();
    std::memcpy(y_bytes, observation, observation_.size());
    const auto [changed, changed_bytes] = action_.new_element();
    std::memcpy(changed_bytes, action, action_.size());
    function_(y, changed);
    std::memcpy(action, changed_bytes, action_.size());
  } catch (nb::python_error& error) {
    // The chain turns whatever is thrown into a fault and has no place for a text: the traceback
    // goes where Python's go.
    error.restore();
    PyErr_WriteUnraisable(function_.ptr());
    throw Error("a safety check has thrown");
  }
}

std::shared_ptr<const Checks::Check> Checks::add(nb::object function,
                                                 const ElementDescription& observation,
                                                 const ElementDescription& action) {
  if (PyCallable_Check(function.ptr()) == 0) {
    throw InvalidArgument("a check is a function of an observation and an action");
  }
  // The last to let go may be a wait of the front-end, which has given the GIL back.
  const auto let_go = [](Check* check) {
    const nb::gil_scoped_acquire gil;
    delete check;
  };
  checks_.emplace_back(new Check(std::move(function), observation, action), let_go);
  return checks_.back();
}

int Checks::traverse(visitproc visit, void* arg) const noexcept {
  for (const auto& check : checks_) Py_VISIT(check->function_.ptr());
  return 0;
}

void Checks::clear() noexcept {
  for (const auto& check : checks_) check->function_.reset();
}

}  // namespace trifinger::python
