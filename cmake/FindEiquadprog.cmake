# SPDX-License-Identifier: BSD-3-Clause
# Finds the headers of the Python package `eiquadprog`. Only its templates are used, so nothing is linked. Set
# Python_EXECUTABLE, or Eiquadprog_ROOT to the folder that holds `include/`.
#
# Defines the imported target Eiquadprog::Eiquadprog and Eiquadprog_VERSION, Eiquadprog_LICENCES.
if(NOT Eiquadprog_ROOT)
  find_package(Python 3.11 REQUIRED COMPONENTS Interpreter)
  execute_process(
    COMMAND "${Python_EXECUTABLE}" -m cmeel cmake
    OUTPUT_VARIABLE Eiquadprog_ROOT
    OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()

find_path(Eiquadprog_INCLUDE_DIR eiquadprog/eiquadprog-rt.hpp HINTS "${Eiquadprog_ROOT}/include" NO_DEFAULT_PATH)
if(Eiquadprog_INCLUDE_DIR)
  file(STRINGS "${Eiquadprog_INCLUDE_DIR}/eiquadprog/config.hpp" _version
       REGEX "define EIQUADPROG_VERSION \"")
  string(REGEX REPLACE ".*\"([0-9.]+)\".*" "\\1" Eiquadprog_VERSION "${_version}")
  file(GLOB Eiquadprog_LICENCES
       "${Eiquadprog_ROOT}/../eiquadprog-${Eiquadprog_VERSION}.dist-info/licenses/*")
endif()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(
  Eiquadprog
  REQUIRED_VARS Eiquadprog_INCLUDE_DIR
  VERSION_VAR Eiquadprog_VERSION
  REASON_FAILURE_MESSAGE "pip install eiquadprog==1.3.2")

if(Eiquadprog_FOUND AND NOT TARGET Eiquadprog::Eiquadprog)
  add_library(Eiquadprog::Eiquadprog INTERFACE IMPORTED)
  target_include_directories(Eiquadprog::Eiquadprog SYSTEM INTERFACE "${Eiquadprog_INCLUDE_DIR}")
endif()
