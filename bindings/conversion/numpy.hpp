// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// NumPy's C interface is a table that module.cpp fills and all others share; the macros for that
// are in CMakeLists.txt.
#include <Python.h>
#include <numpy/arrayobject.h>
#include <numpy/arrayscalars.h>
