// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <vector>

#include "trifinger/tracking/tracker.hpp"
#include "view.hpp"

namespace trifinger::tracking::detail {

// A pose that may be the object's, good to some degrees.
struct Guess {
  Eigen::Isometry3d pose;
  double score;
};

// Finds where the object may be from nothing but labels.
//
// First, places: a grid of points, each with a square in every camera in which the object would
// lie. The share of coloured blocks in the squares says where something coloured is in all cameras.
// Then, at the best places, orientations: the areas and centres of the colours around the place are
// compared with what each of many rotations predicts.
class Search {
 public:
  Search(const std::vector<View>& views, const Shape& shape, std::size_t num_colours,
         const TrackerOptions& options);

  // Looks for places in new images.
  void begin(const std::vector<View>& views) noexcept;
  // The guesses at the best place that was not looked at yet; none if there is none. They are valid
  // until the next call.
  [[nodiscard]] std::span<const Guess> next(const std::vector<View>& views) noexcept;

 private:
  struct Square {
    std::int16_t column, row, half;  // [block]; half is 0 if the camera does not see the place
  };
  struct Place {
    Eigen::Vector3d position;
    std::array<Square, kMaxCameras> squares;
    double score;
  };
  // What a camera shows of a colour around a place, or should show.
  struct Patch {
    double area{0};                                   // [block]
    Eigen::Vector2d centre{Eigen::Vector2d::Zero()};  // [pixel]
  };
  struct ScoredRotation {
    std::size_t rotation;
    double score;
  };

  void score_places(const std::vector<View>& views) noexcept;
  void look_around(const std::vector<View>& views, const Place& place) noexcept;
  void turn_at(const std::vector<View>& views, const Place& place) noexcept;
  [[nodiscard]] Guess fit(const std::vector<View>& views, const Place& place,
                          std::size_t rotation) noexcept;
  void keep(const Guess& guess) noexcept;

  const Shape* shape_;
  std::size_t num_colours_;
  std::vector<Place> places_;
  std::vector<Eigen::Matrix3d> rotations_;
  std::vector<Patch> seen_;      // of each camera and colour
  std::vector<Patch> expected_;  // scratch, like `seen_`
  std::vector<ScoredRotation> turns_;
  std::vector<Guess> guesses_;
  std::vector<const Place*> looked_at_;
};

}  // namespace trifinger::tracking::detail
