// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// NumPy's C interface is a table that one file (module.cpp) fills and all others share.
#include <Python.h>
#define NPY_NO_DEPRECATED_API NPY_2_0_API_VERSION
#define PY_ARRAY_UNIQUE_SYMBOL trifinger_numpy_api
#ifndef TRIFINGER_IMPORTS_NUMPY
#define NO_IMPORT_ARRAY
#endif
#include <numpy/arrayobject.h>
#include <numpy/arrayscalars.h>
