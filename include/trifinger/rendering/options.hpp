// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "trifinger/base/random.hpp"
#include "trifinger/camera/camera.hpp"
#include "trifinger/camera/rendering_options.hpp"

namespace trifinger::rendering {

using camera::RenderingField;
using camera::RenderingOptions;

/// How much one episode differs from the next, in the images of the cameras. The defaults are wide:
/// a tracker that does not notice them is expected to work on a real robot.
struct RenderingVariation {
  double lamp_angle{0.5};      ///< Standard deviation of the lamp's direction, in two axes [rad].
  double power{0.3};           ///< Lamp and ambient power differ by up to this share.
  double light_colour{0.1};    ///< Each colour of the light differs by up to this share.
  double gain{0.2};            ///< The gain differs by up to this share.
  double colour_spread{0.08};  ///< Sets `colour_spread`.
  double gloss{2};             ///< The gloss is between 0 and this factor.
  double dust{0.5};            ///< The dust is between 0 and this.
  double vignetting{0.2};      ///< The vignetting is between 0 and this.
  double noise{3};             ///< Both noises are multiplied by up to this factor.
  double calibration_error{0.5};  ///< Sets `calibration_error` [pixel].

  /// Draws the options of an episode. Those that are not named above are those of `nominal`, except
  /// both seeds. Numbers stay in the ranges of `RenderingOptions::fields`.
  [[nodiscard]] RenderingOptions draw(const RenderingOptions& nominal, Random& random) const;
};

/// What a session looks like whose light, colours, dust and noise differ from `nominal`. The error
/// of the calibration is that of `nominal`: cameras stay where they are.
[[nodiscard]] RenderingOptions varied(const RenderingOptions& nominal, Random& random);

/// A camera that differs from `camera` by `error` pixels: pose and lens change at random. The root
/// mean square over points of the arena is exactly `error`.
[[nodiscard]] camera::Camera misaligned(const camera::Camera& camera, double error, Random& random);

}  // namespace trifinger::rendering
