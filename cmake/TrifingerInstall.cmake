# SPDX-License-Identifier: BSD-3-Clause
# Installs what belongs to no single layer: the CMake package `trifinger` and MuJoCo. No installed file contains a
# folder of this machine, so the tree can be moved.
include(CMakePackageConfigHelpers)
set(package_folder lib/cmake/trifinger)

if(TRIFINGER_BUILD_ROBOT)
  install(IMPORTED_RUNTIME_ARTIFACTS MuJoCo::MuJoCo LIBRARY DESTINATION lib/trifinger
          PERMISSIONS OWNER_READ OWNER_WRITE GROUP_READ WORLD_READ COMPONENT library)
  get_filename_component(TRIFINGER_MUJOCO_FILE ${MuJoCo_LIBRARY} NAME)
  # MuJoCo's licence requires a copy of it with every copy of MuJoCo.
  file(GLOB licences ${MuJoCo_ROOT}/../mujoco_core-${MuJoCo_VERSION}.dist-info/licenses/*)
  install(FILES ${licences} DESTINATION share/trifinger/licences/mujoco COMPONENT library)
  # The layer `control` contains eiquadprog's templates. Their licence (LGPL) requires a copy of it, too.
  install(FILES ${Eiquadprog_LICENCES} DESTINATION share/trifinger/licences/eiquadprog COMPONENT library)
endif()

get_property(TRIFINGER_LAYERS GLOBAL PROPERTY TRIFINGER_LAYERS)
configure_file(cmake/trifingerConfig.cmake.in ${PROJECT_BINARY_DIR}/trifingerConfig.cmake @ONLY)
# A new minor version only adds: docs/stability.md.
write_basic_package_version_file(
  ${PROJECT_BINARY_DIR}/trifingerConfigVersion.cmake COMPATIBILITY SameMajorVersion)
install(
  FILES ${PROJECT_BINARY_DIR}/trifingerConfig.cmake ${PROJECT_BINARY_DIR}/trifingerConfigVersion.cmake
  DESTINATION ${package_folder}
  COMPONENT development)
install(EXPORT trifinger-targets NAMESPACE trifinger:: DESTINATION ${package_folder}
        COMPONENT development)
