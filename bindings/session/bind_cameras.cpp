// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>

#include <chrono>
#include <cstddef>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "bindings.hpp"
#include "conversion/gil.hpp"
#include "conversion/numbers.hpp"
#include "conversion/text.hpp"
#include "conversion/timeout.hpp"
#include "payload.hpp"
#include "trifinger/camera/calibration.hpp"
#include "trifinger/camera/images.hpp"
#include "trifinger/camera/pixels.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/core/sensor.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

// ---- payloads ----

nb::object array_in_place(const nb::object& self) {
  const auto& payload = nb::cast<const PythonPayload&>(self);
  return payload.type.view(payload.view.bytes().data(), self);
}

nb::object copied(const PythonPayload& payload) {
  auto [array, memory] = payload.type.new_scalar_array();
  {
    const GilRelease release;
    std::memcpy(memory, payload.view.bytes().data(), payload.view.bytes().size());
  }
  payload.view.require_valid();
  return array;
}

// ---- cameras ----

std::vector<camera::Camera> cameras_of(const std::string& calibration) {
  const config::File file = config::File::parse(calibration, camera::kDocument);
  return camera::read_calibration(file.root()).cameras;
}

// The elements of a process of cameras, without a robot.
class PythonLiveCameras {
 public:
  PythonLiveCameras(const std::string& robot, const std::string& calibration)
      : PythonLiveCameras(robot, cameras_of(calibration)) {}

  // A pair of element and payload; None if there are no new images.
  nb::object next(nb::handle timeout) {
    auto [element, memory] = element_.new_element();
    if (!read(memory, to_timeout(timeout))) return nb::none();
    PayloadReference reference;
    std::memcpy(&reference, memory + sizeof(Stamp), sizeof(reference));
    if (reference.memory == 0) return nb::make_tuple(element, nb::none());
    return nb::make_tuple(element, PythonPayload{payloads_.view(reference), payload_});
  }

 private:
  PythonLiveCameras(const std::string& robot, const std::vector<camera::Camera>& cameras)
      : sensor_(robot, camera::kCompanion, camera::image_elements(cameras),
                camera::image_payload(cameras)),
        payloads_(robot, camera::kCompanion, camera::image_payload(cameras)),
        element_(camera::image_elements(cameras)),
        payload_(camera::image_payload(cameras)) {}

  // In slices, so that Ctrl-C works.
  bool read(std::byte* element, Timeout timeout) {
    constexpr Nanoseconds kSlice = std::chrono::milliseconds(100);
    const Deadline deadline(timeout);
    while (true) {
      {
        const GilRelease release;
        if (sensor_.next(element, deadline.remaining(kSlice))) return true;
      }
      check_signals();
      if (deadline.passed()) return false;
    }
  }

  UntypedSensorReader sensor_;
  PayloadReader payloads_;
  ElementType element_;
  ElementType payload_;
};

// An image in RGB, as a new array.
nb::object to_rgb(nb::handle image, const std::string& pixels) {
  const nb::object array = nb::steal(PyArray_FROM_OTF(image.ptr(), NPY_UINT8, NPY_ARRAY_IN_ARRAY));
  if (!array.is_valid()) throw nb::python_error();
  auto* const found = reinterpret_cast<PyArrayObject*>(array.ptr());
  camera::ImageFormat format;
  bool is_known = false;
  for (const auto known :
       {camera::PixelFormat::kMono8, camera::PixelFormat::kBayerRg8, camera::PixelFormat::kRgb8}) {
    if (name_of(known) != pixels) continue;
    format.pixels = known;
    is_known = true;
  }
  detail::require(is_known,
                  "'" + pixels + "' is no format of pixels; there are mono8, bayer_rggb8, rgb8");
  const bool is_colour = format.pixels == camera::PixelFormat::kRgb8;
  const int dimensions = PyArray_NDIM(found);
  detail::require(dimensions == (is_colour ? 3 : 2) && (!is_colour || PyArray_DIM(found, 2) == 3) &&
                      PyArray_SIZE(found) > 0,
                  std::string("an image in ") + pixels + " has the shape " +
                      (is_colour ? "(height, width, 3)" : "(height, width)"));
  format.height = static_cast<int>(PyArray_DIM(found, 0));
  format.width = static_cast<int>(PyArray_DIM(found, 1));
  auto [rgb, memory] = new_array({format.height, format.width, 3}, NPY_UINT8);
  const std::span source(static_cast<const std::byte*>(PyArray_DATA(found)), format.size());
  const std::span target(static_cast<std::byte*>(memory),
                         std::size_t{3} * static_cast<std::size_t>(format.height) *
                             static_cast<std::size_t>(format.width));
  {
    const GilRelease release;
    camera::to_rgb(format, source, target);
  }
  return rgb;  // one of two that belong together is copied, not moved
}

}  // namespace

void bind_cameras(nb::module_& m) {
  nb::class_<PythonPayload>(
      m, "Payload",
      R"(Large data of an element, such as images, in the memory of the process that wrote them.

`payload.copy()` is a copy that is certainly whole. Without a copy:

    with companion.payload(element) as images:  # a read-only structured array
        brightness = images["camera60"].mean()

If the writer has overwritten the data before the end of the block, the block raises HistoryLost.)")
      .def(
          "array", &array_in_place, nb::sig("def array(self) -> numpy.typing.NDArray[numpy.void]"),
          R"(The data in place, as a read-only structured array without dimensions: `array["camera60"]`.
Check is_valid() after using it.)")
      .def("copy", &copied, nb::sig("def copy(self) -> numpy.typing.NDArray[numpy.void]"),
           "A copy like `array()`. Raises HistoryLost if the data were overwritten meanwhile.")
      .def(
          "is_valid", [](const PythonPayload& payload) { return payload.view.is_valid(); },
          R"(False if the writer has begun to overwrite the data. What was read before a call that returns
True was whole.)")
      .def("__enter__", &array_in_place,
           nb::sig("def __enter__(self) -> numpy.typing.NDArray[numpy.void]"))
      .def(
          "__exit__",
          [](const PythonPayload& payload, nb::handle raised, nb::handle, nb::handle) {
            if (raised.is_none()) payload.view.require_valid();
          },
          "type"_a.none(), "value"_a.none(), "traceback"_a.none(),
          nb::sig("def __exit__(self, type: builtins.type[BaseException] | None, "
                  "value: BaseException | None, traceback: types.TracebackType | None) -> None"));

  nb::class_<PythonLiveCameras>(m, "LiveCameras",
                                "The images of a process of cameras, without the robot.")
      .def(nb::init<const std::string&, const std::string&>(), "robot"_a, "calibration"_a)
      .def(
          "next", &PythonLiveCameras::next, "timeout"_a = nb::none(),
          nb::sig("def next(self, timeout: float | None = None) -> tuple[Element, Payload | None] "
                  "| None"),
          R"(Returns the newest element and its payload if they are others than at the last call. Waits for
them up to `timeout` [s].)");

  m.def(
      "to_rgb", &to_rgb, "image"_a, "pixels"_a,
      nb::sig("def to_rgb(image: numpy.typing.ArrayLike, pixels: str) -> "
              "numpy.typing.NDArray[numpy.uint8]"),
      R"(Returns an image in the format `pixels` ("bayer_rggb8", "rgb8", "mono8") as RGB of the same size,
uint8[height, width, 3]. The colours that a pixel of a Bayer mosaic lacks are the mean of its
nearest neighbours.)");
}

}  // namespace trifinger::bindings
