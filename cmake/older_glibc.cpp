// SPDX-License-Identifier: BSD-3-Clause
// Three functions whose newest versions would keep a wheel from running on glibc 2.34. The linker
// sends calls of NAME to __wrap_NAME: CMakeLists.txt.
#include <sys/mount.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <condition_variable>
#include <cstddef>
#include <mutex>

extern "C" {

// The newer version computes the same and leaves errno alone.
#ifdef __aarch64__
#define FIRST_GLIBC "GLIBC_2.17"  // the first for this kind of processor
#else
#define FIRST_GLIBC "GLIBC_2.2.5"
#endif
double older_hypot(double x, double y);
__asm__(".symver older_hypot, hypot@" FIRST_GLIBC);
double __wrap_hypot(double x, double y) { return older_hypot(x, y); }

// The newer version differs only in what happens when a thread is cancelled.
#define WAIT "_ZNSt18condition_variable4waitERSt11unique_lockISt5mutexE"
using Lock = std::unique_lock<std::mutex>;
void older_wait(std::condition_variable*, Lock&);
__asm__(".symver older_wait, " WAIT "@GLIBCXX_3.4.11");
void wrapped_wait(std::condition_variable*, Lock&) __asm__("__wrap_" WAIT);
void wrapped_wait(std::condition_variable* condition, Lock& lock) { older_wait(condition, lock); }

// Only glibc 2.36 and later have a function for this system call.
int __wrap_mount_setattr(int folder, const char* path, unsigned flags, mount_attr* attributes,
                         std::size_t size) {
  return static_cast<int>(syscall(SYS_mount_setattr, folder, path, flags, attributes, size));
}

}  // extern "C"
