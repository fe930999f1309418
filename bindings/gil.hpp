// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Python.h>

namespace trifinger::python {

/// Lets other Python threads run as long as it lives.
class GilRelease {
 public:
  GilRelease() noexcept : state_(PyEval_SaveThread()) {}
  GilRelease(const GilRelease&) = delete;
  GilRelease& operator=(const GilRelease&) = delete;
  ~GilRelease();

 private:
  PyThreadState* state_;
};

/// Runs Python's signal handlers, without or with the GIL held. Throws what they raise: Ctrl-C.
void check_signals();

/// From the interpreter's exit on, daemon threads that come back from a wait stay where they are.
/// Python would end them by unwinding their stacks, which C++ answers with std::terminate.
void park_threads_at_exit();

}  // namespace trifinger::python
