# SPDX-License-Identifier: BSD-3-Clause
# A directory is a layer, and a layer is a target. The table in ARCHITECTURE.md says who may include whom.

set(TRIFINGER_SANITIZE "" CACHE STRING "Sanitizers of our own targets: '', 'address,undefined' or 'thread'")
option(TRIFINGER_WARNINGS_AS_ERRORS "Treat warnings in our own targets as errors" OFF)
option(TRIFINGER_JOIN_FILES "Compile the files of a target together: fast from nothing, slow after a change" OFF)
option(TRIFINGER_JOIN_PROGRAMS "Join those of all programs of a folder: for linters, there is nothing to link" OFF)
set(CMAKE_UNITY_BUILD_BATCH_SIZE 0)  # all files of a target

# Python is not instrumented, so the runtime of AddressSanitizer must be a library that is loaded before Python. g++
# uses such a library by default, clang on request.
if(TRIFINGER_SANITIZE MATCHES "^address" AND CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  execute_process(COMMAND ${CMAKE_CXX_COMPILER} --print-runtime-dir OUTPUT_VARIABLE runtime_folder
                  OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
  set(trifinger_sanitizer_runtime -shared-libasan -Wl,-rpath,${runtime_folder})
  # Selects instructions as without optimisation, which saves a tenth of the time.
  set(trifinger_sanitizer_code "SHELL:-mllvm -fast-isel")
  # Tests are larger than the code that they test, and less of their code runs repeatedly.
  set(trifinger_sanitizer_test_code -fno-inline-functions)
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
            # g++ takes the joined files for headers, which must not define types of their own.
            $<$<AND:$<CXX_COMPILER_ID:GNU>,$<BOOL:${TRIFINGER_JOIN_FILES}>>:-Wno-subobject-linkage>
            $<$<BOOL:${TRIFINGER_WARNINGS_AS_ERRORS}>:-Werror>)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${TRIFINGER_JOIN_FILES})
  if(TRIFINGER_JOIN_FILES AND TRIFINGER_JOIN_PROGRAMS)
    cmake_language(DEFER GET_CALL_IDS deferred)
    if(NOT trifinger_join_programs IN_LIST deferred)
      cmake_language(DEFER ID trifinger_join_programs CALL trifinger_join_programs)
    endif()
  endif()
  if(TRIFINGER_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${TRIFINGER_SANITIZE} ${trifinger_sanitizer_ignorelist}
                                             ${trifinger_sanitizer_code}
                                             -fno-sanitize-recover=all -fno-omit-frame-pointer)
    target_link_options(${target} PRIVATE -fsanitize=${TRIFINGER_SANITIZE} ${trifinger_sanitizer_runtime})
  endif()
endfunction()

# Joins all sources of the programs in a folder into one target, so that their headers are read once. Each `main`
# becomes a function with a name of its own that nobody calls. It may still end without a `return`, so two warnings are
# disabled; the usual builds have them.
function(trifinger_join_programs)
  get_property(targets DIRECTORY PROPERTY BUILDSYSTEM_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(type ${target} TYPE)
    if(NOT type MATCHES "^(EXECUTABLE|OBJECT_LIBRARY)$")
      continue()
    endif()
    set_target_properties(${target} PROPERTIES EXPORT_COMPILE_COMMANDS OFF)
    foreach(property SOURCES COMPILE_OPTIONS COMPILE_DEFINITIONS INCLUDE_DIRECTORIES LINK_LIBRARIES)
      get_target_property(values ${target} ${property})
      if(values)
        list(APPEND all_${property} ${values})
      endif()
    endforeach()
  endforeach()
  if(NOT all_SOURCES)
    return()
  endif()
  foreach(property SOURCES COMPILE_DEFINITIONS INCLUDE_DIRECTORIES LINK_LIBRARIES)
    list(REMOVE_DUPLICATES all_${property})
  endforeach()
  cmake_path(RELATIVE_PATH CMAKE_CURRENT_SOURCE_DIR BASE_DIRECTORY ${PROJECT_SOURCE_DIR} OUTPUT_VARIABLE folder)
  string(REPLACE / _ joined programs_of_${folder})
  add_library(${joined} OBJECT ${all_SOURCES})
  target_compile_options(${joined} PRIVATE ${all_COMPILE_OPTIONS} -Wno-unused-function -Wno-return-type)
  target_compile_definitions(${joined} PRIVATE ${all_COMPILE_DEFINITIONS} "main=static TRIFINGER_JOINED_MAIN")
  target_include_directories(${joined} PRIVATE ${all_INCLUDE_DIRECTORIES})
  target_link_libraries(${joined} PRIVATE ${all_LINK_LIBRARIES})
  set_target_properties(${joined} PROPERTIES UNITY_BUILD ON UNITY_BUILD_UNIQUE_ID TRIFINGER_JOINED_MAIN)
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
  target_compile_options(${target} PRIVATE ${trifinger_sanitizer_test_code})
  # Replacements of functions of the C and C++ libraries must not be visible to their callers.
  set(support ${test_SOURCES})
  list(FILTER support INCLUDE REGEX "^\\.\\./support/")
  set_source_files_properties(${support} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
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
