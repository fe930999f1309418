// SPDX-License-Identifier: BSD-3-Clause
#include "trifinger/tracking/colour_model.hpp"

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <numbers>
#include <set>
#include <string>

#include "base/text_of.hpp"
#include "standard_colours.hpp"
#include "trifinger/base/text.hpp"
#include "trifinger/config/file.hpp"

namespace trifinger::tracking {
namespace {

using trifinger::detail::text_of;

std::string number_text(double value) {
  // Four digits say more than any images tell.
  const double scale = std::pow(10.0, 4);
  return std::string(FixedText().append(std::round(value * scale) / scale).view());
}

template <class... Numbers>
std::string list_text(const Numbers&... values) {
  std::string text;
  ((text += (text.empty() ? "[" : ", ") + number_text(values)), ...);
  return text + "]";
}

std::string text_of_colour(const Colour& colour) {
  std::string text = text_of("  - name: ", colour.name, "\n    bells:\n");
  for (const ColourBell& bell : colour.bells) {
    const Eigen::Vector3d& m = bell.mean;
    const Eigen::Matrix3d& c = bell.covariance;
    text += text_of(
        "      - {weight: ", number_text(bell.weight), ", mean: ", list_text(m.x(), m.y(), m.z()),
        ", covariance: ", list_text(c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2)), "}\n");
  }
  return text;
}

ColourBell read_bell(const config::Node& node) {
  const auto mean = node.required<std::array<double, 3>>("mean", {.min = -20, .max = 20});
  const auto c = node.required<std::array<double, 6>>("covariance", {.min = -100, .max = 100});
  ColourBell bell{
      .weight = node.required<double>("weight", {.min = 0, .max = 1, .above_min = true}),
      .mean = {mean[0], mean[1], mean[2]},
      .covariance = {}};
  bell.covariance << c[0], c[1], c[2], c[1], c[3], c[4], c[2], c[4], c[5];
  if (bell.covariance.llt().info() != Eigen::Success) {
    node.at("covariance").fail("is no covariance: its matrix must be positive definite");
  }
  return bell;
}

Colour read_colour(const config::Node& node) {
  Colour colour{.name = node.required<std::string>("name"), .bells = {}};
  const config::Node bells = node.at("bells");
  for (const config::Node& item : bells.items()) colour.bells.push_back(read_bell(item));
  if (colour.bells.empty()) bells.fail("is empty, must have at least one entry");
  return colour;
}

}  // namespace

Eigen::Vector3d colour_features(double red, double green, double blue) noexcept {
  // Keeps the noise of dark pixels from looking like a colour.
  constexpr double kDark = 6;
  const double log_green = std::log(green + kDark);
  return {std::log(red + kDark) - log_green, std::log(blue + kDark) - log_green,
          std::log((red + green + blue) / 3 + kDark)};
}

double Colour::density(const Eigen::Vector3d& features) const noexcept {
  double sum = 0;
  for (const ColourBell& bell : bells) {
    const Eigen::Vector3d away = features - bell.mean;
    const Eigen::LLT<Eigen::Matrix3d> root(bell.covariance);
    const double size = root.matrixL().toDenseMatrix().diagonal().prod();
    const double distance = root.matrixL().solve(away).squaredNorm();
    sum += bell.weight * std::exp(-0.5 * distance) / (std::pow(2 * std::numbers::pi, 1.5) * size);
  }
  return sum;
}

const Colour* ColourModel::find(std::string_view name) const noexcept {
  for (const Colour& colour : colours) {
    if (colour.name == name) return &colour;
  }
  return nullptr;
}

std::string ColourModel::text() const {
  std::string text =
      "# How surfaces look to cameras: normal distributions of the log of red over green, the log\n"
      "# of blue over green and the log of the mean. Covariances are xx, xy, xz, yy, yz, zz.\n"
      "# Written by 'trifinger calibrate colours'.\ncolours:\n";
  for (const Colour& colour : colours) text += text_of_colour(colour);
  return text + text_of_colour(background);
}

const ColourModel& ColourModel::standard() {
  static const ColourModel model = [] {
    const config::File file = config::File::parse(detail::kStandardColours, "colours.yml");
    return read_colour_model(file.root());
  }();
  return model;
}

ColourModel read_colour_model(const config::Node& node) {
  ColourModel model;
  const config::Node colours = node.at("colours");
  std::set<std::string> names;
  for (const config::Node& item : colours.items()) {
    Colour colour = read_colour(item);
    if (!names.insert(colour.name).second) item.at("name").fail("is the name of two colours");
    if (colour.name == model.background.name) {
      model.background = std::move(colour);
    } else {
      model.colours.push_back(std::move(colour));
    }
  }
  if (model.background.bells.empty()) colours.fail("has no colour 'background'");
  if (model.colours.empty()) colours.fail("has only the background, must have another colour");
  return model;
}

ColourModel read_colour_model(const std::filesystem::path& path) {
  const config::File file = config::File::load(path);
  ColourModel model = read_colour_model(file.root());
  file.reject_unknown_keys();
  return model;
}

}  // namespace trifinger::tracking
