# SPDX-License-Identifier: BSD-3-Clause
# ctest runs this before the tests. One process runs all tests of a suite: with a sanitizer, most tests take less time
# than starting a process.

# add_test_suites(LABEL [EMULATOR ...] PROGRAM): defines a test NAME.SUITE for each suite of the test program NAME_test,
# with its own watchdog. A program for another machine runs in an emulator, which takes longer. If the environment variable
# TRIFINGER_TEST_RESULTS names a folder, each test leaves NAME.SUITE.xml there.
function(add_test_suites label)
  set(command ${ARGN})
  list(GET command -1 program)
  if(program STREQUAL command)
    set(watchdog 300)
  else()
    set(watchdog 3000)
  endif()
  cmake_path(GET program FILENAME name)
  string(REGEX REPLACE "_test$" "" name "${name}")
  if(NOT EXISTS "${program}")
    add_test(${name}_NOT_BUILT ${name}_NOT_BUILT)
    return()
  endif()
  execute_process(COMMAND ${command} --gtest_list_tests OUTPUT_VARIABLE lines TIMEOUT 30
                  COMMAND_ERROR_IS_FATAL ANY)
  # Suites look like "Ring." or "Ring/0.  # TypeParam = ..."; the names of tests begin with blanks.
  string(REGEX MATCHALL "\n[^ \n]+\\.( [^\n]*)?" suites "\n${lines}")
  foreach(suite IN LISTS suites)
    string(REGEX REPLACE "^\n([^ ]+)\\..*" "\\1" suite "${suite}")
    set(test ${name}.${suite})
    add_test(${test} ${command} "--gtest_filter=${suite}.*")
    set_tests_properties(${test} PROPERTIES TIMEOUT ${watchdog} LABELS ${label})
    if(DEFINED ENV{TRIFINGER_TEST_RESULTS})
      string(REPLACE / - file "${test}.xml")
      set_tests_properties(${test} PROPERTIES ENVIRONMENT "GTEST_OUTPUT=xml:$ENV{TRIFINGER_TEST_RESULTS}/${file}")
    endif()
  endforeach()
endfunction()
