// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mutex>

namespace trifinger::ipc {

/// A mutex of data that a forked child may go on using. fork() waits until no other thread has it
/// locked, so the child finds it free and the data whole. Whoever has locked one must neither fork
/// nor make, lock or destroy another one.
class ForkableMutex {
 public:
  ForkableMutex();
  ~ForkableMutex();

  void lock() { mutex_.lock(); }
  void unlock() { mutex_.unlock(); }

 private:
  std::mutex mutex_;
};

}  // namespace trifinger::ipc
