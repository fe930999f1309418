// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/vector.h>

#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/numbers.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "docstrings.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/camera/calibration.hpp"
#include "trifinger/camera/camera.hpp"
#include "trifinger/config/file.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using camera::Calibration;
using camera::Camera;
using camera::Lens;
using camera::PixelFormat;

using Vector2 = Array<Eigen::Vector2d>;
using Vector5 = Array<Eigen::Vector<double, 5>>;
using Matrix4 = Array<Eigen::Matrix4d>;

PixelFormat pixels_of(std::string_view name) {
  for (const PixelFormat format :
       {PixelFormat::kMono8, PixelFormat::kBayerRg8, PixelFormat::kRgb8}) {
    if (name == camera::name_of(format)) return format;
  }
  throw InvalidArgument("pixels is '" + std::string(name) +
                        "', must be 'mono8', 'bayer_rggb8' or 'rgb8'");
}

Eigen::Isometry3d pose_of(const Eigen::Matrix4d& matrix) {
  const Eigen::Matrix3d turn = matrix.topLeftCorner<3, 3>();
  const bool is_rotation = (turn * turn.transpose()).isApprox(Eigen::Matrix3d::Identity(), 1e-6) &&
                           turn.determinant() > 0 &&
                           matrix.row(3).isApprox(Eigen::RowVector4d(0, 0, 0, 1), 1e-9);
  if (!is_rotation) throw InvalidArgument("pose is no rotation and translation");
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = turn;
  pose.translation() = matrix.topRightCorner<3, 1>();
  return pose;
}

// Converts whatever NumPy accepts as rows of `N` numbers.
template <int N>
RowMajor to_rows(nb::handle object, const char* what) {
  const auto [array, numbers] = doubles_of(object, {-1, N}, what);
  return Eigen::Map<const RowMajor>(numbers.data(), std::ssize(numbers) / N, N);
}

Array<RowMajor> project(const Camera& camera, nb::handle points) {
  RowMajor const rows = to_rows<3>(points, "points");
  RowMajor pixels(rows.rows(), 2);
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    pixels.row(i) =
        camera.project(Eigen::Vector3d(rows.row(i)))
            .value_or(Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()));
  }
  return {pixels};
}

Array<RowMajor> unproject(const Lens& lens, nb::handle pixels) {
  RowMajor rays = to_rows<2>(pixels, "pixels");
  for (Eigen::Index i = 0; i < rays.rows(); ++i) {
    rays.row(i) = lens.unproject(Eigen::Vector2d(rays.row(i)));
  }
  return {rays};
}

}  // namespace

void bind_camera_calibration(nb::module_& m) {
  nb::class_<Lens>(m, "Lens", docs::Lens::Lens)
      .def(
          "__init__",
          [](Lens* self, const Vector2& focal_length, const Vector2& principal_point,
             const Vector5& distortion) {
            Lens lens{.fx = focal_length.value[0],
                      .fy = focal_length.value[1],
                      .cx = principal_point.value[0],
                      .cy = principal_point.value[1]};
            for (std::size_t i = 0; i < lens.distortion.size(); ++i) {
              lens.distortion[i] = distortion.value[static_cast<Eigen::Index>(i)];
            }
            new (self) Lens{lens};
          },
          "focal_length"_a, "principal_point"_a,
          "distortion"_a = nb::make_tuple(0.0, 0.0, 0.0, 0.0, 0.0))
      .def_prop_ro(
          "focal_length", [](const Lens& lens) { return Vector2{{lens.fx, lens.fy}}; },
          docs::Lens::fx)
      .def_prop_ro(
          "principal_point", [](const Lens& lens) { return Vector2{{lens.cx, lens.cy}}; },
          docs::Lens::cx)
      .def_prop_ro(
          "distortion",
          [](const Lens& lens) {
            return Vector5{Eigen::Map<const Eigen::Vector<double, 5>>(lens.distortion.data())};
          },
          docs::Lens::distortion)
      .def("unproject", unproject, "pixels"_a,
           nb::sig("def unproject(self, pixels: numpy.typing.ArrayLike) -> "
                   "numpy.typing.NDArray[numpy.float64]"),
           docs::Lens::unproject)
      .def("scaled", &Lens::scaled, "factor"_a, docs::Lens::scaled)
      .def("cropped", &Lens::cropped, "left"_a, "top"_a, docs::Lens::cropped);

  nb::class_<Camera>(m, "Camera", docs::Camera::Camera)
      .def(
          "__init__",
          [](Camera* self, std::string name, int width, int height, const std::string& pixels,
             const Lens& lens, const Matrix4& pose, std::string serial) {
            new (self)
                Camera{.name = std::move(name),
                       .serial = std::move(serial),
                       .format = {.width = width, .height = height, .pixels = pixels_of(pixels)},
                       .lens = lens,
                       .pose = pose_of(pose.value)};
          },
          "name"_a, "width"_a, "height"_a, "pixels"_a, "lens"_a, "pose"_a, "serial"_a = "any")
      .def_ro("name", &Camera::name, docs::Camera::name)
      .def_ro("serial", &Camera::serial, docs::Camera::serial)
      .def_prop_ro(
          "width", [](const Camera& camera) { return camera.format.width; },
          docs::ImageFormat::width)
      .def_prop_ro(
          "height", [](const Camera& camera) { return camera.format.height; },
          docs::ImageFormat::height)
      .def_prop_ro(
          "pixels",
          [](const Camera& camera) { return std::string(camera::name_of(camera.format.pixels)); },
          docs::PixelFormat::PixelFormat)
      .def_ro("lens", &Camera::lens, docs::Lens::Lens)
      .def_prop_ro(
          "pose", [](const Camera& camera) { return Matrix4{camera.pose.matrix()}; },
          docs::Camera::pose)
      .def("project", project, "points"_a,
           nb::sig("def project(self, points: numpy.typing.ArrayLike) -> "
                   "numpy.typing.NDArray[numpy.float64]"),
           "Where points of the world are seen, a row for each [pixel]; NaN if a point is not in "
           "front of the camera.\nThe pixel may lie outside the image.")
      .def("reduced", &Camera::reduced, "factor"_a, docs::Camera::reduced)
      .def("resized", &Camera::resized, "width"_a, docs::Camera::resized);

  nb::class_<Calibration>(m, "CameraCalibration", docs::camera::Calibration::Calibration)
      .def(
          "__init__",
          [](Calibration* self, std::vector<Camera> cameras, std::string date, double residual) {
            new (self) Calibration{
                .date = std::move(date), .residual = residual, .cameras = std::move(cameras)};
          },
          "cameras"_a, "date"_a = "", "residual"_a = 0.0)
      .def_ro("date", &Calibration::date, docs::camera::Calibration::date)
      .def_ro("residual", &Calibration::residual, docs::camera::Calibration::residual)
      .def_ro("cameras", &Calibration::cameras, "In the order of the robot's images.")
      .def("text", &Calibration::text, docs::camera::Calibration::text)
      .def_static(
          "read", [](const ShownPath& path) { return camera::read_calibration(to_path(path)); },
          "path"_a, docs::camera::read_calibration)
      .def_static("file_of", camera::calibration_file, "robot"_a, docs::camera::calibration_file);
}

}  // namespace trifinger::bindings
