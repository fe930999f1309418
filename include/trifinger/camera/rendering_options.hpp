// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <tuple>

#include "trifinger/base/time.hpp"

namespace trifinger::camera {

struct RenderingOptions;

/// A row of `RenderingOptions::fields()`.
template <class T>
struct RenderingField {
  const char* name;
  T RenderingOptions::* value;
  double low{0}, high{0};  ///< What is allowed; both 0: anything that `validate` accepts.
};

/// How simulated cameras see a scene. Nobody has measured light, noise and surfaces of a real
/// robot: the figures are estimates unless they say otherwise.
struct RenderingOptions {
  /// Pixels of the drawn picture per pixel of the image, in a row through the middle of the image.
  /// Above 1, edges are smoother and drawing takes longer.
  double detail{1.0};
  int multisampling{0};  ///< Samples per pixel of the drawn picture: 0, 2, 4 or 8.
  bool shadows{false};   ///< Whether the lamp casts shadows.
  int roundness{16};     ///< Number of flat sides of what is round, from 6.

  std::array<double, 3> lamp{0.35, -0.45, 0.82};  ///< Direction towards the lamp, of any length.
  double lamp_power{0.55};     ///< Light from the lamp; 1 shows a face's own colour.
  double ambient_power{0.50};  ///< Light from all sides.
  std::array<double, 3> light_colour{1, 1, 1};  ///< Red, green, blue, as factors.

  double colour_spread{
      0};           ///< Standard deviation of the logarithm of each surface's red, green, blue.
  double gloss{1};  ///< Factor on reflections of the lamp.
  double dust{0};   ///< Dust on the objects: 0 is clean, 1 is very dirty.

  Nanoseconds exposure{
      std::chrono::microseconds(1500)};  ///< Exposure time of the real cameras; decides blur.
  int blur_steps{4};       ///< Most pictures for what moves during the exposure; 1: no blur.
  double gain{1};          ///< Factor on brightness: exposure time, aperture, gain.
  double vignetting{0};    ///< Share of the light that is missing in the corners.
  double read_noise{0.5};  ///< Standard deviation of the noise in the dark [levels of 255].
  /// Variance of the noise per level: one over the number of electrons. 86 electrons per level are
  /// usual for such a sensor.
  double shot_noise{1.0 / 86};

  /// Root mean square of the distance between where points of the arena are seen and where the
  /// calibration says they are [pixel]. `CameraRenderer` then draws with other lenses and poses
  /// than it was given.
  double calibration_error{0};
  std::uint64_t calibration_seed{0};  ///< Seed of this error.
  std::uint64_t seed{0};              ///< Seed of noise, colours and dust.

  /// One row for each value. Checking, configurations and Python loop over them.
  [[nodiscard]] static constexpr auto fields() noexcept {
    using Options = RenderingOptions;
    using Number = RenderingField<double>;
    using Count = RenderingField<int>;
    using Three = RenderingField<std::array<double, 3>>;
    return std::tuple{Number{"detail", &Options::detail, 0.1, 4},
                      Count{"multisampling", &Options::multisampling, 0, 8},
                      RenderingField<bool>{"shadows", &Options::shadows},
                      Count{"roundness", &Options::roundness, 6, 200},
                      Three{"lamp", &Options::lamp},
                      Number{"lamp_power", &Options::lamp_power, 0, 10},
                      Number{"ambient_power", &Options::ambient_power, 0, 10},
                      Three{"light_colour", &Options::light_colour, 0, 10},
                      Number{"colour_spread", &Options::colour_spread, 0, 2},
                      Number{"gloss", &Options::gloss, 0, 10},
                      Number{"dust", &Options::dust, 0, 1},
                      RenderingField<Nanoseconds>{"exposure", &Options::exposure, 0, 1},
                      Count{"blur_steps", &Options::blur_steps, 1, 64},
                      Number{"gain", &Options::gain, 0, 1000},
                      Number{"vignetting", &Options::vignetting, 0, 1},
                      Number{"read_noise", &Options::read_noise, 0, 100},
                      Number{"shot_noise", &Options::shot_noise, 0, 100},
                      Number{"calibration_error", &Options::calibration_error, 0, 20},
                      RenderingField<std::uint64_t>{"calibration_seed", &Options::calibration_seed},
                      RenderingField<std::uint64_t>{"seed", &Options::seed}};
  }

  /// @throws InvalidArgument that names the option, the value found and the values allowed
  void validate() const;

  friend bool operator==(const RenderingOptions&, const RenderingOptions&) = default;
};

}  // namespace trifinger::camera
