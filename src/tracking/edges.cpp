// SPDX-License-Identifier: BSD-3-Clause
#include "edges.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

namespace trifinger::tracking::detail {
namespace {

constexpr double kGrazing = 0.12;    // faces that lean more than this show edges that are too near
constexpr int kMaxSpots = 14;        // on an edge
constexpr int kFewSpots = 2;         // on an edge of an object with very many edges
constexpr double kSpotDistance = 5;  // [pixel]
constexpr int kMaxLines = 4000;      // about
constexpr int kStepReach = 12;       // half of the longest profile across an edge [pixel]
constexpr int kStepMargin = 4;       // read on both sides of the step to know the colours

// The unknowns are the position of the object, a turn about the world's axes, the shift of each
// camera's image, and how far all edges seem to lie outside of where they are.
using Unknowns = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 7 + 2 * kMaxCameras, 1>;
using Normals = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 7 + 2 * kMaxCameras,
                              7 + 2 * kMaxCameras>;

Eigen::Index shift_of(std::size_t camera) noexcept {
  return static_cast<Eigen::Index>(6 + 2 * camera);
}
Eigen::Index growth_of(const Unknowns& unknowns) noexcept { return unknowns.size() - 1; }

// How far a measured edge is from where the unknowns expect it [pixel].
double unexplained(const EdgeLine& line, const Unknowns& unknowns) noexcept {
  return line.offset - line.slope.dot(unknowns.head<6>()) -
         line.normal.dot(unknowns.segment<2>(shift_of(line.camera))) -
         unknowns[growth_of(unknowns)];
}

// Adds a measured edge to the upper half of the normal equations.
void add_line(const EdgeLine& line, double weight, Normals& sum, Unknowns& right) noexcept {
  const Eigen::Index shift = shift_of(line.camera);
  const Eigen::Index growth = growth_of(right);
  const double target = line.offset;
  Eigen::Matrix<double, 8, 1> slope;
  slope << line.slope.transpose(), line.normal;
  sum.topLeftCorner<6, 6>() += weight * slope.head<6>() * slope.head<6>().transpose();
  sum.block<6, 2>(0, shift) += weight * slope.head<6>() * slope.tail<2>().transpose();
  sum.block<2, 2>(shift, shift) += weight * slope.tail<2>() * slope.tail<2>().transpose();
  right.head<6>() += weight * target * slope.head<6>();
  right.segment<2>(shift) += weight * target * slope.tail<2>();
  sum.block<6, 1>(0, growth) += weight * slope.head<6>();
  sum.block<2, 1>(shift, growth) += weight * slope.tail<2>();
  sum(growth, growth) += weight;
  right[growth] += weight * target;
}

// Adds what is known without any lines: then the pose stays where it is, and is known to nothing
// better than this.
void add_priors(double calibration_error, Normals& sum) noexcept {
  constexpr double kUnknownPosition = 0.05;  // [m]
  constexpr double kUnknownRotation = 0.5;   // [rad]
  const Eigen::Index growth = sum.rows() - 1;
  sum.diagonal().head<3>().array() += 1 / (kUnknownPosition * kUnknownPosition);
  sum.diagonal().segment<3>(3).array() += 1 / (kUnknownRotation * kUnknownRotation);
  sum.diagonal().segment(6, growth - 6).array() += 1 / (calibration_error * calibration_error);
  // Blur next to dark rims, rims that are not as wide as they are said to be, and lenses make
  // faces look larger or smaller than they are.
  constexpr double kGrowth = 0.7;  // [pixel]
  sum(growth, growth) += 1 / (kGrowth * kGrowth);
}

void move_pose(const Unknowns& unknowns, Eigen::Isometry3d& pose) noexcept {
  const Eigen::Vector3d turn = unknowns.segment<3>(3);
  pose.translation() += unknowns.head<3>();
  if (turn.norm() > 1e-12) {
    pose.linear() =
        Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix() *
                           pose.linear())
            .normalized()
            .toRotationMatrix();
  }
}

// The colours across an edge, from the inside of the face to its outside, a pixel apart.
struct Profile {
  int half{0};  // index of the middle
  std::array<Rgb, 2 * kStepReach + 1> colours;
  std::array<int, 2 * kStepReach + 1> is_face{};  // 1 where the colour may be the face's, else -1
  int total{0};                                   // of `is_face`
};

// The first sample outside of the face: inside of it as many samples as possible have its colour,
// outside as few as possible.
int first_outside(const Profile& profile) noexcept {
  int inside = 0;
  double best = -1e9;
  int step = 0;
  for (int i = 0; i < 2 * profile.half - 1; ++i) {
    if (i >= kStepMargin) {
      const double score = inside - (profile.total - inside) - 0.15 * std::abs(i - profile.half);
      if (score > best) {
        best = score;
        step = i;
      }
    }
    inside += profile.is_face[static_cast<std::size_t>(i)];
  }
  return step;
}

}  // namespace

