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
            $<$<BOOL:${TRIFINGER_WARNINGS_AS_ERRORS}>:-Werror>)
  if(TRIFINGER_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${TRIFINGER_SANITIZE} ${trifinger_sanitizer_ignorelist}
                                             -fno-sanitize-recover=all -fno-omit-frame-pointer)
    target_link_options(${target} PRIVATE -fsanitize=${TRIFINGER_SANITIZE} ${trifinger_sanitizer_runtime})
  endif()
endfunction()

# trifinger_layer(NAME SOURCES a.cpp ... [PUBLIC lib ...] [PRIVATE lib ...])
#
# Defines the library trifinger_NAME with the alias trifinger::NAME. Installs it with its headers as the component NAME
# of the CMake package: cmake/TrifingerInstall.cmake.
function(trifinger_layer name)
  cmake_parse_arguments(PARSE_ARGV 1 layer "" "" "SOURCES;PUBLIC;PRIVATE")
  set(target trifinger_${name})
  add_library(${target} STATIC ${layer_SOURCES})
  add_library(trifinger::${name} ALIAS ${target})
  trifinger_target_options(${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON)
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_include_directories(
    ${target} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include> $<INSTALL_INTERFACE:include>)
  target_link_libraries(${target} PUBLIC ${layer_PUBLIC} PRIVATE ${layer_PRIVATE})
  install(TARGETS ${target} EXPORT trifinger-targets ARCHIVE DESTINATION lib/trifinger COMPONENT development)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/trifinger/${name} DESTINATION include/trifinger
          COMPONENT development)
  set_property(GLOBAL APPEND PROPERTY TRIFINGER_LAYERS ${name})
endfunction()

# trifinger_test(NAME SOURCES a_test.cpp ... LIBRARIES lib ... [WITHOUT_SANITIZER])
#
# Defines the test program NAME_test. Every suite has its own watchdog, so a hang fails and does not stall the others.
# `./run test` runs them under sanitizers. Programs marked WITHOUT_SANITIZER have tests that are skipped under a
# sanitizer, so the release build runs them, too.
function(trifinger_test name)
  cmake_parse_arguments(PARSE_ARGV 1 test "WITHOUT_SANITIZER" "" "SOURCES;LIBRARIES")
  set(target ${name}_test)
  add_executable(${target} ${test_SOURCES})
  trifinger_target_options(${target})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  target_link_libraries(${target} PRIVATE ${test_LIBRARIES} GTest::gmock GTest::gtest_main)
  set(label ${name})
  if(test_WITHOUT_SANITIZER)
    string(APPEND label _without_sanitizer)
    add_dependencies(tests_without_sanitizer ${target})
  endif()
  set(script ${CMAKE_CURRENT_BINARY_DIR}/${target}.cmake)
  file(GENERATE OUTPUT ${script} CONTENT
       "include([[${PROJECT_SOURCE_DIR}/cmake/TestSuites.cmake]])\nadd_test_suites([[$<TARGET_FILE:${target}>]] ${label})\n")
  set_property(DIRECTORY APPEND PROPERTY TEST_INCLUDE_FILES ${script})
endfunction()
