// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "conversion/text.hpp"
#include "docstrings.hpp"
#include "sim/robot_cameras.hpp"
#include "simulation/simulation.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/camera/calibration.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/rendering/camera_renderer.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using namespace rendering;
using camera::Camera;
using camera::PixelFormat;
using Numbers = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Image = nb::ndarray<nb::numpy, std::uint8_t>;

// Calls `use` with each row of `RenderingOptions::fields()`.
template <class Use>
void for_each_option(const Use& use) {
  std::apply([&use](const auto&... row) { (use(row), ...); }, RenderingOptions::fields());
}

using Seconds = std::chrono::duration<double>;

RenderingOptions changed(RenderingOptions options, const nb::dict& given) {
  std::size_t num_known = 0;
  for_each_option([&]<class T>(const RenderingField<T>& row) {
    if (!given.contains(row.name)) return;
    ++num_known;
    std::conditional_t<std::is_same_v<T, Nanoseconds>, double, T> value{};
    if (!nb::try_cast(given[row.name], value)) {
      throw nb::type_error((std::string(row.name) + " is of a wrong type").c_str());
    }
    if constexpr (std::is_same_v<T, Nanoseconds>) {
      options.*row.value = std::chrono::round<Nanoseconds>(Seconds(value));
    } else {
      options.*row.value = value;
    }
  });
  if (num_known == given.size()) return options;
  std::string known;
  for_each_option(
      [&](const auto& row) { known += (known.empty() ? "" : ", ") + std::string(row.name); });
  throw nb::type_error(("there is an option that cameras do not have; they have " + known).c_str());
}

nb::dict to_dict(const RenderingOptions& options) {
  nb::dict values;
  for_each_option([&]<class T>(const RenderingField<T>& row) {
    if constexpr (std::is_same_v<T, Nanoseconds>) {
      values[row.name] = Seconds(options.*row.value).count();
    } else if constexpr (std::is_same_v<T, Triple>) {
      const auto& [x, y, z] = options.*row.value;
      values[row.name] = nb::make_tuple(x, y, z);
    } else {
      values[row.name] = options.*row.value;
    }
  });
  return values;
}

PixelFormat pixel_format(const std::string& name) {
  std::string known;
  for (const PixelFormat format :
       {PixelFormat::kBayerRg8, PixelFormat::kRgb8, PixelFormat::kMono8}) {
    if (name_of(format) == name) return format;
    known += (known.empty() ? "" : ", ") + std::string(name_of(format));
  }
  throw InvalidArgument("there are no pixels '" + name + "', only " + known);
}

camera::Calibration read_calibration_text(const std::string& text) {
  const config::File file = config::File::parse(text, "calibration");
  camera::Calibration calibration = camera::read_calibration(file.root());
  file.reject_unknown_keys();
  return calibration;
}

// A renderer with the calibration that it was made for.
class PythonRenderer {
 public:
  PythonRenderer(const SimulationOptions& robot, camera::Calibration calibration,
                 const RenderingOptions& options)
      : calibration_(std::move(calibration)), renderer_(robot, calibration_.cameras, options) {}

  [[nodiscard]] std::string calibration() const { return calibration_.text(); }
  [[nodiscard]] std::string true_calibration() const {
    camera::Calibration calibration = calibration_;
    calibration.cameras = renderer_.true_cameras();
    return calibration.text();
  }
  [[nodiscard]] std::vector<std::string> names() const {
    std::vector<std::string> names;
    for (const Camera& camera : renderer_.cameras()) names.push_back(camera.name);
    return names;
  }
  [[nodiscard]] CameraRenderer& renderer() noexcept { return renderer_; }

