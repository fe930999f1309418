// SPDX-License-Identifier: BSD-3-Clause
#include "scene.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

namespace trifinger::rendering::detail {
namespace {

constexpr mjtSize kMaxSpots = 1000;  // of dust
constexpr double kThin = 5e-4;       // A box this thin is the colour of a face [m].

using Colour = std::array<float, 3>;

Eigen::Vector3d vector(const mjtNum* from) { return {from[0], from[1], from[2]}; }

Eigen::Matrix3d matrix(const mjtNum* from) {
  return Eigen::Map<const Eigen::Matrix<mjtNum, 3, 3, Eigen::RowMajor>>(from);
}

float limited(double share) { return static_cast<float>(std::clamp(share, 0.0, 1.0)); }

}  // namespace

Scene::Scene(const mjModel& model, mjData& data, bool has_clear_walls) : model_(model) {
  mjv_defaultScene(&scene_);
  mjv_makeScene(&model, &scene_, static_cast<int>(model.ngeom + kMaxSpots));
  mjvOption option;
  mjv_defaultOption(&option);
  mjvCamera camera;
  mjv_defaultCamera(&camera);
  mjv_updateScene(&model, &data, &option, nullptr, &camera, mjCAT_ALL, &scene_);
  for (int i = 0; i < scene_.ngeom; ++i) {
    Shape shape{.drawn = scene_.geoms[i],
                .geom = scene_.geoms[i].objtype == mjOBJ_GEOM ? scene_.geoms[i].objid : -1,
                .body = 0,
                .size = 0,
                .position = {},
                .orientation = {}};
    if (shape.geom < 0) continue;  // decoration for viewers
    shape.body = model.geom_bodyid[shape.geom];
    shape.size = model.geom_rbound[shape.geom];
    if (!has_clear_walls) {
      shape.drawn.rgba[3] = 1;
      shape.drawn.transparent = 0;
    }
    clean_.push_back(shape);
  }
  // Pixels behind what is drawn already cost little, so the large background comes last. Planes
  // have no size.
  std::ranges::sort(clean_, {}, [](const Shape& shape) {
    const double size = shape.size > 0 ? shape.size : std::numeric_limits<double>::infinity();
    return std::pair(size, shape.geom);
  });
  shapes_ = clean_;
  scene_.flags[mjRND_REFLECTION] = 0;
  scene_.flags[mjRND_HAZE] = 0;
}

Scene::~Scene() { mjv_freeScene(&scene_); }

void Scene::set_options(const RenderingOptions& options) {
  casts_shadows_ = options.shadows;
  scene_.flags[mjRND_SHADOW] = options.shadows ? 1 : 0;
  shapes_ = clean_;
  set_light(options);
  set_colours(options);
}

void Scene::set_light(const RenderingOptions& options) {
  const Eigen::Vector3d lamp = Eigen::Vector3d(options.lamp.data()).normalized();
  mjvLight light{};
  light.type = mjLIGHT_DIRECTIONAL;
  light.attenuation[0] = 1;
  light.cutoff = 180;
  mjvLight ambient = light;
  light.castshadow = options.shadows ? 1 : 0;
  for (int i = 0; i < 3; ++i) {
    const double colour = options.light_colour.at(static_cast<std::size_t>(i));
    light.pos[i] = static_cast<float>(3 * lamp[i]);
    light.dir[i] = static_cast<float>(-lamp[i]);
    ambient.dir[i] = light.dir[i];
    ambient.ambient[i] = static_cast<float>(options.ambient_power * colour);
    light.diffuse[i] = static_cast<float>(options.lamp_power * colour);
    light.specular[i] = static_cast<float>(0.3 * options.lamp_power * options.gloss * colour);
  }
  // Two lights, because a shadow takes all of a light away, also what comes from all sides.
  if (!options.shadows) std::ranges::copy(ambient.ambient, light.ambient);
  scene_.nlight = options.shadows ? 2 : 1;
  scene_.lights[0] = light;
  scene_.lights[1] = ambient;
}

void Scene::set_colours(const RenderingOptions& options) {
  Random random{.seed = options.seed, .episode = 1};
  // Surfaces of one colour stay alike.
  std::map<Colour, Colour> changed;
  for (Shape& shape : shapes_) {
    const Colour colour{shape.drawn.rgba[0], shape.drawn.rgba[1], shape.drawn.rgba[2]};
    auto [found, is_new] = changed.try_emplace(colour, colour);
    if (is_new) {
      for (float& channel : found->second) {
        channel = limited(static_cast<double>(channel) *
                          std::exp(options.colour_spread * random.normal()));
      }
    }
    std::ranges::copy(found->second, shape.drawn.rgba);
  }
  random = {.seed = options.seed, .episode = 2};
  if (options.dust > 0) add_dust(options.dust, random);
}

// Dust makes the colours of faces paler, and lies on them in spots.
void Scene::add_dust(double dust, Random& random) {
  constexpr std::array kDust{0.50F, 0.47F, 0.43F};
  const std::size_t count = shapes_.size();
  for (std::size_t i = 0; i < count; ++i) {
    Shape& shape = shapes_[i];
    if (model_.body_dofnum[shape.body] != 6) continue;  // not an object
    const auto pale = static_cast<float>(dust * random.uniform(0.0, 0.4));
    for (std::size_t c = 0; c < 3; ++c) {
      shape.drawn.rgba[c] += pale * (kDust.at(c) - shape.drawn.rgba[c]);
    }
    const bool is_face =
        shape.drawn.type == mjGEOM_BOX &&
        *std::min_element(shape.drawn.size, shape.drawn.size + 3) < static_cast<float>(kThin);
    if (is_face) add_spots(Shape(shape), dust, random);
  }
}

void Scene::add_spots(const Shape& face, double dust, Random& random) {
  constexpr double kMaxSpotsOfAFace = 12;
  const auto axis = static_cast<std::size_t>(
      std::min_element(face.drawn.size, face.drawn.size + 3) - face.drawn.size);
  const std::size_t u = (axis + 1) % 3;
  const std::size_t v = (axis + 2) % 3;
  const Eigen::Matrix3d turned =
      Eigen::Quaterniond(model_.geom_quat[4 * face.geom], model_.geom_quat[4 * face.geom + 1],
                         model_.geom_quat[4 * face.geom + 2], model_.geom_quat[4 * face.geom + 3])
          .toRotationMatrix();
  const std::int64_t count =
      random.integer(0, static_cast<std::int64_t>(1 + dust * kMaxSpotsOfAFace));
  for (std::int64_t i = 0; i < count; ++i) {
    // A flat box, turned about the face's normal.
    Shape spot = face;
    spot.geom = -1;
    spot.drawn.size[u] = static_cast<float>(random.uniform(0.0004, 0.003));
    spot.drawn.size[v] = static_cast<float>(random.uniform(0.0004, 0.003));
    spot.drawn.size[axis] = face.drawn.size[axis] + 0.00005F;
    spot.drawn.modelrbound = 0.005F;
    spot.size = 0.005;
    Eigen::Vector3d at = Eigen::Vector3d::Zero();
    for (const std::size_t side : {u, v}) {
      const double room = std::max(0.0, static_cast<double>(face.drawn.size[side]) - 0.003);
      at[static_cast<Eigen::Index>(side)] = random.uniform(-room, room);
    }
    const Eigen::Vector3d position = vector(model_.geom_pos + 3 * face.geom) + turned * at;
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    normal[static_cast<Eigen::Index>(axis)] = 1;
    const Eigen::Matrix3d orientation =
        turned *
        Eigen::AngleAxisd(random.uniform(0.0, std::numbers::pi), normal).toRotationMatrix();
    std::copy_n(position.data(), 3, spot.position.data());
    Eigen::Map<Eigen::Matrix<mjtNum, 3, 3, Eigen::RowMajor>>(spot.orientation.data()) = orientation;
    // Scratches and dirt are grey, dark or bright.
    const auto grey = static_cast<float>(random.uniform(0.1, 0.7));
    const auto share = static_cast<float>(random.uniform(0.3, 1.0));
    for (float& channel : std::span(spot.drawn.rgba, 3)) channel += share * (grey - channel);
    if (shapes_.size() < static_cast<std::size_t>(scene_.maxgeom)) shapes_.push_back(spot);
  }
}

void Scene::move(const mjData& data) noexcept {
  for (Shape& shape : shapes_) {
    if (model_.body_weldid[shape.body] == 0) continue;  // fixed to the world
    Eigen::Vector3d position;
    Eigen::Matrix3d orientation;
    if (shape.geom >= 0) {
      position = vector(data.geom_xpos + 3 * shape.geom);
      orientation = matrix(data.geom_xmat + 9 * shape.geom);
    } else {
      const Eigen::Matrix3d body = matrix(data.xmat + 9 * shape.body);
      position = vector(data.xpos + 3 * shape.body) + body * vector(shape.position.data());
      orientation = body * matrix(shape.orientation.data());
    }
    for (int i = 0; i < 3; ++i) shape.drawn.pos[i] = static_cast<float>(position[i]);
    Eigen::Map<Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(shape.drawn.mat) =
        orientation.cast<float>();
  }
}

mjvScene& Scene::seen_by(const View& view) noexcept {
  scene_.camera[0] = scene_.camera[1] = view.gl_camera();
  // The floor ends at a few metres; only rays that are nearly level pass it.
  scene_.flags[mjRND_SKYBOX] = view.looks_above(-0.15) ? 1 : 0;
  scene_.ngeom = 0;
  for (const Shape& shape : shapes_) {
    const Eigen::Vector3d centre(static_cast<double>(shape.drawn.pos[0]),
                                 static_cast<double>(shape.drawn.pos[1]),
                                 static_cast<double>(shape.drawn.pos[2]));
    // Shapes outside the picture may cast shadows into it.
    if (shape.size > 0 && !casts_shadows_ && !view.sees(centre, shape.size)) continue;
    scene_.geoms[scene_.ngeom++] = shape.drawn;
  }
  return scene_;
}

double Scene::displacement(const mjData& before, const mjData& after,
                           const std::vector<View>& views) const noexcept {
  double largest = 0;
  for (const Shape& shape : shapes_) {
    if (shape.geom < 0 || model_.body_weldid[shape.body] == 0) continue;
    const Eigen::Vector3d from = vector(before.geom_xpos + 3 * shape.geom);
    const Eigen::Vector3d to = vector(after.geom_xpos + 3 * shape.geom);
    // The farthest point moves by at most that of the centre and that of the rotation.
    const double turn =
        (matrix(after.geom_xmat + 9 * shape.geom) - matrix(before.geom_xmat + 9 * shape.geom))
            .norm() /
        std::numbers::sqrt2;
    const double distance = (to - from).norm() + turn * shape.size;
    for (const View& view : views) {
      if (!view.sees(from, shape.size) && !view.sees(to, shape.size)) continue;
      largest = std::max(largest, distance * view.pixels_per_metre(from));
    }
  }
  return largest;
}

}  // namespace trifinger::rendering::detail
