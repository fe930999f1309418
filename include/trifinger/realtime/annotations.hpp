// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Marks a function of the loop: it neither blocks nor allocates. Compilers that know the attribute
// check it.
#if defined(__has_cpp_attribute) && __has_cpp_attribute(clang::nonblocking)
#define TRIFINGER_REALTIME [[clang::nonblocking]]
#else
#define TRIFINGER_REALTIME
#endif
