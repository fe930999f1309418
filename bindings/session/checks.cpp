// SPDX-License-Identifier: BSD-3-Clause
#include "checks.hpp"

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>

#include "conversion/text.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/core/errors.hpp"

namespace nb = nanobind;

namespace trifinger::bindings {

namespace {

// Returns a text like "ValueError: too near".
std::string message_of(const nb::python_error& error) {
  auto text = nb::cast<std::string>(error.type().attr("__name__"));
  try {
    const std::string says = text_of(error.value());
    if (!says.empty()) text += ": " + says;
  } catch (const nb::python_error&) {  // its __str__ fails
    return text;
  }
  // `what()` would lose everything after a zero byte.
  std::ranges::replace(text, '\0', ' ');
  return text;
}

}  // namespace

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
    if (!error.matches(PyExc_Exception)) {
      // Ctrl-C or sys.exit() is meant for the thread, not for the check.
      interruption_->keep(std::move(error));
      throw Interrupted("a safety check was interrupted");
    }
    const std::string text = message_of(error);
    // The session keeps only a sentence. The traceback goes to the place of Python's tracebacks.
    error.restore();
    PyErr_WriteUnraisable(function_.ptr());
    throw Error(text);
  }
}

Interruption::~Interruption() {
  if (!error_) return;
  const nb::gil_scoped_acquire gil;
  error_.reset();
}

void Interruption::keep(nb::python_error&& error) {
  if (error_) return;
  error_.emplace(std::move(error));
  // relaxed: only the thread that stored its own id acts on it.
  thread_.store(std::this_thread::get_id(), std::memory_order_relaxed);
}

void Interruption::raise() {
  // relaxed: see keep.
  if (thread_.load(std::memory_order_relaxed) != std::this_thread::get_id()) return;
  const nb::gil_scoped_acquire gil;
  if (!error_) return;
  nb::python_error error = std::move(*error_);
  clear();
  throw nb::python_error(std::move(error));
}

int Interruption::traverse(visitproc visit, void* arg) const noexcept {
  if (error_) Py_VISIT(error_->value().ptr());
  return 0;
}

void Interruption::clear() noexcept {
  thread_.store({}, std::memory_order_relaxed);
  error_.reset();
}

std::shared_ptr<const Checks::Check> Checks::add(nb::object function,
                                                 const ElementDescription& observation,
                                                 const ElementDescription& action) {
  if (PyCallable_Check(function.ptr()) == 0) {
    throw InvalidArgument("a check is a function of an observation and an action");
  }
  // The last owner may be a wait of the front-end, which has released the GIL.
  const auto let_go = [](Check* check) {
    const nb::gil_scoped_acquire gil;
    delete check;
  };
  checks_.emplace_back(new Check(std::move(function), observation, action, interruption_), let_go);
  return checks_.back();
}

int Checks::traverse(visitproc visit, void* arg) const noexcept {
  for (const auto& check : checks_) Py_VISIT(check->function_.ptr());
  return interruption_->traverse(visit, arg);
}

void Checks::clear() noexcept {
  for (const auto& check : checks_) check->function_.reset();
  interruption_->clear();
}

}  // namespace trifinger::bindings
