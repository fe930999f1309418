// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <vector>

#include "view.hpp"

namespace trifinger::tracking::detail {

// What the edges of faces say about a pose.
struct Fit {
  // Covariance of the position [m] and of a turn about the world's axes [rad].
  Eigen::Matrix<double, 6, 6> covariance{Eigen::Matrix<double, 6, 6>::Zero()};
  double residual{0};  // root mean square of what is unexplained [pixel]
  int looked{0};       // places on edges that were looked at
  int used{0};         // measured places that determine the pose
  // Shares of places where an edge agrees, of the image that confirms the pose least and of the
  // side of the object that is confirmed least: an object of another size ends before some of its
  // sides.
  double image_confirmed{1};
  double side_confirmed{1};
  // Of the image that speaks most against the pose: the share of these places among them and those
  // where the colour of a face goes on beyond its edge. Something may hide an edge, but nothing
  // paints a face where there is none.
  double ending{1};
  // The image that contradicts the pose most has this share: of the places where there is an edge,
  // or where the colour of a face goes on, those where the edge agrees.
  double image_agreeing{1};
  double growth{0};  // how far all edges seem to lie outside of where they are [pixel]
};

// A measured place on an edge.
struct EdgeLine {
  std::size_t camera;
  std::size_t side;                   // of the object, where the face ends
  Eigen::Vector2d normal;             // out of the face
  Eigen::Matrix<double, 1, 6> slope;  // of the edge along the normal [pixel per m, rad]
  double offset;                      // of the measured edge from the expected one [pixel]
};

// Moves a pose until the edges of the coloured faces are where the cameras show them.
//
// At many places of each visible edge, the image is read along a line across the edge. Where the
// colour of the face ends, there is the edge; nothing is measured where the face is hidden.
// Gauss-Newton with robust weights then finds the pose, and with it how far each camera's image is
// shifted: calibrations are not exact, and a shift of one image must not turn the object.
class EdgeFit {
 public:
  EdgeFit(const std::vector<View>& views, const Shape& shape, const ColourTable& table,
          double calibration_error);

  // From a guess that is good to some 15 pixels to some pixels, with labels only.
  void approach(const std::vector<View>& views, Eigen::Isometry3d& pose) noexcept;
  // From some pixels to the limit of what the images tell.
  [[nodiscard]] Fit refine(const std::vector<View>& views, Eigen::Isometry3d& pose) noexcept;
  // Whether an image is old: how many more places on edges agree after a shift of 6 pixels or more
  // than without one, of the image with most. At least 8, because fewer say nothing. Something in
  // front of the object hides edges, but does not move them.
  [[nodiscard]] int places_elsewhere(const std::vector<View>& views,
                                     const Eigen::Isometry3d& pose) noexcept;

 private:
  // A place on an edge, before it is measured.
  struct Spot {
    const View* view;
    Label label;
    Eigen::Vector2d pixel;
    Eigen::Vector2d normal;
  };

  template <class Measure>
  void measure_edges(const std::vector<View>& views, const Eigen::Isometry3d& pose,
                     Measure measure) noexcept;
  [[nodiscard]] static bool find_label_step(const Spot& spot, double reach,
                                            double& offset) noexcept;
  [[nodiscard]] bool find_step(const Spot& spot, double reach, double& offset) const noexcept;
  Fit solve(std::size_t cameras, double scale, Eigen::Isometry3d& pose) noexcept;

  const Shape* shape_;
  const ColourTable* table_;
  double calibration_error_;
  int most_spots_{0};  // on an edge
  // What an image shows at the edges, or what all images show at a side of the object.
  struct Shown {
    int looked{0};
    int measured{0};
    int agreeing{0};
    int beyond{0};  // places where the colour of the face goes on beyond its edge
  };
  [[nodiscard]] static bool goes_on(const Spot& spot) noexcept;
  void weigh_images(Fit& fit) const noexcept;

  std::array<Shown, kMaxCameras> images_{};
  std::vector<Shown> sides_;
  std::vector<EdgeLine> lines_;
  std::vector<double> sorted_;
};

}  // namespace trifinger::tracking::detail
