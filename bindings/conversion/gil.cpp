// SPDX-License-Identifier: BSD-3-Clause
#include "gil.hpp"

#include <nanobind/nanobind.h>
#include <pthread.h>
#include <unistd.h>

#include <atomic>
#include <thread>

namespace nb = nanobind;

namespace trifinger::bindings {
namespace {

// The thread that ends the interpreter; no thread before that.
std::atomic<std::thread::id> exiting_thread{};
// Number of threads that may be about to take the GIL.
std::atomic<int> takers{0};

// Announces for its lifetime that this thread takes the GIL, or never returns.
class Taking {
 public:
  Taking() noexcept {
    // seq_cst, both: either this thread sees the exit, or the exit sees this thread and lets it
    // through first.
    takers.fetch_add(1, std::memory_order_seq_cst);
    const std::thread::id exiting = exiting_thread.load(std::memory_order_seq_cst);
    if (exiting == std::thread::id{} || exiting == std::this_thread::get_id()) return;
    takers.fetch_sub(1, std::memory_order_seq_cst);
    while (true) ::pause();
  }
  Taking(const Taking&) = delete;
  Taking& operator=(const Taking&) = delete;
  ~Taking() { takers.fetch_sub(1, std::memory_order_seq_cst); }
};

}  // namespace

GilRelease::~GilRelease() {
  const Taking taking;
  PyEval_RestoreThread(state_);
}

GilHold::GilHold()
    : state_([] {
        const Taking taking;
        return PyGILState_Ensure();
      }()) {}

GilHold::~GilHold() { PyGILState_Release(state_); }

void check_signals() {
  const GilHold gil;
  if (PyErr_CheckSignals() != 0) throw nb::python_error();
}

void park_threads_at_exit() {
  // A forked child has one thread, and that one holds the GIL.
  pthread_atfork(nullptr, nullptr, [] { takers.store(0, std::memory_order_relaxed); });
  nb::module_::import_("atexit").attr("register")(nb::cpp_function([] {
    // Objects on the stacks of parked daemon threads are never released.
    const nb::object threads = nb::module_::import_("threading").attr("active_count")();
    if (nb::cast<int>(threads) > 1) nb::set_leak_warnings(false);
    exiting_thread.store(std::this_thread::get_id(), std::memory_order_seq_cst);
    nb::gil_scoped_release release;
    while (takers.load(std::memory_order_seq_cst) != 0) std::this_thread::yield();
  }));
}

}  // namespace trifinger::bindings
