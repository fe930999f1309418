# SPDX-License-Identifier: BSD-3-Clause
# Finds MuJoCo in the Python package `mujoco-core`, which carries the headers and the shared library
# but no CMake package. Set Python_EXECUTABLE, or MuJoCo_ROOT to the folder that holds `include/`.
#
# Defines the imported target MuJoCo::MuJoCo and MuJoCo_LIBRARY, MuJoCo_VERSION.
if(NOT MuJoCo_ROOT)
  find_package(Python 3.11 REQUIRED COMPONENTS Interpreter)
  execute_process(
    COMMAND "${Python_EXECUTABLE}" -c
            "import importlib.util as u; print(u.find_spec('mujoco').submodule_search_locations[0])"
    OUTPUT_VARIABLE MuJoCo_ROOT
    OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()

find_path(MuJoCo_INCLUDE_DIR mujoco/mujoco.h HINTS "${MuJoCo_ROOT}/include" NO_DEFAULT_PATH)
# The wheel contains the library under its version only: there is no unversioned link to find.
file(GLOB _mujoco_libraries "${MuJoCo_ROOT}/libmujoco.so.*")
list(LENGTH _mujoco_libraries _mujoco_count)
if(_mujoco_count EQUAL 1)
  set(MuJoCo_LIBRARY "${_mujoco_libraries}")
  string(REGEX REPLACE ".*libmujoco\\.so\\." "" MuJoCo_VERSION "${MuJoCo_LIBRARY}")
endif()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(
  MuJoCo
  REQUIRED_VARS MuJoCo_LIBRARY MuJoCo_INCLUDE_DIR
  VERSION_VAR MuJoCo_VERSION
  REASON_FAILURE_MESSAGE "pip install mujoco-core==4.0.0")

if(MuJoCo_FOUND AND NOT TARGET MuJoCo::MuJoCo)
  add_library(MuJoCo::MuJoCo SHARED IMPORTED)
  set_target_properties(
    MuJoCo::MuJoCo PROPERTIES IMPORTED_LOCATION "${MuJoCo_LIBRARY}" INTERFACE_INCLUDE_DIRECTORIES
                                                                    "${MuJoCo_INCLUDE_DIR}")
endif()
