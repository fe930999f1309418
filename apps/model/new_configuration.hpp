// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "trifinger/model/model_file.hpp"

namespace trifinger::apps {

[[nodiscard]] inline bool is_urdf(const ModelFileOptions& options) {
  return options.path.extension() == ".urdf";
}

// For joints that can hardly move.
inline constexpr std::string_view kHowToTakeRadians =
    "if the file means radians, add angle: radian (--angle radian)";

// A configuration with which the robot of a file can be simulated at once. It will be in `folder`.
// FILL_IN stands in the place of a torque that nobody knows.
[[nodiscard]] std::string configuration_of(const std::string& name,
                                           const std::filesystem::path& folder,
                                           const ModelFile& model);

}  // namespace trifinger::apps
