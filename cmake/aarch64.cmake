# SPDX-License-Identifier: BSD-3-Clause
# Compiles for 64-bit ARM (Jetson, Raspberry Pi 5) on another machine, with Debian's cross compiler: tools/aarch64.py. The
# folder build/aarch64 has an arm64 Debian, of which libraries and headers are, and Python packages of such a machine.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)

cmake_path(SET _machine NORMALIZE ${CMAKE_CURRENT_LIST_DIR}/../build/aarch64)
set(CMAKE_SYSROOT ${_machine}/debian)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
# Packages of Python are outside of that Debian.
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE BOTH)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE BOTH)
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${CMAKE_SYSROOT})
set(ENV{PKG_CONFIG_LIBDIR} ${CMAKE_SYSROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${CMAKE_SYSROOT}/usr/share/pkgconfig)
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64 -L ${CMAKE_SYSROOT})

set(MuJoCo_ROOT ${_machine}/python/mujoco)
set(Eiquadprog_ROOT ${_machine}/python/cmeel.prefix)
# The interpreter is that of the machine that compiles; what it is asked for is that of the other one.
set(Python_INCLUDE_DIR ${CMAKE_SYSROOT}/usr/include/python3.11)
set(Python_NumPy_INCLUDE_DIR ${_machine}/python/numpy/_core/include)
set(Python_SOABI cpython-311-aarch64-linux-gnu)
