# SPDX-License-Identifier: BSD-3-Clause
# The commands of `trifinger` that are programs of their own: `trifinger view` is the program trifinger-view. --help
# lists them without starting one, and says of those that are missing how to get them.

# trifinger_program_options(TARGET ...): sets the options of programs and of what they share
function(trifinger_program_options)
  foreach(target IN LISTS ARGV)
    trifinger_target_options(${target})
    target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/apps)
    trifinger_optimise_less(${target})
    trifinger_use_headers(${target} program)
    get_target_property(type ${target} TYPE)
    if(type STREQUAL EXECUTABLE)
      target_link_libraries(${target} PRIVATE $<TARGET_NAME_IF_EXISTS:trifinger_older_glibc>)
      set_target_properties(${target} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/apps)
      install(TARGETS ${target} RUNTIME DESTINATION bin COMPONENT program)
    endif()
  endforeach()
endfunction()

# trifinger_command(TARGET HELP): the program trifinger-COMMAND, of which --help says HELP
function(trifinger_command target help)
  string(REGEX REPLACE "^trifinger_" "" command ${target})
  string(REPLACE "_" "-" command ${command})
  set_target_properties(${target} PROPERTIES OUTPUT_NAME trifinger-${command})
  set_property(GLOBAL APPEND_STRING PROPERTY TRIFINGER_COMMANDS "{\"${command}\", \"${help}\", \"\", \"\"},\n")
endfunction()

# trifinger_write_commands(FILE): writes a row of C++ for each command above, and for each script trifinger-COMMAND in
# the pyproject.toml of the project and of its packages. The comment of a script is its HELP.
function(trifinger_write_commands file)
  get_property(rows GLOBAL PROPERTY TRIFINGER_COMMANDS)
  file(GLOB projects CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/packages/*/pyproject.toml)
  foreach(path IN ITEMS ${PROJECT_SOURCE_DIR}/pyproject.toml LISTS projects)
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${path})
    file(STRINGS ${path} name REGEX "^name = ")
    string(REGEX REPLACE ".*\"(.*)\"" "\\1" name ${name})
    cmake_path(GET path PARENT_PATH folder)
    string(REPLACE ${PROJECT_SOURCE_DIR} . folder ${folder})
    file(STRINGS ${path} scripts REGEX "^trifinger-[a-z-]+ = \".*\"  # [A-Z]")  # in small letters: part of a command
    foreach(script IN LISTS scripts)
      string(REGEX REPLACE "^trifinger-([a-z-]+) = \".*\"  # (.*)" "{\"\\1\", \"\\2\", \"${name}\", \"${folder}\"},\n" row ${script})
      string(APPEND rows ${row})
    endforeach()
  endforeach()
  file(CONFIGURE OUTPUT ${file} CONTENT "${rows}" @ONLY)
endfunction()
