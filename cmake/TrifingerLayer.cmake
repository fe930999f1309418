# SPDX-License-Identifier: BSD-3-Clause
# A directory is a layer, and a layer is a target. The table in ARCHITECTURE.md says who may include whom.

set(TRIFINGER_SANITIZE "" CACHE STRING "Sanitizers of our own targets: '', 'address,undefined' or 'thread'")
option(TRIFINGER_WARNINGS_AS_ERRORS "Treat warnings in our own targets as errors" OFF)

# Python is not instrumented, so the runtime of AddressSanitizer must be a library that is loaded before Python. g++
# uses such a library by default, clang on request.
if(TRIFINGER_SANITIZE MATCHES "^address" AND CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  execute_process(COMMAND ${CMAKE_CXX_COMPILER} --print-runtime-dir OUTPUT_VARIABLE runtime_folder
                  OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
  set(trifinger_sanitizer_runtime -shared-libasan -Wl,-rpath,${runtime_folder})
endif()

if(TRIFINGER_SANITIZE MATCHES "undefined" AND CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  set(trifinger_sanitizer_ignorelist -fsanitize-ignorelist=${PROJECT_SOURCE_DIR}/cmake/sanitizer_ignorelist.txt)
endif()

# Sets the options of every target that we compile. They are private, so that users of the libraries keep theirs.
function(trifinger_target_options target)
  target_compile_options(
    ${target}
    PRIVATE -Wall
            -Wextra
            -Wpedantic
            -Wconversion
            -Wsign-conversion
            -Wshadow
            -Wnon-virtual-dtor
            -Wold-style-cast
            -Woverloaded-virtual
            -Wdouble-promotion
            # g++ 12 reports overlaps in std::string's operator+ that do not exist (GCC bug 105651).
            $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>
            # g++ 13 and 14 take the reference that a function returns for one to its temporary argument (GCC bug 110358).
            $<$<AND:$<CXX_COMPILER_ID:GNU>,$<VERSION_GREATER_EQUAL:${CMAKE_CXX_COMPILER_VERSION},13>>:-Wno-dangling-reference>
            # g++ takes files that are compiled together for headers, which should have no anonymous namespaces.
            $<$<AND:$<CXX_COMPILER_ID:GNU>,$<BOOL:${CMAKE_UNITY_BUILD}>>:-Wno-subobject-linkage>
            $<$<BOOL:${TRIFINGER_WARNINGS_AS_ERRORS}>:-Werror>)
  if(TRIFINGER_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${TRIFINGER_SANITIZE} ${trifinger_sanitizer_ignorelist}
                                             -fno-sanitize-recover=all -fno-omit-frame-pointer)
    target_link_options(${target} PRIVATE -fsanitize=${TRIFINGER_SANITIZE} ${trifinger_sanitizer_runtime})
  endif()
endfunction()

# Programs and tests spend their time in the libraries. To optimise these files themselves takes longer than it saves.
function(trifinger_optimise_less target)
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
endfunction()
function(trifinger_optimise_test target)
  trifinger_optimise_less(${target})
  if(TRIFINGER_SANITIZE)
    target_compile_options(${target} PRIVATE -O0)
  endif()
endfunction()

# With clang, headers that most files include are parsed once for all: a sixth of the time of a build. g++ 12 forgets that
# such headers are the system's, and warns about them. So files still include what they need.
set(trifinger_common_headers <algorithm> <array> <atomic> <chrono> <cmath> <cstdint> <cstring> <filesystem> <functional>
                             <limits> <memory> <optional> <span> <string> <string_view> <thread> <utility> <vector>)
if(TRIFINGER_BUILD_ROBOT)
  find_package(Eigen3 3.4 REQUIRED NO_MODULE)
  list(APPEND trifinger_common_headers <Eigen/Geometry>)
endif()

# trifinger_headers(KIND HEADERS <a> ... [LIBRARIES lib ...])
#
# Defines the headers of all targets of a kind, which have equal options of the compiler.
function(trifinger_headers kind)
  cmake_parse_arguments(PARSE_ARGV 1 headers "" "" "HEADERS;LIBRARIES")
  set(target trifinger_${kind}_headers)
  file(GENERATE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/${target}.cpp CONTENT "// Its headers are compiled with it.\n")
  add_library(${target} OBJECT EXCLUDE_FROM_ALL ${CMAKE_CURRENT_BINARY_DIR}/${target}.cpp)
  trifinger_target_options(${target})
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_link_libraries(${target} PRIVATE ${headers_LIBRARIES} $<TARGET_NAME_IF_EXISTS:Eigen3::Eigen>)
  target_precompile_headers(${target} PRIVATE ${headers_HEADERS})
endfunction()

# Makes a target use the headers of its kind, layer, program or test, if there are any. All of them must find Eigen, because
# ccache lets the preprocessor include the headers again.
function(trifinger_use_headers target kind)
  if(TARGET trifinger_${kind}_headers)
    target_precompile_headers(${target} REUSE_FROM trifinger_${kind}_headers)
    if(TARGET Eigen3::Eigen)
      target_include_directories(${target} SYSTEM PRIVATE $<TARGET_PROPERTY:Eigen3::Eigen,INTERFACE_INCLUDE_DIRECTORIES>)
    endif()
  endif()
endfunction()

if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  # ccache finds objects again after headers were precompiled anew, if these do not contain the time of their files.
  add_compile_options("SHELL:-Xclang -fno-pch-timestamp")
  trifinger_headers(layer HEADERS ${trifinger_common_headers})
  set_target_properties(trifinger_layer_headers PROPERTIES POSITION_INDEPENDENT_CODE ON)
  if(TRIFINGER_BUILD_ROBOT)
    find_package(CLI11 REQUIRED)
    find_package(fmt REQUIRED)
    trifinger_headers(program HEADERS ${trifinger_common_headers} <CLI/App.hpp> <fmt/core.h> LIBRARIES CLI11::CLI11 fmt::fmt)
    trifinger_optimise_less(trifinger_program_headers)
  endif()
  if(TRIFINGER_BUILD_TESTS)
    trifinger_headers(test HEADERS ${trifinger_common_headers} <fstream> <gmock/gmock.h> <gtest/gtest.h> LIBRARIES GTest::gmock)
    trifinger_optimise_test(trifinger_test_headers)
  endif()
endif()

# trifinger_layer(NAME SOURCES a.cpp ... [PUBLIC lib ...] [PRIVATE lib ...])
#
# Defines the library trifinger_NAME with the alias trifinger::NAME. Installs it with its headers as the component NAME
# of the CMake package: cmake/TrifingerInstall.cmake. The folder that has src/NAME also has include/trifinger/NAME.
function(trifinger_layer name)
  cmake_parse_arguments(PARSE_ARGV 1 layer "" "" "SOURCES;PUBLIC;PRIVATE")
  set(target trifinger_${name})
  add_library(${target} STATIC ${layer_SOURCES})
  add_library(trifinger::${name} ALIAS ${target})
  trifinger_target_options(${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON)
  target_compile_features(${target} PUBLIC cxx_std_20)
  cmake_path(SET root NORMALIZE ${CMAKE_CURRENT_SOURCE_DIR}/../..)
  cmake_path(GET root PARENT_PATH root)  # without a slash at its end
  target_include_directories(
    ${target} PUBLIC $<BUILD_INTERFACE:${root}/include> $<BUILD_INTERFACE:${root}/src> $<INSTALL_INTERFACE:include>)
  target_link_libraries(${target} PUBLIC ${layer_PUBLIC} PRIVATE ${layer_PRIVATE})
  trifinger_use_headers(${target} layer)
  install(TARGETS ${target} EXPORT trifinger-targets ARCHIVE DESTINATION lib/trifinger COMPONENT development)
  if(EXISTS ${root}/include/trifinger/${name})  # some layers have no public headers
    install(DIRECTORY ${root}/include/trifinger/${name} DESTINATION include/trifinger
            COMPONENT development)
  endif()
  set_property(GLOBAL APPEND PROPERTY TRIFINGER_LAYERS ${name})
endfunction()

# trifinger_test(NAME SOURCES a_test.cpp ... LIBRARIES lib ... [WITHOUT_SANITIZER] [OPTIMISED])
#
# Defines the test program NAME_test. Every suite has its own watchdog, so a hang fails and does not stall the others.
# `./run test` runs them under sanitizers. Programs marked WITHOUT_SANITIZER have tests that are skipped under a
# sanitizer, so the release build runs them, too. OPTIMISED is for tests that compute for long themselves.
function(trifinger_test name)
  cmake_parse_arguments(PARSE_ARGV 1 test "WITHOUT_SANITIZER;OPTIMISED" "" "SOURCES;LIBRARIES")
  set(target ${name}_test)
  add_executable(${target} ${test_SOURCES})
  trifinger_target_options(${target})
  if(NOT test_OPTIMISED)
    trifinger_optimise_test(${target})
    trifinger_use_headers(${target} test)
  endif()
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  target_link_libraries(${target} PRIVATE ${test_LIBRARIES} GTest::gmock GTest::gtest_main)
  set(label ${name})
  if(test_WITHOUT_SANITIZER)
    string(APPEND label _without_sanitizer)
    add_dependencies(tests_without_sanitizer ${target})
  endif()
  set(script ${CMAKE_CURRENT_BINARY_DIR}/${target}.cmake)
  file(GENERATE OUTPUT ${script} CONTENT
       "include([[${PROJECT_SOURCE_DIR}/cmake/TestSuites.cmake]])
add_test_suites(${label} ${CMAKE_CROSSCOMPILING_EMULATOR} [[$<TARGET_FILE:${target}>]])\n")
  set_property(DIRECTORY APPEND PROPERTY TEST_INCLUDE_FILES ${script})
endfunction()

# Defines the program NAME of NAME.cpp, with which libFuzzer feeds any bytes to a layer.
function(trifinger_fuzzer name layer)
  if(NOT TRIFINGER_BUILD_FUZZERS)
    return()
  endif()
  add_executable(${name} ${name}.cpp)
  trifinger_target_options(${name})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  target_link_libraries(${name} PRIVATE trifinger::${layer})
  target_link_options(${name} PRIVATE -fsanitize=fuzzer)
endfunction()
