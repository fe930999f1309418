// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mujoco/mujoco.h>

#include <array>
#include <vector>

#include "trifinger/base/random.hpp"
#include "trifinger/rendering/options.hpp"
#include "view.hpp"

namespace trifinger::rendering::detail {

// What is drawn: the shapes of a model with the light, the colours and the dust of some options.
class Scene {
 public:
  // `data` is at any configuration. The model must outlive the scene. Films see through every wall;
  // `has_clear_walls` says whether cameras do.
  Scene(const mjModel& model, mjData& data, bool has_clear_walls);
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;
  ~Scene();

  void set_options(const RenderingOptions& options);
  // Moves all shapes to where `data` has them.
  void move(const mjData& data) noexcept;
  // The scene as a view sees it, until the next call.
  [[nodiscard]] mjvScene& seen_by(const View& view) noexcept;
  // The largest distance by which a visible shape is displaced in an image between two instants
  // [pixel].
  [[nodiscard]] double displacement(const mjData& before, const mjData& after,
                                    const std::vector<View>& views) const noexcept;

 private:
  // A shape and where it is: a geom of the model, or fixed to one of its bodies.
  struct Shape {
    mjvGeom drawn;
    int geom;  // -1: not a geom of the model
    int body;
    double size;                        // radius of a ball around it [m]; 0 for planes
    std::array<mjtNum, 3> position;     // in the body's frame, unless a geom
    std::array<mjtNum, 9> orientation;  // in the body's frame, unless a geom
  };

  void set_light(const RenderingOptions& options);
  void set_colours(const RenderingOptions& options);
  void add_dust(double dust, Random& random);
  void add_spots(const Shape& face, double dust, Random& random);

  const mjModel& model_;
  mjvScene scene_{};
  std::vector<Shape> clean_;   // as in the model
  std::vector<Shape> shapes_;  // as drawn
  bool casts_shadows_{false};
};

}  // namespace trifinger::rendering::detail
