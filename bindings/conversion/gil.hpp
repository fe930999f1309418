// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Python.h>

namespace trifinger::bindings {

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

/// Holds the GIL as long as it lives, whether this thread held it before or not. A thread that is
/// not Python's own waits here forever once the interpreter exits.
class GilHold {
 public:
  GilHold();
  GilHold(const GilHold&) = delete;
  GilHold& operator=(const GilHold&) = delete;
  ~GilHold();

 private:
  PyGILState_STATE state_;
};

/// Runs Python's signal handlers, with or without the GIL held. Throws what they raise, for example
/// for Ctrl-C.
void check_signals();

/// Makes daemon threads that return from a wait stay parked once the interpreter exits. Python
/// would end them by unwinding their stacks, and C++ would then call std::terminate.
void park_threads_at_exit();

}  // namespace trifinger::bindings
