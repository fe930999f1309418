// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mujoco/mujoco.h>

#include <filesystem>

namespace trifinger::detail {

// Looks for the meshes of a file in `folder`, by the longest end of their paths that is there. So
// "package://arm/meshes/link.stl" may be arm/meshes/link.stl, meshes/link.stl or link.stl.
void find_meshes(mjSpec* spec, const std::filesystem::path& folder);

}  // namespace trifinger::detail
