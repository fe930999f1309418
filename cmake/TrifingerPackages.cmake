# SPDX-License-Identifier: BSD-3-Clause
# Makes the packages of Debian with CPack: `./run release`. docs/decisions/debian_packages.md says what is where.
set(CPACK_GENERATOR DEB)
# No address has been published yet: this domain is for examples (RFC 2606).
set(CPACK_PACKAGE_CONTACT "The TriFinger developers <maintainers@trifinger.example>")
set(CPACK_SET_DESTDIR ON)  # the limits of real-time users are outside the prefix
set(CPACK_STRIP_FILES ON)
set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON)  # package what has been built
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE
                                                WORLD_READ WORLD_EXECUTE)

set(CPACK_COMPONENTS_ALL library development program)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SOURCE trifinger)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
get_filename_component(mujoco_folder ${MuJoCo_LIBRARY} DIRECTORY)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${mujoco_folder})
set(same_version "libtrifinger (= ${PROJECT_VERSION})")

set(CPACK_DEBIAN_LIBRARY_PACKAGE_NAME libtrifinger)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SECTION libs)
# CPack would register the library of MuJoCo with the system's linker, but it is for these packages alone.
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SHLIBDEPS OFF)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_DEPENDS "libc6 (>= 2.28)")  # as the wheel of MuJoCo
set(CPACK_COMPONENT_LIBRARY_DESCRIPTION
    "robots as time series: files that programs need
TriFinger controls the TriFinger, a robot with three fingers, and other robots
at 1 kHz. This package has what its programs and yours need when they run:
MuJoCo, which simulates, and configurations of robots.")

set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libtrifinger-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SHLIBDEPS OFF)
# What the layers need to be linked: docs/installing.md.
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
    "${same_version}, libdeflate-dev, libeigen3-dev, liblz4-dev, libyaml-cpp-dev, libzstd-dev, pkgconf")
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION
    "robots as time series: headers and libraries
TriFinger controls the TriFinger, a robot with three fingers, and other robots
at 1 kHz. This package has headers, static libraries and the CMake package
trifinger.")

set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME trifinger)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_DEPENDS "${same_version}, adduser")
# Pictures, and images in logs; both are looked for when they are needed.
set(CPACK_DEBIAN_PROGRAM_PACKAGE_RECOMMENDS "libegl1, libgl1-mesa-dri, libopengl0, libturbojpeg0")
if(CPACK_DEBIAN_PACKAGE_ARCHITECTURE)
  set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS "linux-image-rt-${CPACK_DEBIAN_PACKAGE_ARCHITECTURE}")
else()
  set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS "linux-image-rt-amd64")
endif()
set(CPACK_DEBIAN_PROGRAM_PACKAGE_CONTROL_EXTRA
    ${PROJECT_SOURCE_DIR}/system/debian/postinst ${PROJECT_SOURCE_DIR}/system/debian/prerm
    ${PROJECT_SOURCE_DIR}/system/debian/conffiles)
set(CPACK_COMPONENT_PROGRAM_DESCRIPTION
    "robots as time series: programs and services
TriFinger controls the TriFinger, a robot with three fingers, and other robots
at 1 kHz. This package has the programs, services that run robots, and rights
for real time: the members of the group realtime may use its priorities.")

# Files that every package of Debian has.
string(TIMESTAMP changelog_date "%a, %d %b %Y %H:%M:%S +0000" UTC)  # SOURCE_DATE_EPOCH
configure_file(system/debian/changelog.in debian/changelog @ONLY)
function(install_compressed source name folder component)
  execute_process(COMMAND gzip --best --no-name --stdout ${source} OUTPUT_FILE ${PROJECT_BINARY_DIR}/debian/${name}.gz
                  COMMAND_ERROR_IS_FATAL ANY)
  install(FILES ${PROJECT_BINARY_DIR}/debian/${name}.gz DESTINATION ${folder} COMPONENT ${component})
endfunction()
foreach(component library development program)
  string(TOUPPER ${component} upper)
  set(package ${CPACK_DEBIAN_${upper}_PACKAGE_NAME})
  set(documents share/doc/${package})
  install(FILES system/debian/copyright DESTINATION ${documents} COMPONENT ${component})
  install_compressed(${PROJECT_BINARY_DIR}/debian/changelog changelog ${documents} ${component})
  if(EXISTS ${PROJECT_SOURCE_DIR}/system/debian/${package}.overrides)
    install(FILES system/debian/${package}.overrides DESTINATION share/lintian/overrides RENAME ${package}
            COMPONENT ${component})
  endif()
endforeach()
install_compressed(${PROJECT_SOURCE_DIR}/CHANGELOG.md CHANGELOG.md share/doc/trifinger program)
# What the programs of the release build say about themselves: those made here may be for another machine.
find_package(Python 3.11 REQUIRED COMPONENTS Interpreter)
add_custom_target(
  manual_pages COMMAND ${Python_EXECUTABLE} ${PROJECT_SOURCE_DIR}/tools/manual_pages.py ${PROJECT_BINARY_DIR}/debian/man1
  VERBATIM)
install(DIRECTORY ${PROJECT_BINARY_DIR}/debian/man1 DESTINATION share/man COMPONENT program)

# What is inside the packages: CPack runs this when all files are in their folders.
file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/debian/bills.cmake @ONLY CONTENT [[
foreach(each "library libtrifinger none" "development libtrifinger-dev src/,packages/" "program trifinger src/,apps/,packages/")
  separate_arguments(each)
  list(POP_FRONT each component package objects)
  execute_process(
    COMMAND @Python_EXECUTABLE@ @PROJECT_SOURCE_DIR@/tools/bill_of_materials.py ${package}
            ${CPACK_TEMPORARY_INSTALL_DIRECTORY}/${component} @PROJECT_BINARY_DIR@ ${objects}
    COMMAND_ERROR_IS_FATAL ANY)
endforeach()
]])
set(CPACK_PRE_BUILD_SCRIPTS ${PROJECT_BINARY_DIR}/debian/bills.cmake)

# Where udev and PAM find them by themselves.
install(FILES system/99-trifinger.rules DESTINATION lib/udev/rules.d COMPONENT program)
install(FILES system/99-trifinger.conf DESTINATION /etc/security/limits.d COMPONENT program)

add_custom_target(packaged)
foreach(layer IN LISTS TRIFINGER_LAYERS)
  add_dependencies(packaged trifinger_${layer})
endforeach()
add_dependencies(packaged trifinger_program trifinger_manipulate trifinger_run_policy trifinger_endurance trifinger_job
                 manual_pages)

include(CPack)
