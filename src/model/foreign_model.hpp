// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mujoco/mujoco.h>

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "spec.hpp"
#include "urdf.hpp"

namespace trifinger::detail {

// A model of somebody else, judged before MuJoCo sees it: MuJoCo itself obeys any number and opens
// any path (docs/decisions/untrusted_models.md says why it is done here).
//
// MuJoCo reads a text that was written here, so there is nothing in it that only one of the two
// readers understands. It asks this object for files; others do not exist for it.
class ForeignModel {
 public:
  // Reads the file and what it includes. Meshes are looked for in `mesh_folder`, if there is one,
  // by the longest end of their paths that is there. `repairs` is for `prepare_urdf`. `radians` is
  // the unit of angles in an MJCF that names none. Throws InvalidArgument that names the file, the
  // line and the largest value allowed.
  ForeignModel(const std::filesystem::path& file,
               const std::optional<std::filesystem::path>& mesh_folder, bool repairs, bool radians);
  ~ForeignModel();

  // Throws InvalidArgument with MuJoCo's own words.
  [[nodiscard]] Spec parse() const;
  // What `mj_compile` needs.
  [[nodiscard]] const mjVFS* files() const noexcept;
  // MuJoCo's error, with the names of files as they are, and why one of them cannot be read.
  [[nodiscard]] std::string explained(const std::string& problem) const;
  // True if a file that the model needs is not there.
  [[nodiscard]] bool is_missing_file() const;
  [[nodiscard]] bool is_urdf() const noexcept;
  // What a URDF says of this joint and MuJoCo does not read.
  [[nodiscard]] UrdfJoint urdf_joint(const std::string& name) const;
  // The colour that stands in the file of a mesh, by the name of this file in the spec.
  [[nodiscard]] std::optional<std::array<float, 4>> colour_of(const std::string& mesh_file) const;

 private:
  class Files;
  std::unique_ptr<Files> files_;
};

}  // namespace trifinger::detail
