// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/config/node.hpp"

namespace trifinger::tracking {

/// What a pixel with these brightnesses, 0 to 255, is judged by: log of red over green, log of blue
/// over green, log of the mean. A change of light moves the last number only. Dark pixels have
/// little colour, so their first two numbers are near zero.
[[nodiscard]] Eigen::Vector3d colour_features(double red, double green, double blue) noexcept;

/// A normal distribution of colour features.
struct ColourBell {
  double weight{1};
  Eigen::Vector3d mean{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d covariance{Eigen::Matrix3d::Identity()};
};

/// The colours that the pixels of one kind of surface have in images.
struct Colour {
  std::string name;  ///< For example "red".
  std::vector<ColourBell> bells;

  /// The density of these features among pixels of this colour.
  [[nodiscard]] double density(const Eigen::Vector3d& features) const noexcept;
};

/// Tells colours apart: those of objects, and the background with everything that may stand around.
///
/// `trifinger calibrate colours` learns it from images.
struct ColourModel {
  std::vector<Colour> colours;
  Colour background{.name = "background", .bells = {}};

  /// The colour with this name; null if there is none.
  [[nodiscard]] const Colour* find(std::string_view name) const noexcept;
  /// Returns the text of a file, in YAML.
  [[nodiscard]] std::string text() const;

  /// The colours of the competition's cube, learned from rendered images whose light, colours and
  /// cameras vary widely: red, green, blue, cyan, magenta, yellow.
  [[nodiscard]] static const ColourModel& standard();
};

/// Reads the section or file of a colour model.
/// @throws config::ConfigError at what makes no sense
[[nodiscard]] ColourModel read_colour_model(const config::Node& node);
/// Reads a file that `ColourModel::text` has written.
/// @throws config::ConfigError at what makes no sense, SystemError
[[nodiscard]] ColourModel read_colour_model(const std::filesystem::path& path);

}  // namespace trifinger::tracking
