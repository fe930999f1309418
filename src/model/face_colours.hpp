// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <optional>
#include <string_view>

namespace trifinger::detail {

/// A colour that a box's face can have.
struct FaceColour {
  std::string_view name;
  std::array<float, 3> rgb;  ///< As it is drawn, 0 to 1.
};

/// In the order of the competition's cube, from which they were taken.
inline constexpr std::array<FaceColour, 6> kFaceColours{{{"red", {0.765F, 0.188F, 0.000F}},
                                                         {"green", {0.600F, 0.816F, 0.376F}},
                                                         {"blue", {0.016F, 0.137F, 0.376F}},
                                                         {"cyan", {0.455F, 0.784F, 0.749F}},
                                                         {"magenta", {0.643F, 0.357F, 0.643F}},
                                                         {"yellow", {1.000F, 0.922F, 0.424F}}}};

/// How a colour is drawn, by its name or as "#rrggbb". Nothing if the text is neither.
[[nodiscard]] std::optional<std::array<float, 3>> rgb_of(std::string_view colour);

}  // namespace trifinger::detail