EdgeFit::EdgeFit(const std::vector<View>& views, const Shape& shape, const ColourTable& table,
                 double calibration_error)
    : shape_(&shape), table_(&table), calibration_error_(std::max(0.05, calibration_error)) {
  std::size_t edges = 0;
  for (const Face& face : shape.faces) edges += views.size() * face.corners.size();
  // All edges in all cameras share the lines.
  most_spots_ = std::clamp(kMaxLines / static_cast<int>(edges), kFewSpots, kMaxSpots);
  const std::size_t most_lines = edges * static_cast<std::size_t>(most_spots_);
  lines_.reserve(most_lines);
  sides_.resize(shape.faces.size());
  sorted_.reserve(most_lines);
}

// Calls `measure(spot, offset)` at places on all visible edges, and keeps what it finds.
template <class Measure>
void EdgeFit::measure_edges(const std::vector<View>& views, const Eigen::Isometry3d& pose,
                            Measure measure) noexcept {
  lines_.clear();
  images_.fill({});
  std::ranges::fill(sides_, Shown{});
  for (std::size_t c = 0; c < views.size(); ++c) {
    const View& view = views[c];
    if (!view.image.exists()) continue;
    if (view.seen(pose.translation()).z() < 1.5 * shape_->radius) continue;
    for (const Face& face : shape_->faces) {
      if (facing(view, pose, face) < kGrazing) continue;
      const Eigen::Vector2d middle = view.project(pose * face.centre);
      for (std::size_t i = 0; i < face.corners.size(); ++i) {
        if (face.same_beyond[i] >= 0 &&
            facing(view, pose, shape_->faces[static_cast<std::size_t>(face.same_beyond[i])]) > 0) {
          continue;
        }
        const Eigen::Vector3d from = pose * face.corners[i];
        const Eigen::Vector3d along =
            pose.linear() * (face.corners[(i + 1) % face.corners.size()] - face.corners[i]);
        const double length = (view.project(from + along) - view.project(from)).norm();
        const int spots = static_cast<int>(std::min<double>(most_spots_, length / kSpotDistance));
        for (int k = 0; k < spots; ++k) {
          // Corners show other edges, so the ends are left out.
          const double share = 0.06 + 0.88 * (k + 0.5) / spots;
          const Eigen::Vector3d point = from + share * along;
          const Projected at = view.project_with_slope(point);
          const Eigen::Vector2d tangent = (at.slope * along).normalized();
          Eigen::Vector2d normal(tangent.y(), -tangent.x());
          if (normal.dot(at.pixel - middle) < 0) normal = -normal;
          const Spot spot{&view, face.label, at.pixel, normal};
          if (!view.image.contains(at.pixel, 3)) continue;
          double offset = 0;
          ++images_[c].looked;
          ++sides_[face.sides[i]].looked;
          if (!measure(spot, offset)) continue;
          ++images_[c].measured;
          const Eigen::Vector3d arm = point - pose.translation();
          EdgeLine line{
              .camera = c, .side = face.sides[i], .normal = normal, .slope = {}, .offset = offset};
          const Eigen::RowVector3d across = normal.transpose() * at.slope;
          line.slope.head<3>() = across;
          // across * (w x arm) = w * (arm x across)
          line.slope.tail<3>() = arm.cross(across.transpose()).transpose();
          lines_.push_back(line);
        }
      }
    }
  }
}

