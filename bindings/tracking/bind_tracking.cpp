// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "conversion/array.hpp"
#include "conversion/shown.hpp"
#include "conversion/text.hpp"
#include "docstrings.hpp"
#include "simulation/simulation.hpp"
#include "tracking/colour_samples.hpp"
#include "trifinger/base/error.hpp"
#include "trifinger/camera/calibration.hpp"
#include "trifinger/config/file.hpp"
#include "trifinger/tracking/tracker.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace trifinger::bindings {
namespace {

using namespace tracking;
using Image = nb::ndarray<const std::uint8_t, nb::c_contig, nb::device::cpu>;
using Vector4 = Array<Eigen::Vector4d>;

Eigen::Vector4d quaternion_of(const Estimate& estimate) {
  const Eigen::Quaterniond turn(estimate.pose.linear());
  return {turn.w(), turn.x(), turn.y(), turn.z()};
}

Eigen::Isometry3d pose_of(const Eigen::Vector3d& position, const Eigen::Vector4d& orientation) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = position;
  pose.linear() = Eigen::Quaterniond(orientation[0], orientation[1], orientation[2], orientation[3])
                      .normalized()
                      .toRotationMatrix();
  return pose;
}

ColourModel colours_from(const std::optional<std::string>& text) {
  if (!text) return ColourModel::standard();
  const config::File file = config::File::parse(*text, "colours");
  ColourModel model = read_colour_model(file.root());
  file.reject_unknown_keys();
  return model;
}

std::vector<camera::Camera> cameras_from(const std::string& text) {
  const config::File file = config::File::parse(text, "calibration");
  std::vector<camera::Camera> cameras = camera::read_calibration(file.root()).cameras;
  file.reject_unknown_keys();
  return cameras;
}

Estimate track(Tracker& tracker, const std::vector<std::optional<Image>>& images,
               const std::optional<std::pair<Vector3, Vector4>>& guess) {
  std::vector<std::span<const std::byte>> pixels;
  for (const std::optional<Image>& image : images) {
    if (image) {
      pixels.emplace_back(reinterpret_cast<const std::byte*>(image->data()), image->nbytes());
    } else {
      pixels.emplace_back();
    }
  }
  std::optional<Eigen::Isometry3d> pose;
  if (guess) pose = pose_of(guess->first, guess->second);
  const nb::gil_scoped_release released;
  return tracker.track(pixels, pose ? &*pose : nullptr);
}

}  // namespace
}  // namespace trifinger::bindings

