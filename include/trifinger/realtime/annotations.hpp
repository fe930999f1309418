// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Marks a function of the loop, which must neither block nor allocate. Compilers that know the
// attribute check this.
#if defined(__has_cpp_attribute) && __has_cpp_attribute(clang::nonblocking)
#define TRIFINGER_REALTIME [[clang::nonblocking]]
#else
#define TRIFINGER_REALTIME
#endif