// Finds where blocks of pixels cease to have the face's colour.
bool EdgeFit::find_label_step(const Spot& spot, double reach, double& offset) noexcept {
  constexpr double kStep = 2;  // a block [pixel]
  constexpr int kMost = 12;
  const int half = std::min(kMost, static_cast<int>(reach / kStep));
  if (!spot.view->image.contains(spot.pixel, 2)) return false;
  std::array<int, 2 * kMost + 1> is_face{};
  int total = 0;
  for (int i = 0; i <= 2 * half; ++i) {
    const Eigen::Vector2d pixel = spot.pixel + (i - half) * kStep * spot.normal;
    const bool same = spot.view->image.labels_at(pixel).may_be(spot.label);
    is_face[static_cast<std::size_t>(i)] = same ? 1 : -1;
    total += same ? 1 : -1;
  }
  // Inside the step as many blocks as possible have the colour, outside as few as possible.
  int inside = 0;
  double best = 0;
  int best_step = 0;
  for (int i = 0; i <= 2 * half; ++i) {
    const double score = inside - (total - inside) - 0.15 * std::abs(i - half);
    if (i == 0 || score > best) {
      best = score;
      best_step = i;
    }
    inside += is_face[static_cast<std::size_t>(i)];
  }
  // Nothing of this colour: hidden, or far away. Nothing else: the edge is farther out than the
  // line.
  if (best_step < 2 || best < half) return false;
  offset = (best_step - half - 0.5) * kStep;
  return true;
}

// Finds the step to a part of a pixel. The colours on both sides are taken from the image itself,
// so light and shadow do not matter.
bool EdgeFit::find_step(const Spot& spot, double reach, double& offset) const noexcept {
  const int half = std::min(kStepReach, static_cast<int>(std::lround(reach)) + kStepMargin);
  const LabelledImage& image = spot.view->image;
  if (!image.contains(spot.pixel + half * spot.normal, 3) ||
      !image.contains(spot.pixel - half * spot.normal, 3)) {
    return false;
  }
  Profile profile;
  profile.half = half;
  auto& colours = profile.colours;
  auto& is_face = profile.is_face;
  const auto x = static_cast<float>(spot.pixel.x());
  const auto y = static_cast<float>(spot.pixel.y());
  const auto nx = static_cast<float>(spot.normal.x());
  const auto ny = static_cast<float>(spot.normal.y());
  for (int i = 0; i <= 2 * half; ++i) {
    const auto d = static_cast<float>(i - half);
    const auto place = static_cast<std::size_t>(i);
    colours[place] = image.colour(x + d * nx, y + d * ny);
    is_face[place] = image.labels_of(*table_, colours[place]).may_be(spot.label) ? 1 : -1;
    profile.total += is_face[place];
  }
  const int step = first_outside(profile);
  const auto at = [](int i) { return static_cast<std::size_t>(i); };
  if (is_face[at(step - 2)] < 0 || is_face[at(step - 3)] < 0 || is_face[at(step + 1)] > 0) {
    return false;
  }
  const Rgb inner = (colours[at(step - 4)] + colours[at(step - 3)]) / 2;
  // The colour next to the face. A rim may be narrow, so what lies beyond it must not count as it:
  // of two samples the darker one is the rim. Without a rim, the one that differs more is clear of
  // the face.
  const Rgb& near = colours[at(step + 1)];
  const Rgb& far = colours[at(step + 2)];
  const bool is_near = shape_->has_rims
      ? near.sum()<far.sum() : (near - inner).squaredNorm()>(far - inner).squaredNorm();
  const Rgb outer = is_near ? near : far;
  const Rgb contrast = inner - outer;
  const float size = contrast.squaredNorm();
  constexpr float kMinContrast = 18;
  if (size < kMinContrast * kMinContrast) return false;
  const auto share = [&](int i) { return (colours[at(i)] - outer).dot(contrast) / size; };
  for (int i = step - 3; i < step + 2; ++i) {
    const float here = share(i);
    const float next = share(i + 1);
    if (here < 0.5F || next >= 0.5F) continue;
    offset = i - half + static_cast<double>((here - 0.5F) / (here - next));
    return std::abs(offset) <= reach + 1;
  }
  return false;
}

