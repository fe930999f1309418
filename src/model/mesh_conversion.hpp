// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

namespace trifinger::detail {

// A mesh in a format that MuJoCo reads.
struct ConvertedMesh {
  std::string obj;  // Wavefront OBJ, in metres
  // Mean of the diffuse colours of its triangles, from 0 to 1; nothing if the file has none.
  std::optional<std::array<float, 4>> colour{};
};

// Converts a file of COLLADA (.dae), which many descriptions of ROS have their meshes in. All
// meshes of its scene become one, placed as the scene places them. Like RViz, it heeds <unit> and
// not <up_axis>. Throws InvalidArgument that names the file and the line.
// Source: Khronos, "COLLADA - Digital Asset Schema Release 1.4.1".
[[nodiscard]] ConvertedMesh convert_collada(std::string_view text, const std::string& source);

// True for an STL file that is a text. Some binary ones begin with "solid" too.
[[nodiscard]] bool is_text_stl(std::string_view bytes) noexcept;

// Converts such a text into a binary STL file. Throws Error if it has no triangle.
[[nodiscard]] std::string binary_stl_of(std::string_view text);

}  // namespace trifinger::detail
