// SPDX-License-Identifier: BSD-3-Clause
#include "search.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "model/symmetric_solve.hpp"

namespace trifinger::tracking::detail {
namespace {

constexpr double kSpacing = 0.015;       // of places [m]
constexpr std::size_t kMaxPlaces = 3;    // that are looked at closely
constexpr double kMinPlace = 0.1;        // score of a place where there is something
constexpr double kApart = 0.03;          // between two of them [m]
constexpr std::size_t kRotations = 900;  // about 20 degrees from one to the next
constexpr std::size_t kMaxTurns = 48;    // rotations that are fitted at a place
constexpr std::size_t kMaxGuesses = 5;
constexpr double kSameTurn = 0.3;    // guesses this near are one [rad]
constexpr double kSamePlace = 0.02;  // [m]

// Rotations that are spread evenly: the super-Fibonacci spiral (Alexa 2022).
Eigen::Matrix3d spiral_rotation(std::size_t i) {
  constexpr double kPhi = std::numbers::sqrt2;
  constexpr double kPsi = 1.533751168755204288118041;
  const double s = static_cast<double>(i) + 0.5;
  const double t = s / kRotations;
  const double d = 2 * std::numbers::pi * s;
  const double r = std::sqrt(t);
  const double big = std::sqrt(1 - t);
  const double alpha = d / kPhi;
  const double beta = d / kPsi;
  return Eigen::Quaterniond(r * std::sin(alpha), r * std::cos(alpha), big * std::sin(beta),
                            big * std::cos(beta))
      .normalized()
      .toRotationMatrix();
}

double angle_between(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) noexcept {
  const double cosine = ((a.transpose() * b).trace() - 1) / 2;
  return std::acos(std::clamp(cosine, -1.0, 1.0));
}

}  // namespace

Search::Search(const std::vector<View>& views, const Shape& shape, std::size_t num_colours,
               const TrackerOptions& options)
    : shape_(&shape),
      num_colours_(num_colours),
      seen_(views.size() * num_colours),
      expected_(views.size() * num_colours) {
  const double spacing = std::min(kSpacing, shape.mean_width / 3);
  const int across = static_cast<int>(options.search_radius / spacing);
  const int up = static_cast<int>((options.search_top - options.search_bottom) / spacing);
  for (int k = 0; k <= up; ++k) {
    for (int j = -across; j <= across; ++j) {
      for (int i = -across; i <= across; ++i) {
        Place place{.position = {i * spacing, j * spacing, options.search_bottom + k * spacing},
                    .squares = {},
                    .score = 0};
        if (place.position.head<2>().norm() > options.search_radius) continue;
        for (std::size_t c = 0; c < views.size(); ++c) {
          const View& view = views[c];
          if (view.seen(place.position).z() < 2 * shape.radius) continue;
          const Projected at = view.project_with_slope(place.position);
          // Two directions across the view are enlarged alike; the third is not seen.
          const double scale = at.slope.norm() / std::numbers::sqrt2;
          const Eigen::Vector2d block = at.pixel / 2;
          if (!view.image.contains(at.pixel, 0)) continue;
          place.squares[c] = {.column = static_cast<std::int16_t>(std::lround(block.x())),
                              .row = static_cast<std::int16_t>(std::lround(block.y())),
                              .half = static_cast<std::int16_t>(
                                  std::max(1L, std::lround(scale * shape.mean_width / 4)))};
        }
        places_.push_back(place);
      }
    }
  }
  for (std::size_t i = 0; i < kRotations; ++i) rotations_.push_back(spiral_rotation(i));
  turns_.resize(kRotations);
  guesses_.reserve(kMaxGuesses);
  looked_at_.reserve(kMaxPlaces);
}

void Search::score_places(const std::vector<View>& views) noexcept {
  for (Place& place : places_) {
    place.score = 0;
    for (std::size_t c = 0; c < views.size(); ++c) {
      const LabelledImage& image = views[c].image;
      const Square& square = place.squares[c];
      if (square.half == 0 || !image.exists()) continue;
      const auto coloured = [&](int half) {
        return image.coloured(std::max(0, square.column - half), std::max(0, square.row - half),
                              std::min(image.columns(), square.column + half),
                              std::min(image.rows(), square.row + half));
      };
      const int half = square.half;
      const double inside = coloured(half);
      const double around = coloured(half + half / 2) - inside;
      const double area = 4.0 * half * half;
      // Colours around the square belong to a place beside this one.
      place.score += (inside - 0.5 * around) / area;
    }
  }
}

void Search::look_around(const std::vector<View>& views, const Place& place) noexcept {
  for (std::size_t c = 0; c < views.size(); ++c) {
    Patch* const patches = seen_.data() + c * num_colours_;
    std::fill_n(patches, num_colours_, Patch{});
    const LabelledImage& image = views[c].image;
    const Square& square = place.squares[c];
    if (square.half == 0 || !image.exists()) continue;
    const int reach = static_cast<int>(1.1 * 2 * shape_->radius / shape_->mean_width *
                                       static_cast<double>(square.half));
    for (int row = std::max(0, square.row - reach);
         row < std::min(image.rows(), square.row + reach); ++row) {
      for (int column = std::max(0, square.column - reach);
           column < std::min(image.columns(), square.column + reach); ++column) {
        const Labels labels = image.labels(column, row);
        if (!labels.is_coloured()) continue;
        const int x = column - square.column;
        const int y = row - square.row;
        if (x * x + y * y > reach * reach) continue;
        const bool is_open = labels.second != kNoColour;
        const auto add = [&](Label label, double weight) {
          patches[label].area += weight;
          patches[label].centre += weight * Eigen::Vector2d(column, row);
        };
        add(labels.first, (is_open ? 0.6 : 1) * image.weight(labels.first));
        if (is_open) add(labels.second, 0.4 * image.weight(labels.second));
      }
    }
    for (std::size_t k = 0; k < num_colours_; ++k) {
      if (patches[k].area <= 0) continue;
      patches[k].centre = 2 * patches[k].centre / patches[k].area + Eigen::Vector2d::Constant(0.5);
    }
  }
}

void Search::turn_at(const std::vector<View>& views, const Place& place) noexcept {
  std::array<Eigen::Vector3d, kMaxCameras> towards;
  std::array<double, kMaxCameras> blocks;  // per square metre that faces the camera
  for (std::size_t c = 0; c < views.size(); ++c) {
    towards[c] = (views[c].position - place.position).normalized();
    const double half = place.squares[c].half;
    blocks[c] = 4 * half * half / (shape_->mean_width * shape_->mean_width);
  }
  for (std::size_t i = 0; i < kRotations; ++i) {
    double score = 0;
    for (std::size_t c = 0; c < views.size(); ++c) {
      if (place.squares[c].half == 0 || !views[c].image.exists()) continue;
      std::array<double, 255> areas;
      std::fill_n(areas.begin(), num_colours_, 0.0);
      const Eigen::Vector3d direction = rotations_[i].transpose() * towards[c];
      for (const Face& face : shape_->faces) {
        areas[face.label] += views[c].image.weight(face.label) * face.area * blocks[c] *
                             std::max(0.0, face.normal.dot(direction));
      }
      const Patch* const patches = seen_.data() + c * num_colours_;
      for (std::size_t k = 0; k < num_colours_; ++k) {
        const double difference = patches[k].area - areas[k];
        // Something in front may hide a face, but nothing paints one.
        score += std::min(patches[k].area, areas[k]) -
                 (difference > 0 ? 0.7 * difference : -0.15 * difference);
      }
    }
    turns_[i] = {i, score};
  }
  const auto last = turns_.begin() + kMaxTurns;
  std::partial_sort(turns_.begin(), last, turns_.end(),
                    [](const ScoredRotation& a, const ScoredRotation& b) {
                      return a.score != b.score ? a.score > b.score : a.rotation < b.rotation;
                    });
  for (auto turn = turns_.begin(); turn != last; ++turn) {
    Guess guess = fit(views, place, turn->rotation);
    guess.score += turn->score;
    keep(guess);
  }
}

// Moves and turns the object at a place until the centres of its colours are where the cameras show
// them: two steps of Gauss-Newton on the faces that a rotation predicts. The score is negative.
Guess Search::fit(const std::vector<View>& views, const Place& place,
                  std::size_t rotation) noexcept {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  Guess guess{.pose = Eigen::Isometry3d::Identity(), .score = 0};
  guess.pose.linear() = rotations_[rotation];
  guess.pose.translation() = place.position;
  constexpr int kSteps = 3;
  for (int step = 0; step < kSteps; ++step) {
    Eigen::Matrix<double, 6, 6> sum = Eigen::Matrix<double, 6, 6>::Zero();
    Vector6 right = Vector6::Zero();
    guess.score = 0;
    double total = 1e-9;
    double largest = 1;  // tolerance [pixel]
    for (std::size_t c = 0; c < views.size(); ++c) {
      if (place.squares[c].half == 0 || !views[c].image.exists()) continue;
      const Patch* const patches = seen_.data() + c * num_colours_;
      const double tolerance = 0.5 * place.squares[c].half;  // an eighth of the width [pixel]
      largest = std::max(largest, tolerance);
      for (std::size_t k = 0; k < num_colours_; ++k) {
        if (patches[k].area < 12) continue;
        Eigen::Vector3d point = Eigen::Vector3d::Zero();
        double area = 0;
        for (const Face& face : shape_->faces) {
          if (face.label != k) continue;
          const double visible = face.area * std::max(0.0, facing(views[c], guess.pose, face));
          point += visible * (guess.pose.linear() * face.centre);
          area += visible;
        }
        if (area <= 0) continue;
        point /= area;
        const Projected at = views[c].project_with_slope(guess.pose.translation() + point);
        const Eigen::Vector2d error = patches[k].centre - at.pixel;
        Eigen::Matrix<double, 2, 6> slope;
        slope.leftCols<3>() = at.slope;
        // A turn by w moves the point by w x point.
        Eigen::Matrix3d cross;
        cross << 0, -point.z(), point.y(), point.z(), 0, -point.x(), -point.y(), point.x(), 0;
        slope.rightCols<3>() = -at.slope * cross;
        const double squares = error.squaredNorm() / (tolerance * tolerance);
        const double weight = patches[k].area / (1 + squares / 4);
        guess.score -= 0.5 * patches[k].area * std::min(1.0, squares / 4);
        sum += weight * slope.transpose() * slope;
        right += weight * slope.transpose() * error;
        total += weight;
      }
    }
    if (step + 1 == kSteps) break;
    // Hidden parts shift the centres of faces, so the rotation keeps to what it is, to some 15
    // degrees.
    constexpr double kKept = 0.25;  // [rad]
    sum.diagonal().head<3>().array() += 1e-6 * sum.diagonal().head<3>().maxCoeff() + 1e-9;
    sum.diagonal().tail<3>().array() += total * largest * largest / (kKept * kKept);
    const Vector6 move = symmetric_solve(sum, right);
    guess.pose.translation() += move.head<3>();
    const double angle = move.tail<3>().norm();
    if (angle > 1e-9) {
      guess.pose.linear() =
          Eigen::AngleAxisd(std::min(angle, 0.4), move.tail<3>() / angle).toRotationMatrix() *
          guess.pose.linear();
    }
  }
  return guess;
}

// Keeps the best guesses that differ.
void Search::keep(const Guess& guess) noexcept {
  for (Guess& other : guesses_) {
    if ((other.pose.translation() - guess.pose.translation()).norm() > kSamePlace ||
        angle_between(other.pose.linear(), guess.pose.linear()) > kSameTurn) {
      continue;
    }
    if (guess.score > other.score) other = guess;
    return;
  }
  if (guesses_.size() == kMaxGuesses) {
    const auto worst = std::ranges::min_element(guesses_, {}, &Guess::score);
    if (guess.score > worst->score) *worst = guess;
    return;
  }
  guesses_.push_back(guess);
}

void Search::begin(const std::vector<View>& views) noexcept {
  looked_at_.clear();
  score_places(views);
}

std::span<const Guess> Search::next(const std::vector<View>& views) noexcept {
  guesses_.clear();
  if (looked_at_.size() == kMaxPlaces) return {};
  const Place* best = nullptr;
  for (const Place& place : places_) {
    if (place.score < kMinPlace || (best != nullptr && place.score <= best->score)) continue;
    const bool is_new = std::ranges::none_of(looked_at_, [&](const Place* other) {
      return (other->position - place.position).norm() < kApart;
    });
    if (is_new) best = &place;
  }
  if (best == nullptr) return {};
  looked_at_.push_back(best);
  look_around(views, *best);
  turn_at(views, *best);
  std::ranges::sort(guesses_, std::ranges::greater{}, &Guess::score);
  return guesses_;
}

}  // namespace trifinger::tracking::detail