Fit EdgeFit::solve(std::size_t cameras, double scale, Eigen::Isometry3d& pose) noexcept {
  Fit fit;
  for (const Shown& image : images_) fit.looked += image.looked;
  const auto size = static_cast<Eigen::Index>(7 + 2 * cameras);
  Unknowns unknowns = Unknowns::Zero(size);
  Normals inverse(size, size);
  constexpr int kRounds = 4;
  double spread = scale;
  // The noise of neighbouring lines is alike, so a line counts for less than its own noise says.
  constexpr double kLineError = 0.6;  // [pixel]
  // A few edges that are found to a tenth of a pixel must not make the others look wrong.
  constexpr double kAgreeing = 1;  // [pixel]
  for (int round = 0; round < kRounds; ++round) {
    Normals sum = Normals::Zero(size, size);
    Unknowns right = Unknowns::Zero(size);
    fit.used = 0;
    for (Shown& image : images_) image.agreeing = 0;
    for (Shown& side : sides_) side.agreeing = 0;
    double squares = 0;
    for (const EdgeLine& line : lines_) {
      const double error = unexplained(line, unknowns);
      const double relative = error / (3 * spread);
      if (std::abs(error) < std::max(kAgreeing, 3 * spread)) {
        ++images_[line.camera].agreeing;
        ++sides_[line.side].agreeing;
      }
      if (std::abs(relative) >= 1) continue;
      ++fit.used;
      squares += error * error;
      const double root = 1 - relative * relative;  // Tukey
      add_line(line, root * root / (kLineError * kLineError), sum, right);
    }
    fit.residual = fit.used > 0 ? std::sqrt(squares / fit.used) : 0;
    sum.triangularView<Eigen::StrictlyLower>() = sum.transpose();
    add_priors(calibration_error_, sum);
    const Eigen::LDLT<Normals> factors(sum);
    unknowns = factors.solve(right);
    if (round + 1 == kRounds || lines_.empty()) {
      inverse.setIdentity(size, size);
      inverse = factors.solve(inverse);
      break;
    }
    // The spread that most lines have.
    sorted_.clear();
    for (const EdgeLine& line : lines_) sorted_.push_back(std::abs(unexplained(line, unknowns)));
    if (sorted_.empty()) break;
    const auto middle = sorted_.begin() + static_cast<std::ptrdiff_t>(sorted_.size() / 2);
    std::nth_element(sorted_.begin(), middle, sorted_.end());
    spread = std::clamp(1.5 * *middle, 0.2 * scale, scale);
  }
  fit.growth = unknowns[growth_of(unknowns)];
  fit.covariance = inverse.topLeftCorner<6, 6>();
  move_pose(unknowns, pose);
  return fit;
}

