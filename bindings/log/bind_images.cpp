// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "camera/image_file.hpp"
#include "conversion/gil.hpp"
#include "conversion/numbers.hpp"
#include "conversion/text.hpp"
#include "log.hpp"
#include "log/logged_images.hpp"
#include "trifinger/camera/camera.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using log::LoggedCameras;

// An array with the pixels of an image.
template <class Read>
nb::object array_of(const camera::ImageFormat& format, bool is_colour, const Read& read) {
  std::vector<std::byte> pixels;
  {
    const GilRelease release;
    pixels = read();
  }
  auto [array, memory] = is_colour ? new_array({format.height, format.width, 3}, NPY_UINT8)
                                   : new_array({format.height, format.width}, NPY_UINT8);
  std::memcpy(memory, pixels.data(), pixels.size());
  return array;
}

nb::object pixels_of(const LoggedCameras& cameras, TimeIndex index, std::size_t camera) {
  const camera::ImageFormat format = cameras.calibration().cameras.at(camera).format;
  return array_of(format, format.pixels == camera::PixelFormat::kRgb8,
                  [&] { return cameras.at(index).pixels(camera); });
}

nb::object rgb_of(const LoggedCameras& cameras, TimeIndex index, std::size_t camera) {
  return array_of(cameras.calibration().cameras.at(camera).format, true,
                  [&] { return cameras.at(index).rgb(camera); });
}

nb::object recorded(const LoggedCameras& cameras, TimeIndex index, std::size_t camera) {
  log::RecordedImage image;
  {
    const GilRelease release;
    image = cameras.at(index).recorded(camera);
  }
  return nb::make_tuple(image.encoding, nb::bytes(image.bytes.data(), image.bytes.size()));
}

// The image as a file: JPEG as recorded, or PNG.
nb::object file(const LoggedCameras& cameras, TimeIndex index, std::size_t camera) {
  std::string suffix = ".jpg";
  std::string bytes;
  {
    const GilRelease release;
    const log::LoggedImages images = cameras.at(index);
    log::RecordedImage image = images.recorded(camera);
    bytes = std::move(image.bytes);
    if (image.encoding != "jpeg") {
      suffix = ".png";
      bytes = camera::encode_png(images.cameras()[camera].format, images.pixels(camera));
    }
  }
  return nb::make_tuple(suffix, nb::bytes(bytes.data(), bytes.size()));
}

template <class Find>
std::optional<TimeIndex> index_of(const Find& find) {
  const GilRelease release;
  const std::optional<log::LoggedImages> images = find();
  return images ? std::optional(images->index()) : std::nullopt;
}

}  // namespace

void bind_logged_images(nb::module_& m) {
  nb::class_<LoggedCameras>(
      m, "LoggedCameras",
      "The images in a log by the number of their element; trifinger.log.images is for users.")
      .def(
          "__init__",
          [](LoggedCameras* place, const PythonLoggedSession& session) {
            new (place) LoggedCameras(session.session());
          },
          "session"_a)
      .def_prop_ro(
          "calibration", [](const LoggedCameras& cameras) { return cameras.calibration().text(); },
          "The text of the calibration.")
      .def_prop_ro(
          "names",
          [](const LoggedCameras& cameras) {
            std::vector<std::string> names;
            for (const camera::Camera& camera : cameras.calibration().cameras) {
              names.push_back(camera.name);
            }
            return names;
          },
          "The names of the cameras, in the order of their images.")
      .def(
          "range",
          [](const LoggedCameras& cameras) {
            const GilRelease release;
            return cameras.range();
          },
          "The first element in the log, and the one after the last.")
      .def(
          "has",
          [](const LoggedCameras& cameras, TimeIndex index, std::size_t camera) {
            const GilRelease release;
            return cameras.at(index).has(camera);
          },
          "index"_a, "camera"_a, "True if the log has the image.")
      .def(
          "times",
          [](const LoggedCameras& cameras, TimeIndex index) {
            const GilRelease release;
            return cameras.at(index).times();
          },
          "index"_a, "The middle of each exposure, since 1970 [ns].")
      .def("recorded", recorded, "index"_a, "camera"_a,
           nb::sig("def recorded(self, index: int, camera: int) -> tuple[str, bytes]"),
           "The encoding of the image in the log, and its bytes.")
      .def("file", file, "index"_a, "camera"_a,
           nb::sig("def file(self, index: int, camera: int) -> tuple[str, bytes]"),
           R"(The image as a file, ".jpg" as it was recorded or ".png", and its bytes.)")
      .def(
          "pixels", pixels_of, "index"_a, "camera"_a,
          nb::sig("def pixels(self, index: int, camera: int) -> numpy.typing.NDArray[numpy.uint8]"),
          "The pixels in the format of the camera.")
      .def("rgb", rgb_of, "index"_a, "camera"_a,
           nb::sig("def rgb(self, index: int, camera: int) -> numpy.typing.NDArray[numpy.uint8]"),
           "The image in RGB.")
      .def(
          "index_at",
          [](const LoggedCameras& cameras, TimeIndex t) {
            return index_of([&] { return cameras.get_latest_at(t); });
          },
          "t"_a, "The newest element that had arrived at the robot's step `t`.")
      .def(
          "find",
          [](const LoggedCameras& cameras, std::int64_t time) {
            return index_of([&] { return cameras.find(time); });
          },
          "time"_a, "The first element that arrived at or after this time, since 1970 [ns].");
}

}  // namespace trifinger::bindings