namespace trifinger::bindings {

void bind_tracking(nb::module_& m) {
  m.def(
      "balanced_blocks",
      [](const Image& image) {
        if (image.ndim() < 2 || image.ndim() > 3 || (image.ndim() == 3 && image.shape(2) != 3)) {
          throw InvalidArgument(
              "an image must be height x width (bayer_rggb8) or height x width x 3");
        }
        const camera::ImageFormat format{.width = static_cast<int>(image.shape(1)),
                                         .height = static_cast<int>(image.shape(0)),
                                         .pixels = image.ndim() == 2
                                                       ? camera::PixelFormat::kBayerRg8
                                                       : camera::PixelFormat::kRgb8};
        const auto blocks = balanced_blocks(
            format, {reinterpret_cast<const std::byte*>(image.data()), image.nbytes()});
        RowMajor rows(static_cast<Eigen::Index>(blocks.size()), 3);
        for (std::size_t i = 0; i < blocks.size(); ++i)
          rows.row(static_cast<Eigen::Index>(i)) = blocks[i].cast<double>();
        return Array{rows};
      },
      "image"_a, docs::balanced_blocks);
  m.def(
      "faces_in_blocks",
      [](const std::string& calibration, const TrackedObject& object, const Vector3& position,
         const Vector4& orientation) {
        const std::vector<camera::Camera> cameras = cameras_from(calibration);
        std::vector<std::vector<int>> contents;
        contents.reserve(cameras.size());
        for (const camera::Camera& camera : cameras)
          contents.push_back(faces_in_blocks(camera, object, pose_of(position, orientation)));
        return contents;
      },
      "calibration"_a, "object"_a, "position"_a, "orientation"_a, docs::faces_in_blocks);
  nb::class_<TrackedObject>(m, "TrackedObject", docs::TrackedObject::TrackedObject)
      .def_ro("name", &TrackedObject::name)
      .def_prop_ro(
          "colours",
          [](const TrackedObject& object) {
            std::vector<std::string> colours;
            colours.reserve(object.faces.size());
            for (const ColouredFace& face : object.faces) colours.push_back(face.colour);
            return colours;
          },
          "The colour of each face.");
  m.def(
      "coloured_box",
      [](std::string name, const Vector3& size, const BoxColours& colours, double rim) {
        return coloured_box(std::move(name), size, colours, rim);
      },
      "name"_a, "size"_a, "colours"_a = competition_colours(), "rim"_a = 0.0, docs::coloured_box);
  m.def(
      "tracked_object",
      [](const std::string& config, const Overrides& overrides, const std::string& name) {
        const RobotDescription scene = description_of(load_config(config, overrides));
        for (const ObjectDescription& object : scene.objects) {
          if (object.name == name) return tracked_object(object);
        }
        throw InvalidArgument("the scene has no object '" + name + "'");
      },
      "config"_a = "sim", "overrides"_a = nb::dict(), "name"_a = "cube", docs::tracked_object);
  m.def(
      "coloured_mesh",
      [](std::string name, const std::vector<std::array<double, 3>>& vertices,
         const std::vector<std::array<int, 3>>& triangles,
         const std::vector<std::string>& colours) {
        std::vector<Eigen::Vector3d> points;
        points.reserve(vertices.size());
        for (const auto& [x, y, z] : vertices) points.emplace_back(x, y, z);
        return coloured_mesh(std::move(name), points, triangles, colours);
      },
      "name"_a, "vertices"_a, "triangles"_a, "colours"_a, docs::coloured_mesh);

  nb::class_<Estimate>(m, "Estimate", docs::Estimate::Estimate)
      .def_prop_ro("is_sure", &Estimate::is_sure)
      .def_prop_ro("is_found",
                   [](const Estimate& e) { return e.state != Estimate::State::kNotFound; })
      .def_prop_ro("position",
                   [](const Estimate& e) { return Array{Eigen::Vector3d(e.pose.translation())}; })
      .def_prop_ro("orientation", [](const Estimate& e) { return Array{quaternion_of(e)}; })
      .def_prop_ro("position_deviation", array_of(&Estimate::position_deviation),
                   docs::Estimate::position_deviation)
      .def_prop_ro("rotation_deviation", array_of(&Estimate::rotation_deviation),
                   docs::Estimate::rotation_deviation)
      .def_ro("confidence", &Estimate::confidence, docs::Estimate::confidence)
      .def_ro("cameras", &Estimate::cameras, docs::Estimate::cameras)
      .def_ro("faces", &Estimate::faces, docs::Estimate::faces)
      .def_ro("residual", &Estimate::residual, docs::Estimate::residual);

  nb::class_<Tracker>(m, "Tracker", docs::Tracker::Tracker)
      .def(
          "__init__",
          [](Tracker* self, const std::string& calibration, const TrackedObject& object,
             const std::optional<std::string>& colours, double calibration_error) {
            new (self) Tracker(cameras_from(calibration), object, colours_from(colours),
                               {.calibration_error = calibration_error});
          },
          "calibration"_a, "object"_a, "colours"_a = nb::none(), "calibration_error"_a = 0.5)
      .def("track", &track, "images"_a, "guess"_a = nb::none(),
           nb::sig(
               "def track(self, images: Sequence[NDArray[numpy.uint8] | None], guess: "
               "tuple[numpy.typing.ArrayLike, numpy.typing.ArrayLike] | None = None) -> Estimate"),
           docs::Tracker::track);
}

}  // namespace trifinger::bindings