// Whether the colour of the face goes on beyond its edge, and is not that of a table, too.
bool EdgeFit::goes_on(const Spot& spot) noexcept {
  if (spot.view->image.weight(spot.label) < 0.2) return false;
  return std::ranges::all_of(std::array{-4.0, 5.0, 8.0}, [&](double distance) {
    const Eigen::Vector2d pixel = spot.pixel + distance * spot.normal;
    return spot.view->image.labels_at(pixel).first == spot.label;
  });
}

void EdgeFit::weigh_images(Fit& fit) const noexcept {
  constexpr int kMinLooked = 20;  // fewer places say nothing
  const auto share = [](const Shown& shown, int of) {
    return shown.looked < kMinLooked ? 1.0 : static_cast<double>(shown.agreeing) / of;
  };
  for (const Shown& image : images_) {
    fit.image_confirmed = std::min(fit.image_confirmed, share(image, image.looked));
    const int ends = std::max(1, image.agreeing + image.beyond);
    fit.ending = std::min(fit.ending, share(image, ends));
    const int shown = std::max(1, image.measured + image.beyond);
    fit.image_agreeing = std::min(fit.image_agreeing, share(image, shown));
  }
  for (const Shown& side : sides_) {
    fit.side_confirmed = std::min(fit.side_confirmed, share(side, side.looked));
  }
}

void EdgeFit::approach(const std::vector<View>& views, Eigen::Isometry3d& pose) noexcept {
  for (const double reach : {20.0, 16.0, 12.0}) {
    measure_edges(views, pose, [reach](const Spot& spot, double& offset) noexcept {
      return find_label_step(spot, reach, offset);
    });
    (void)solve(views.size(), reach / 4, pose);
  }
}

Fit EdgeFit::refine(const std::vector<View>& views, Eigen::Isometry3d& pose) noexcept {
  Fit fit;
  constexpr std::array kReaches{6.0, 4.0, 3.0, 3.0};
  for (std::size_t round = 0; round < kReaches.size(); ++round) {
    const double reach = kReaches[round];
    const bool is_last = round + 1 == kReaches.size();
    measure_edges(views, pose, [&](const Spot& spot, double& offset) noexcept {
      if (is_last && goes_on(spot)) {
        ++images_[static_cast<std::size_t>(spot.view - views.data())].beyond;
      }
      return find_step(spot, reach, offset);
    });
    fit = solve(views.size(), reach / 4, pose);
  }
  weigh_images(fit);
  return fit;
}

int EdgeFit::places_elsewhere(const std::vector<View>& views,
                              const Eigen::Isometry3d& pose) noexcept {
  constexpr double kStep = 2;      // between shifts [pixel]
  constexpr int kSteps = 12;       // each way
  constexpr double kNear = 6;      // calibrations are off by less [pixel]
  constexpr double kAgreeing = 3;  // [pixel]: labels are those of blocks
  constexpr int kFew = 8;          // places that say nothing
  measure_edges(views, pose, [](const Spot& spot, double& offset) noexcept {
    return find_label_step(spot, kSteps * kStep, offset);
  });
  int most = kFew;
  for (auto line = lines_.cbegin(); line != lines_.cend();) {
    const auto next = std::find_if(
        line, lines_.cend(), [&](const EdgeLine& other) { return other.camera != line->camera; });
    const auto agreeing = [&](const Eigen::Vector2d& shift) {
      return static_cast<int>(std::count_if(line, next, [&](const EdgeLine& each) {
        return std::abs(each.offset - each.normal.dot(shift)) < kAgreeing;
      }));
    };
    const int here = agreeing(Eigen::Vector2d::Zero());
    const bool is_clear = next - line - here <= most;  // no shift can explain more
    for (int i = -kSteps; i <= kSteps && !is_clear; ++i) {
      for (int j = -kSteps; j <= kSteps; ++j) {
        const Eigen::Vector2d shift(kStep * i, kStep * j);
        if (shift.norm() >= kNear) most = std::max(most, agreeing(shift) - here);
      }
    }
    line = next;
  }
  return most;
}

}  // namespace trifinger::tracking::detail
