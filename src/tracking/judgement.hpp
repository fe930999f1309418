// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "view.hpp"

namespace trifinger::tracking::detail {

constexpr double kOther = 1.5;  // what the colour of another face takes from a score

// How well a pose explains the colours in all images. Areas are in blocks of pixels.
struct Verdict {
  double matched{0};       // of faces that show their colour
  double other{0};         // of faces that show the colour of another face
  double contradicted{0};  // of whole faces that show the colour of another face
  double hidden{0};        // of faces that show no colour: something stands in front of them
  double unexplained{0};   // of colours around the object where it has none
  int cameras{0};          // that show the object
  int faces{0};            // that are shown
  int directions{0};       // that faces which are shown have; opposite ones count once
  // The score of the best pose that differs by a turn of the object onto itself, relative to that
  // of this pose, as far as the faces that are shown tell it.
  double twin{0};

  // What speaks for the pose less what speaks against it.
  [[nodiscard]] double score() const noexcept {
    return matched - kOther * other - 0.2 * hidden - 0.7 * unexplained;
  }
  // Share of the colours seen that are where the pose has them.
  [[nodiscard]] double purity() const noexcept {
    const double seen = matched + other + unexplained;
    return seen > 0 ? matched / seen : 0;
  }
  // Share of the faces in the images that show their colour.
  [[nodiscard]] double completeness() const noexcept {
    const double expected = matched + other + hidden;
    return expected > 0 ? matched / expected : 0;
  }
};

class Judge {
 public:
  explicit Judge(const Shape& shape);

  [[nodiscard]] Verdict judge(const std::vector<View>& views,
                              const Eigen::Isometry3d& pose) noexcept;

 private:
  struct Outline {
    Label label;
    std::vector<Eigen::Vector3d> sides;  // a x + b y + c > 0 inside [pixel]
  };

  [[nodiscard]] double twin() const noexcept;
  void draw_outlines(const View& view, const Eigen::Isometry3d& pose) noexcept;
  [[nodiscard]] double unexplained(const View& view, const Eigen::Isometry3d& pose) const noexcept;

  const Shape* shape_;
  std::vector<Outline> outlines_;
  std::vector<double> shown_;  // of each face [block]
};

}  // namespace trifinger::tracking::detail