  [[nodiscard]] std::vector<Image> render(const Numbers& configuration, std::uint64_t number) {
    std::vector<Image> images;
    std::vector<std::span<std::byte>> places;
    for (const Camera& camera : renderer_.cameras()) {
      auto pixels = std::make_unique<std::uint8_t[]>(camera.format.size());
      places.push_back(std::as_writable_bytes(std::span(pixels.get(), camera.format.size())));
      const std::size_t shape[] = {static_cast<std::size_t>(camera.format.height),
                                   static_cast<std::size_t>(camera.format.width), 3};
      std::uint8_t* const data = pixels.get();
      const nb::capsule owner(pixels.release(), [](void* memory) noexcept {
        std::unique_ptr<std::uint8_t[]>(static_cast<std::uint8_t*>(memory));
      });
      images.emplace_back(data, camera.format.pixels == PixelFormat::kRgb8 ? 3 : 2, shape, owner);
    }
    const std::span values(configuration.data(), configuration.size());
    const nb::gil_scoped_release released;
    renderer_.render(values, number, places);
    return images;
  }

 private:
  camera::Calibration calibration_;
  CameraRenderer renderer_;
};

void make(PythonRenderer* self, const std::string& config, const nb::dict& overrides,
          const std::optional<std::string>& calibration, int reduction, const std::string& pixels,
          const nb::kwargs& options) {
  const SimulationOptions robot = load_config(config, overrides).simulation;
  camera::Calibration cameras = calibration             ? read_calibration_text(*calibration)
                                : robot.file != nullptr ? calibration_of_file(*robot.file)
                                                        : calibration_of_figures(robot.description);
  for (Camera& camera : cameras.cameras) {
    camera = camera.reduced(reduction);
    camera.format.pixels = pixel_format(pixels);
  }
  new (self) PythonRenderer(robot, std::move(cameras), changed({}, options));
}

}  // namespace

void bind_rendering(nb::module_& m) {
  nb::class_<PythonRenderer>(m, "CameraRenderer", docs::CameraRenderer::CameraRenderer)
      .def("__init__", &make, "config"_a = "sim", "overrides"_a = nb::dict(), nb::kw_only(),
           "calibration"_a = nb::none(), "reduction"_a = 1, "pixels"_a = "bayer_rggb8", "options"_a,
           nb::sig("def __init__(self, config: str = 'sim', overrides: dict[str, object] = {}, *, "
                   "calibration: str | None = None, reduction: int = 1, pixels: str = "
                   "'bayer_rggb8', **options: object) -> None"),
           "The robot of the configuration, with its own cameras or those of the text of a "
           "`calibration`. A\n`reduction` of 2 halves width and height. `pixels` are "
           "\"bayer_rggb8\", \"rgb8\" or \"mono8\". `options` are\nthose of `options`.")
      .def("render", &PythonRenderer::render, "configuration"_a, "number"_a = 0,
           nb::sig("def render(self, configuration: NDArray[numpy.float64], number: int = 0) -> "
                   "list[NDArray[numpy.uint8]]"),
           "Draws one image per camera, height x width or height x width x 3. `configuration` is "
           "that of\n`Simulation.configuration`: positions, and velocities if what moves shall be "
           "blurred. `number` is that of\nthe images: each has its own noise.")
      .def_prop_ro("names", &PythonRenderer::names, "Names of the cameras.")
      .def_prop_ro("calibration", &PythonRenderer::calibration,
                   "The cameras as they are said to be, as text in YAML.")
      .def_prop_ro("true_calibration", &PythonRenderer::true_calibration,
                   "The cameras as they are: others if the options have an error of the "
                   "calibration.")
      .def_prop_ro(
          "options", [](PythonRenderer& self) { return to_dict(self.renderer().options()); },
          nb::sig("def options(self) -> dict[str, object]"),
          "What the images look like. docs/simulated_cameras.md explains each value.")
      .def(
          "set_options",
          [](PythonRenderer& self, const nb::kwargs& options) {
            self.renderer().set_options(changed(self.renderer().options(), options));
          },
          "options"_a, nb::sig("def set_options(self, **options: object) -> None"),
          "Changes what the next images look like.")
      .def(
          "vary",
          [](PythonRenderer& self, std::uint64_t seed, std::uint64_t episode) {
            Random random{.seed = seed, .episode = episode};
            self.renderer().set_options(RenderingVariation{}.draw({}, random));
          },
          "seed"_a = 0, "episode"_a = 0,
          "Draws light, colours, dust, noise and the error of the calibration at random.");
}

}  // namespace trifinger::bindings
